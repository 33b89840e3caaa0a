"""Nominal torque with a perturbation that is optimal one step ahead, from a computed model or from an estimated one.

    tau = tau_n + u*,   tau_n = H(q_d) q_d'' + h(q_d, q_d')
    x(k+1) = Phi x(k) + Gamma u(k),   x = (q - q_d, q' - q_d')
    u* minimises (x(k+1)' Q x(k+1) + u' R u) / 2:   u* = -(R + Gamma' Q Gamma)^-1 Gamma' Q Phi x

One step is looked ahead: this is no LQR, and with equal weights on positions and rates it has next to no stiffness.
Source: chapters 4 (5.10 to 5.15) and 6 (7.58, 7.59).
"""

from __future__ import annotations

import numpy as np

from wbc import validation
from wbc.errors import RangeError, SolverError
from wbc.motion_control.motion import Motion
from wbc.published.newton_euler.actuators import discretised
from wbc.published.newton_euler.dynamics import ArmDynamics, dynamics_of, measured
from wbc.published.newton_euler.links import SerialChain
from wbc.qp import QP, make_solver
from wbc.validation import Array

#: Weight of the thesis on torques, times the unit matrix
TORQUE_WEIGHT = 0.01
#: Weight of the thesis on errors of positions and of rates, times the unit matrix
ERROR_WEIGHT = 1e5
#: Without excitation P would grow by 1/rho a step until it is no number
LARGEST_P = 1e30


def gain(Phi: Array, Gamma: Array, Q: Array, R: Array) -> Array:
    """K of u* = -K x, [n, 2n] (5.14)."""
    return np.asarray(np.linalg.solve(R + Gamma.T @ Q @ Gamma, Gamma.T @ Q @ Phi))


class OneStep:
    """u* one step ahead, within bounds if there are any: then it is a QP.

    Attributes:
        Q: weights of errors [2n, 2n]. R: of torques [n, n].

    Raises:
        ShapeError, NotFiniteError, RangeError: weights of other shapes, or negative ones.
    """

    def __init__(self, n: int, Q: Array | None = None, R: Array | None = None) -> None:
        self.Q = _weights("Q", ERROR_WEIGHT * np.eye(2 * n) if Q is None else Q, 2 * n)
        self.R = _weights("R", TORQUE_WEIGHT * np.eye(n) if R is None else R, n)
        self._solver, self._rows = make_solver("daqp", n, 0), np.zeros((0, n))

    def __call__(self, Phi: Array, Gamma: Array, x: Array, bounds: tuple[Array, Array] | None = None) -> Array:
        """u* [n] at an error x [2n]; ``bounds``: lower and upper ones of u, [n] each.

        Raises:
            BoundsError: a lower bound lies above its upper bound. SolverError: the solver failed.
        """
        if bounds is None:
            return -gain(Phi, Gamma, self.Q, self.R) @ x
        H = self.R + Gamma.T @ self.Q @ Gamma
        solution = self._solver.solve(QP.checked((H + H.T) / 2.0, Gamma.T @ self.Q @ Phi @ x, *bounds, self._rows))
        if solution.flag != "solved":
            raise SolverError("bounds", bounds, f"no torque within them was found: {solution.flag}")
        return np.asarray(solution.x)


class Nominal:
    """No feedback: the torques of the desired motion (5.10)."""

    def __init__(self, arm: SerialChain | ArmDynamics, motion: Motion) -> None:
        self.arm, self.motion = dynamics_of(arm), motion

    def command(self, time: float, q: Array, v: Array) -> Array:
        measured(self.arm, q, v)
        qd, vd, ad = self.motion(time)
        return self.arm.equations(qd, vd).torque(ad)


class Linearised:
    """Controller 1: the perturbation by the model that is linearised about the desired motion in every step.

    Attributes:
        limits: largest torques [n]; None, as published: none. The perturbation is then the optimum within them.
    """

    def __init__(
        self,
        arm: SerialChain | ArmDynamics,
        motion: Motion,
        dt: float,
        optimum: OneStep | None = None,
        limits: Array | None = None,
    ) -> None:
        self.arm, self.motion = dynamics_of(arm), motion
        self.dt = validation.scalar("dt", dt, low=0.0, open_low=True, unit="s")
        self.optimum = optimum or OneStep(self.arm.n)
        self.limits = None if limits is None else validation.ordinary_array("limits", limits, (self.arm.n,))

    def command(self, time: float, q: Array, v: Array) -> Array:
        q, v = measured(self.arm, q, v)
        qd, vd, ad = self.motion(time)
        model = self.arm.linear_model(qd, vd, ad)
        A, B = model.system
        Phi, E = discretised(A, self.dt)
        nominal = model.torque(ad)
        bounds = None if self.limits is None else (-self.limits - nominal, self.limits - nominal)
        return nominal + self.optimum(Phi, E @ B, np.concatenate([self.arm.error(q, qd), v - vd]), bounds)


class Estimator:
    """[F G] of x(k+1) = F x + G u by recursive least squares; all rows share one P.

        theta <- theta + (x(k+1) - theta phi) (P phi)' / (phi' P phi + rho),   phi = (x, u)
        P <- (P - P phi phi' P / (phi' P phi + rho)) / rho

    Attributes:
        theta: [rows, columns]. P: [columns, columns], at first ``start`` times the unit matrix.
        rho: forgetting factor, in (0, 1]. forgets: False has (7.59) as printed, without 1/rho: nothing is forgotten.
    """

    def __init__(self, theta: Array, rho: float = 0.85, start: float = 1e6, *, forgets: bool = True) -> None:
        self.theta = validation.ordinary_array("theta", theta)
        if self.theta.ndim != 2:
            raise RangeError("theta", theta, "expected a matrix")
        self.rho = validation.scalar("rho", rho, low=0.0, high=1.0, open_low=True)
        self.P = validation.scalar("start", start, low=0.0, open_low=True) * np.eye(self.theta.shape[1])
        self.forgets = validation.flag("forgets", forgets)

    def update(self, phi: Array, following: Array) -> None:
        """What followed a state and a torque, phi (7.58, 7.59); P grows no more where it is above :data:`LARGEST_P`."""
        phi = validation.ordinary_array("phi", phi, (self.theta.shape[1],))
        following = validation.ordinary_array("following", following, (self.theta.shape[0],))
        weighed = self.P @ phi
        step = weighed / (phi @ weighed + self.rho)
        self.theta = self.theta + np.outer(following - self.theta @ phi, step)
        P = self.P - np.outer(step, weighed)
        forgets = self.forgets and np.abs(P).max() < LARGEST_P
        self.P = (P + P.T) / (2.0 * self.rho if forgets else 2.0)


class Adaptive:
    """Controller 3: the perturbation by an estimated model.

    An estimate of zeros gives no perturbation, and then nothing is ever learned: ``theta`` is by default the computed
    model of the first step. Without excitation P grows by 1/rho a step, up to :data:`LARGEST_P`.
    """

    def __init__(
        self,
        arm: SerialChain | ArmDynamics,
        motion: Motion,
        dt: float,
        optimum: OneStep | None = None,
        *,
        theta: Array | None = None,
        rho: float = 0.85,
        start: float = 1e6,
    ) -> None:
        self.arm, self.motion, self.nominal = dynamics_of(arm), motion, Nominal(arm, motion)
        self.optimum = optimum or OneStep(self.arm.n)
        if theta is None:
            A, B = self.arm.linear_model(*motion(0.0)).system
            Phi, E = discretised(A, dt)
            theta = np.hstack([Phi, E @ B])
        self.estimator = Estimator(theta, rho, start)
        self._last: Array | None = None

    def command(self, time: float, q: Array, v: Array) -> Array:
        q, v = measured(self.arm, q, v)
        qd, vd, _ = self.motion(time)
        x, n = np.concatenate([self.arm.error(q, qd), v - vd]), self.arm.n
        if self._last is not None:
            self.estimator.update(self._last, x)
        theta = self.estimator.theta
        u = self.optimum(theta[:, : 2 * n], theta[:, 2 * n :], x)
        self._last = np.concatenate([x, u])
        return self.nominal.command(time, q, v) + u


def _weights(field: str, value: Array, n: int) -> Array:
    out = validation.ordinary_array(field, value, (n, n))
    if np.abs(out - out.T).max() > 1e-12 * np.abs(out).max() or np.linalg.eigvalsh(out)[0] < 0.0:
        raise RangeError(field, value, "expected a symmetric matrix without negative eigenvalues")
    return out
