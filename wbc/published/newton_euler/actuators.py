"""Direct-current motors on the joints: their model, its exact discretisation, and the voltage for a wanted torque.

    x_j' = A_j x_j + b_j u_j + f_j p_j / GR_j,   x_j = (angle, rate) of the motor = GR_j (q_j, q_j')

Source: chapter 3, equations 4.5 to 4.9.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wbc import validation
from wbc.errors import RangeError
from wbc.published.newton_euler.recursion import Equations, regular
from wbc.validation import Array


@dataclass(frozen=True, eq=False)
class Motor:
    """One motor.

    Attributes:
        A: [2, 2] [1/s]. b: by voltage u [2] [rad/s^2/V]. f: by the torque p that it gives [2] [1/(kg m^2)].
        gear: its turns for one of the joint, GR.

    Raises:
        ShapeError, NotFiniteError, RangeError: no numbers; a voltage without effect; no gear.
    """

    A: Array
    b: Array
    f: Array
    gear: float = 1.0

    def __post_init__(self) -> None:
        for name, shape in (("A", (2, 2)), ("b", (2,)), ("f", (2,))):
            object.__setattr__(self, name, validation.ordinary_array(name, getattr(self, name), shape))
        validation.scalar("gear", self.gear, low=0.0, open_low=True)
        if self.b[1] == 0.0:
            raise RangeError("b", self.b, "the voltage does not move the motor")


def discretised(A: Array, dt: float, terms: int = 16) -> tuple[Array, Array]:
    """exp(A dt) and E = int_0^dt exp(A s) ds, [n, n] each, by the series of the listing.

        Psi = I + A dt/3 (I + A dt/4 (... (I + A dt/N))),  E = dt I + A dt^2/2 Psi,  exp(A dt) = I + A E

    ``terms``: N, 16 in EXPON and 36 in DISCR2. The answer of an input matrix B is E B.

    Raises:
        RangeError: a step of no length, or one too coarse for N terms.
    """
    validation.scalar("dt", dt, low=0.0, open_low=True, unit="s")
    terms = validation.integer("terms", terms, low=3)
    A = validation.ordinary_array("A", A)
    size = float(np.linalg.norm(A, 2))
    if size * dt > terms / 4.0:
        raise RangeError("dt", dt, f"too coarse for {terms} terms: expected at most {terms / 4.0 / size:.3g} s")
    one = np.eye(len(A))
    series = one
    for k in range(terms, 2, -1):
        series = one + A @ series * (dt / k)
    E = dt * one + A @ series * (dt**2 / 2.0)
    return one + A @ E, E


@dataclass(frozen=True, eq=False)
class Drive:
    """The motors of an arm, one a joint, stacked: x = (x_1, x_2, ...)."""

    motors: Sequence[Motor]

    @property
    def system(self) -> tuple[Array, Array, Array, Array]:
        """A [2n, 2n], B and F [2n, n] of x' = A x + B u + F p (4.5), and T [n, 2n] of q'' = T x'."""
        n = len(self.motors)
        A, B, F, T = np.zeros((2 * n, 2 * n)), np.zeros((2 * n, n)), np.zeros((2 * n, n)), np.zeros((n, 2 * n))
        for j, motor in enumerate(self.motors):
            at = slice(2 * j, 2 * j + 2)
            A[at, at], B[at, j], F[at, j], T[j, 2 * j + 1] = motor.A, motor.b, motor.f / motor.gear, 1.0 / motor.gear
        return A, B, F, T

    def state(self, q: Array, v: Array) -> Array:
        """x [2n] at joint positions and velocities, [n] each."""
        gears = np.array([motor.gear for motor in self.motors])
        return np.column_stack([gears * q, gears * v]).ravel()

    def voltage(self, model: Equations, q: Array, v: Array, torque: Array) -> Array:
        """u [n] [V] for torques p [n] (4.8): (H T B)^-1 ((I - H T F) p - h - H T A x)."""
        A, B, F, T = self.system
        H = regular(model.H)
        rest = torque - H @ T @ F @ torque - model.h - H @ T @ A @ self.state(q, v)
        return np.asarray(np.linalg.solve(H @ T @ B, rest))

    def combined(self, model: Equations) -> tuple[Array, Array, Array]:
        """A [2n, 2n], B [2n, n] and p [2n] of arm and motors, x' = A x + B u + p (4.7).

        S = (I - F H T)^-1; p = S F h, of which F is missing in print.
        """
        A, B, F, T = self.system
        S = np.linalg.inv(np.eye(len(A)) - F @ model.H @ T)
        return S @ A, S @ B, S @ F @ model.h
