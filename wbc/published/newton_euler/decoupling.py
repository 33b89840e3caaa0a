"""Nonlinear decoupling with pole placement: every output obeys a linear equation of its own.

    x' = A(x, t) + B(x, t) u,  y = C(x, t) + D(x, t) u,  u = F + G v
    y_i^(d) + a_d-1 y_i^(d-1) + ... + a_0 y_i = a_0 v_i,   d = d_i the relative degree of output i

with N^0 = C_i, N^k = dN^k-1/dt + (dN^k-1/dx) A; d_i is 0 where D_i has entries, else the least k with
(dN^k-1/dx) B not zero; C*_i = N^d, D*_i = (dN^d-1/dx) B or D_i; F = -D*^-1 (M* + C*), M*_i = sum_k<d a_k N^k, and
G = D*^-1 diag(a_0). Source: chapter 5 after Freund (6.16 to 6.52).
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from wbc import validation
from wbc.errors import RangeError, ShapeError
from wbc.motion_control.motion import Motion
from wbc.published.newton_euler.dynamics import ArmDynamics, dynamics_of, measured
from wbc.published.newton_euler.links import SerialChain
from wbc.published.newton_euler.three_link import closed_form
from wbc.symbolic.evaluation import SingleState
from wbc.validation import Array

#: Poles of the thesis: a rise time of 0.01 s, critically damped [1/s]
POLES = (-100.0, -100.0)


class Decoupling:
    """The law of any system that is affine in its inputs, as expressions in x and t.

    Attributes:
        degrees: relative degree of each output.

    Raises:
        RangeError: an output that no input reaches; unstable poles, or another number of them than its degree.
        ShapeError: as many inputs as outputs are needed.
    """

    def __init__(
        self, x: ca.SX, t: ca.SX, A: ca.SX, B: ca.SX, C: ca.SX, D: ca.SX, *, poles: Sequence[Sequence[complex]]
    ) -> None:
        if not C.numel() == B.shape[1] == D.shape[1] == len(poles):
            raise ShapeError("C", C.shape, f"expected as many outputs as inputs and sets of poles, {B.shape[1]}")
        self.degrees: list[int] = []
        rows, last, gains = [], [], []
        for i in range(C.numel()):
            row, N = D[i, :], [C[i]]
            while _vanishes(row, x, t):
                if len(N) > x.numel():
                    raise RangeError(f"C[{i}]", str(C[i]), "no input reaches this output")
                row = ca.jacobian(N[-1], x) @ B
                N.append(ca.jacobian(N[-1], t) + ca.jacobian(N[-1], x) @ A)
            degree = len(N) - 1
            a = characteristic(f"poles[{i}]", poles[i], degree)
            self.degrees.append(degree)
            rows.append(row)
            last.append(N[-1] + sum(a[k] * N[k] for k in range(degree)))
            gains.append(a[0])
        decoupled = ca.vertcat(*rows)
        v = ca.SX.sym("v", len(rows))
        u = ca.solve(decoupled, ca.diag(ca.DM(gains)) @ v - ca.vertcat(*last))
        self._law = SingleState(ca.Function("law", [x, t, v], [u, decoupled]))

    def input(self, x: Array, v: Array, time: float = 0.0) -> Array:
        """u at a state and new inputs v.

        Raises:
            RangeError: D* is singular there.
        """
        x = validation.ordinary_array("x", x, self._law.inputs[0].shape)
        v = validation.ordinary_array("v", v, (len(self.degrees),))
        u, decoupled = self._law(x, validation.scalar("time", time), v)
        if not np.linalg.cond(decoupled) < 1e12:
            raise RangeError("x", x, "the inputs do not decouple the outputs here")
        return u[:, 0]


class DecoupledArm:
    """Controller 2 on all joints: tau = H (a_0 (q_d - q) - a_1 q') + h, with q_d of ``preview`` [s] ahead.

    ``forward``: with a_1 q_d' + q_d'' of now as well, which is computed torque and not published.
    """

    def __init__(
        self,
        arm: SerialChain | ArmDynamics,
        motion: Motion,
        preview: float,
        poles: Sequence[complex] = POLES,
        *,
        forward: bool = False,
    ) -> None:
        self.arm, self.motion, self.forward = dynamics_of(arm), motion, forward
        self.preview = validation.scalar("preview", preview, low=0.0, unit="s")
        self.a = characteristic("poles", poles, 2)

    def command(self, time: float, q: Array, v: Array) -> Array:
        q, v = measured(self.arm, q, v)
        qd, vd, ad = self.motion(time + self.preview)
        wanted = -self.a[0] * self.arm.error(q, qd) - self.a[1] * v
        return self.arm.equations(q, v).torque(wanted + self.a[1] * vd + ad if self.forward else wanted)


class DecoupledTwo:
    """Controller 2 as published: joints 2 and 3 by the closed form for a joint 1 at rest, and no torque on joint 1."""

    def __init__(self, motion: Motion, preview: float, poles: Sequence[complex] = POLES) -> None:
        self.motion = motion
        self.preview = validation.scalar("preview", preview, low=0.0, unit="s")
        self.a = characteristic("poles", poles, 2)

    def command(self, time: float, q: Array, v: Array) -> Array:
        """Torques [3] (6.50 to 6.52)."""
        q, v = validation.ordinary_array("q", q, (3,)), validation.ordinary_array("v", v, (3,))
        qd = self.motion(time + self.preview)[0]
        c, d = closed_form(q, v)
        return np.concatenate([[0.0], -(c + self.a[1] * v[1:] + self.a[0] * (q[1:] - qd[1:])) / d])


def characteristic(field: str, poles: Sequence[complex], degree: int) -> Array:
    """a_0 to a_degree of the polynomial with these roots.

    Raises:
        RangeError: another number of poles than the degree, an unstable one, or complex ones that are not in pairs.
    """
    roots = np.atleast_1d(np.asarray(poles, dtype=complex))
    if len(roots) != degree or not np.isfinite(roots).all() or (roots.real >= 0.0).any():
        raise RangeError(field, poles, f"expected {degree} poles with negative real parts")
    out = np.atleast_1d(np.poly(roots))[::-1]
    if np.abs(np.imag(out)).max() > 1e-9 * np.abs(out).max():
        raise RangeError(field, poles, "expected complex poles in pairs")
    return np.array(out.real, dtype=float)


def _vanishes(row: ca.SX, x: ca.SX, t: ca.SX) -> bool:
    """Whether an expression is zero everywhere: at five places of no special kind."""
    function = ca.Function("row", [x, t], [row])
    places = np.random.default_rng(0).normal(size=(5, x.numel() + 1))
    return all(np.abs(np.array(function(place[:-1], place[-1]))).max() < 1e-12 for place in places)
