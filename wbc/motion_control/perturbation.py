"""The motion's own torques, and the best perturbation of them for one step within the limits of the motors.

    tau = M(q_d) a_d + h(q_d, v_d) + u
    u = argmin x(t + dt)'Q x(t + dt) + u'R u,   lower <= tau <= upper,   x = (q (-) q_d; v - v_d)
    x(t + dt) = Phi x + Gamma u                                         linear about the motion, exact over the step

Without limits it is the first controller of :mod:`wbc.published.newton_euler`; its weights of positions, equal to those
of velocities, left positions without stiffness: here they weigh 1/dt^2 times as much.
"""

from __future__ import annotations

import numpy as np

from wbc import validation
from wbc.errors import SolverError, UnsupportedJointError
from wbc.motion_control.motion import Motion, checked_dynamics, checked_motion, measured
from wbc.multibody import mass_matrix, pin
from wbc.qp import QP, make_solver
from wbc.robot import Robot
from wbc.validation import Array

#: Weight of torques: it only decides where errors do not, each torque in units of what a unit acceleration takes
TORQUE_WEIGHT = 1e-9
#: Of the series of e^(A t): enough for steps in which linearised rates grow threefold
TERMS = 12


class OneStepPerturbation:
    """Nominal torques and the optimum one step ahead.

    Args:
        robot: the model that is believed, on a fixed base; ``robot.limits.effort`` are the limits. motion: what to
            follow. dt: step [s].

    Raises:
        RangeError: negative masses, a singular mass matrix, no step. UnsupportedJointError: a base that moves, coupled
            joints. ShapeError, NotFiniteError, RotationError: a motion of another robot.
    """

    def __init__(self, robot: Robot, motion: Motion, dt: float) -> None:
        self.motion = checked_motion(robot, motion)
        self._robot = checked_dynamics(robot, motion(0.0)[0])
        if robot.base != "fixed":
            raise UnsupportedJointError("robot.base", robot.base, "a base that moves has no torque to be perturbed")
        self.dt = validation.scalar("dt", dt, low=0.0, open_low=True, unit="s")
        self._model, self._data, n = robot.model, robot.model.createData(), robot.nv
        self._Q = np.concatenate([np.full(n, dt**-2), np.ones(n)])
        self._solver, self._rows = make_solver("daqp", n, 0), np.zeros((0, n))

    def command(self, time: float, q: Array, v: Array) -> Array:
        """Torques ``[nv]`` within the limits.

        Raises:
            ShapeError, NotFiniteError, RangeError, RotationError: no measurement. SolverError: the solver failed.
        """
        q, v = measured(self._robot, q, v)
        qd, vd, ad = self.motion(time)
        model, data, n, limit = self._model, self._data, self._model.nv, self._robot.limits.effort
        by_q, by_v, _ = pin.computeRNEADerivatives(model, data, qd, vd, ad)
        nominal = np.array(data.tau)
        M = mass_matrix(model, data, qd)
        A, unit = np.zeros((2 * n, 2 * n)), np.eye(2 * n)
        A[:n, n:] = np.eye(n)
        A[n:] = np.linalg.solve(M, np.hstack([-by_q, -by_v]))
        # E = int e^(A s) ds over the step, by Horner's rule
        E = unit
        for k in range(TERMS, 1, -1):
            E = unit + A @ E * (self.dt / k)
        E = self.dt * E
        x = np.concatenate([pin.difference(model, qd, q), v - vd])
        # In accelerations u = M y, so that heavy and light joints weigh alike
        Phi, Gamma = unit + A @ E, E[:, n:]
        H = Gamma.T @ (self._Q[:, None] * Gamma) + TORQUE_WEIGHT * self.dt**2 * np.eye(n)
        g = Gamma.T @ (self._Q * (Phi @ x))
        if not np.isfinite(limit).any():
            return np.asarray(nominal - M @ np.linalg.solve(H, g))
        inverse = np.linalg.inv(M)
        size = np.abs(np.diag(H)).max()
        solution = self._solver.solve(
            QP.checked(
                inverse @ H @ inverse.T / size, inverse @ g / size, -limit - nominal, limit - nominal, self._rows
            )
        )
        if solution.flag != "solved":
            raise SolverError("limits", limit, f"no torque within them was found: {solution.flag}")
        return np.asarray(nominal + solution.x)
