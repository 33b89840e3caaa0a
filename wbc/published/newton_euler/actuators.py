"""Motors on the joints, electric or hydraulic: their model, its exact discretisation, the input for a wanted torque.

    x_j' = A_j x_j + b_j u_j + f_j p_j / GR_j,   x_j = (angle, rate, z) of the motor, (angle, rate) = GR_j (q_j, q_j')

z is what a motor of third order has besides: the current of its armature, or the pressure of its load. Source: chapter
3, equations 4.5 to 4.9, whose motors are of second order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from wbc import validation
from wbc.errors import RangeError
from wbc.published.newton_euler.recursion import Equations
from wbc.validation import Array


@dataclass(frozen=True, eq=False)
class Motor:
    """One motor, of second order (angle, rate) or of a higher one.

    Attributes:
        A: [m, m] [1/s], the first row (0, 1, 0, ...). b: by the input u, a voltage [V] or the opening of a valve, [m].
        f: by the torque p that it gives [m] [1/(kg m^2)]. gear: its turns for one of the joint, GR.

    Raises:
        ShapeError, NotFiniteError, RangeError: no numbers; an order below 2, or an angle that is not the integral of
            the rate; an input without effect; no gear.
    """

    A: Array
    b: Array
    f: Array
    gear: float = 1.0

    def __post_init__(self) -> None:
        m = max(len(np.atleast_1d(self.A)), 2)
        for name, shape in (("A", (m, m)), ("b", (m,)), ("f", (m,))):
            object.__setattr__(self, name, validation.ordinary_array(name, getattr(self, name), shape))
        validation.scalar("gear", self.gear, low=0.0, open_low=True)
        if (self.A[0] != np.eye(m)[1]).any() or self.b[0] != 0.0 or self.f[0] != 0.0:
            raise RangeError("A", self.A, "expected the rate alone to change the angle: a first row of (0, 1, 0, ...)")
        inner, reach = self.A[2:, 2:], self.b[2:]
        if self.b[1] == 0.0 and not any(self.A[1, 2:] @ np.linalg.matrix_power(inner, k) @ reach for k in range(m - 2)):
            raise RangeError("b", self.b, "the input does not move the motor")

    @classmethod
    def third_order(
        cls,
        constant: float,
        loss: float,
        store: float,
        inertia: float,
        friction: float = 0.0,
        inflow: float = 1.0,
    ) -> Motor:
        """A motor of third order without a gear, with rate w:

            inertia w' = constant z - friction w - p,   store z' = inflow u - loss z - constant w

        Electric: z is the current [A]. Hydraulic, behind a servo valve: z is the pressure of the load [Pa].

        Args:
            constant: of torque and back-EMF [N m/A = V s/rad]; displacement [m^3/rad]. loss: resistance [ohm]; leakage
                [m^3/(s Pa)]. store: inductance [H]; volume under pressure / (4 bulk moduli) [m^3/Pa]. inertia [kg m^2].
                friction: viscous [N m s]. inflow: 1; flow of the valve for u = 1 [m^3/s].

        Raises:
            NotFiniteError, RangeError: a number that is not above 0, or a friction below.
        """
        given = {"constant": constant, "loss": loss, "store": store, "inertia": inertia, "inflow": inflow}
        for name, value in given.items():
            validation.scalar(name, value, low=0.0, open_low=True)
        friction = validation.scalar("friction", friction, low=0.0, unit="N m s")
        A = [[0.0, 1.0, 0.0], [0.0, -friction / inertia, constant / inertia], [0.0, -constant / store, -loss / store]]
        return cls(np.array(A), np.array([0.0, 0.0, inflow / store]), np.array([0.0, -1.0 / inertia, 0.0]))


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
    # Of units in which the states are of one size, a diagonal similarity, which the series does not see
    size = float(np.linalg.norm(scipy.linalg.matrix_balance(A, permute=False)[0], 2))
    if size * dt > terms / 4.0:
        raise RangeError("dt", dt, f"too coarse for {terms} terms: expected at most {terms / 4.0 / size:.3g} s")
    one = np.eye(len(A))
    series = one
    for k in range(terms, 2, -1):
        series = one + A @ series * (dt / k)
    E = dt * one + A @ series * (dt**2 / 2.0)
    return one + A @ E, E


@dataclass(frozen=True, eq=False)
class DriveTrain:
    """The motors of an arm, one a joint, stacked: x = (x_1, x_2, ...) [m], of orders that may differ."""

    motors: Sequence[Motor]

    @cached_property
    def system(self) -> tuple[Array, Array, Array, Array]:
        """A [m, m], B and F [m, n] of x' = A x + B u + F p (4.5), and T [n, m] of q'' = T x'."""
        blocks = [(motor.A, motor.b[:, None], motor.f[:, None] / motor.gear) for motor in self.motors]
        A, B, F = (scipy.linalg.block_diag(*parts) for parts in zip(*blocks, strict=True))
        T = np.zeros(F.T.shape)
        T[np.arange(len(self.motors)), self.angles + 1] = 1.0 / self.gears
        return A, B, F, T

    @cached_property
    def gears(self) -> Array:
        """GR [n]."""
        return np.array([motor.gear for motor in self.motors])

    @cached_property
    def angles(self) -> NDArray[np.int64]:
        """Where in x the angles are [n]; the rates come after them."""
        return np.cumsum([0, *(len(motor.b) for motor in self.motors[:-1])])

    @cached_property
    def inner(self) -> NDArray[np.bool_]:
        """Which of x are neither angles nor rates [m]."""
        out = np.ones(sum(len(motor.b) for motor in self.motors), dtype=np.bool_)
        out[self.angles] = out[self.angles + 1] = False
        return out

    def state(self, q: Array, v: Array, z: Array | None = None) -> Array:
        """x [m] at joint positions and velocities, [n] each, and what is neither; default: zeros."""
        x = np.zeros(len(self.inner))
        x[self.angles], x[self.angles + 1] = self.gears * q, self.gears * v
        x[self.inner] = 0.0 if z is None else z
        return x

    def steady(self, model: Equations, q: Array, v: Array, torque: Array) -> Array:
        """z, currents or pressures, with which the motors give torques p [n] now; of least size where z is longer."""
        needed = self._needed(model, q, v, torque)
        rows = [motor.A[1:2, 2:] for motor in self.motors]
        return np.concatenate([np.linalg.pinv(row) @ [need] for row, need in zip(rows, needed, strict=True)])

    def voltage(
        self, model: Equations, q: Array, v: Array, torque: Array, z: Array | None = None, dt: float | None = None
    ) -> Array:
        """u [n] for torques p [n]: of second order at once (4.8),

            u = (H T B)^-1 ((I - H T F) p - h - H T A x)

        of higher order so that z gives them after a step, over which the rest is held. That is not published.

        Args:
            z: currents or pressures as measured; default: zeros. dt: the step [s], for orders above 2.

        Raises:
            RangeError: a singular mass matrix; motors of a higher order and no step.
        """
        x, needed = self.state(q, v, z), self._needed(model, q, v, torque)
        if self.inner.any() or dt is not None:
            dt = validation.scalar("dt", 0.0 if dt is None else dt, low=0.0, open_low=True, unit="s")
        u = np.empty(len(needed))
        for j, (motor, at) in enumerate(zip(self.motors, self.angles.tolist(), strict=True)):
            row = _after_a_step(motor, dt or 0.0)
            before = row[:-1] @ np.append(x[at : at + len(motor.b)], torque[j])
            u[j] = (needed[j] - before) / (motor.b[1] + row[-1])
        return u

    def combined(self, model: Equations) -> tuple[Array, Array, Array]:
        """A [m, m], B [m, n] and p [m] of arm and motors, x' = A x + B u + p (4.7).

        S = (I - F H T)^-1; p = S F h, of which F is missing in print.
        """
        A, B, F, T = self.system
        S = np.linalg.inv(np.eye(len(A)) - F @ model.H @ T)
        return S @ A, S @ B, S @ F @ model.h

    def _needed(self, model: Equations, q: Array, v: Array, torque: Array) -> Array:
        """What u and z are to add to the motors' accelerations for torques p [n] [rad/s^2]."""
        x, (A, _, F, T) = self.state(q, v), self.system
        return np.asarray(self.gears * (model.acceleration(torque) - T @ (A @ x + F @ torque)))


@cache
def _after_a_step(motor: Motor, dt: float) -> Array:
    """What z adds to the motor's acceleration after a step over which all else is held, by x, p and u [m + 2]."""
    m = len(motor.b)
    both = np.zeros((m + 2, m + 2))
    both[2:m] = np.column_stack([motor.A, motor.f / motor.gear, motor.b])[2:]
    row = motor.A[1] @ scipy.linalg.expm(both * dt)[:m]
    row[:2] -= motor.A[1, :2]
    return np.asarray(row)
