"""How a servo responds: its lag and its delay, found from a recording or while it works."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import RangeError
from wbc.simulation import CommandKind
from wbc.validation import Array

#: Both sides of the equation are smoothed over this time, which makes the derivative one of measured values [s]
SMOOTHING = 0.02
#: What is found for each joint
PER_JOINT = ("lag", "compliance", "sag", "friction", "damping")
#: These, and an offset
TERMS = 6
#: Of which a servo of a kind shows
SHOWN = {
    CommandKind.POSITION: [0, 1, 2, 3, 5],
    CommandKind.VELOCITY: [0, 1, 2, 3, 4, 5],
    CommandKind.TORQUE: [1, 2, 3, 4, 5],
}
#: Integrals of squares of terms, about which their numbers are said to be half of what fits [rad^2/s, (N m)^2 s, s]
LITTLE = (1e-4, 1.0, 1.0, 0.1, 0.01, 1e-9)
#: A delay is doubted as long as its squared residual is at most so many times the least one
AS_GOOD = 1.5
#: So much motion tells something, see :attr:`Identification.motion` [rad^2/s]
ENOUGH = 0.05
#: Part of the torques that move the joints, below which errors of predictions are not compared
FINE = 0.05
#: A joint that moves less than this between its extremes says nothing of its lag [rad or m, rad/s or m/s]
LEAST_MOTION = 1e-3


@dataclass(frozen=True, eq=False)
class Response:
    """What a servo does with what it is sent, joint by joint, each one number or nv of them:

        T dx/dt + x = u(t - D) - C (M(q) a + c(q, v)) - S g(q) - F sign(v) - B v + offset

    with x = q of a position servo, v of a velocity servo, and of torques what the model asks for, M a + c + g with T =
    0; M, c and g are inertia, Coriolis forces and gravity. Of positions B is part of T, and 0.

    Attributes:
        lag: T [s]. delay: D, of command and measurement together [s].
        doubt: by how much the delay may be longer, at the cost of the lag; feedback is as slow as that asks for [s].
        compliance, sag: C and S, of forces of motion and of gravity [rad/(N m), or rad/(N m s) of velocities; of
            torques the part by which inertia and weight are more than the model's].
        friction: F [rad, rad/s or N m]. damping: B [1 of velocities, N m s of torques].

    Raises:
        ShapeError, NotFiniteError, RangeError: no such numbers, or negative ones.
    """

    lag: Array | float = 0.0
    delay: float = 0.0
    doubt: float = 0.0
    compliance: Array | float = 0.0
    sag: Array | float = 0.0
    friction: Array | float = 0.0
    damping: Array | float = 0.0

    def __post_init__(self) -> None:
        for name in PER_JOINT:
            found = validation.ordinary_array(f"response.{name}", getattr(self, name))
            if found.ndim > 1 or (found < 0.0).any():
                raise RangeError(
                    f"response.{name}", getattr(self, name), "expected one number, or one a joint, of at least 0"
                )
        for name in ("delay", "doubt"):
            validation.scalar(f"response.{name}", getattr(self, name), low=0.0, unit="s")

    def __str__(self) -> str:
        lag = float(np.mean(self.lag))
        return f"lag {1e3 * lag:.0f} ms and delay {1e3 * self.delay:.0f} to {1e3 * (self.delay + self.doubt):.0f} ms"

    @property
    def of_joints(self) -> bool:
        """Whether it says anything but a delay."""
        return any(row.any() for row in self.rows())

    def rows(self, joints: int | None = None) -> list[Array]:
        """T, C, S, F and B, each for so many joints."""
        found = [np.asarray(getattr(self, name), dtype=float) for name in PER_JOINT]
        return found if joints is None else [np.broadcast_to(one, (joints,)) for one in found]


class Identification:
    """Least squares over what has been sent and measured so far, for every delay up to a longest one:

        min over D, offset and T, C, S, F, B >= 0 of  int f |u(t - D) - x - T dx/dt - C .. - .. - offset|^2 dt

    f forgets the past with a time constant. All is smoothed alike, which leaves the numbers as they are.

    Args:
        joints: how many. dt: between samples [s]. longest_delay, memory: of D and of f [s].
        shown: which of the terms there are.
    """

    def __init__(
        self, joints: int, dt: float, longest_delay: float, memory: float = np.inf, shown: Sequence[int] = (0, 5)
    ) -> None:
        self._dt, self._keep, self._shown = dt, np.exp(-dt / memory), list(shown)
        self._part = -np.expm1(-dt / SMOOTHING)
        self._rows = round(longest_delay / dt) + 1
        # Written twice, so that the last rows always lie in one piece, the oldest first
        self._sent = np.zeros((2 * self._rows, joints))
        #: Smoothed: u, x; dx/dt, the loads, and 1
        self._u, self._x, self._terms = np.zeros(joints), np.zeros(joints), np.zeros((TERMS, joints))
        self._terms[-1] = 1.0
        # Of products of terms, of terms and errors, and of squared errors, for each delay
        self._sums = np.zeros((TERMS * TERMS + TERMS * self._rows + self._rows, joints))
        self._squares, self._products, self._errors = self._parts(self._sums)
        self._marked, self._faded = self._sums.copy(), 1.0
        #: Of :meth:`slope`
        self._v, self._a = np.zeros((2, joints))
        self._next = -1

    def slope(self, v: Array) -> Array:
        """dv/dt, smoothed as all is, of velocities that are given once a sample before :meth:`add` [rad/s^2]."""
        if self._next < 0:
            self._v = v
        self._a = (self._part / self._dt) * (v - self._v)
        self._v = self._v + self._dt * self._a
        return self._a

    def add(self, u: Array, x: Array, loads: Array | float = 0.0, pushes: Array | float = 0.0,
            asked: Array | float = 0.0) -> None:  # fmt: skip
        """What is sent now, what is measured now, and the terms of C, S, F and B now ``[4, joints]``.

        Args:
            pushes, asked: parts of the term of C and of x that are smoothed already.
        """
        if self._next < 0:
            self._u[:], self._x[:], self._sent[:], self._terms[1:-1] = u, x, u, loads
        self._next = (self._next + 1) % self._rows
        self._u += self._part * (u - self._u)
        terms = self._terms
        terms[0] = (self._part / self._dt) * (x - self._x)
        self._x += self._dt * terms[0]
        terms[1:-1] += self._part * (loads - terms[1:-1])
        self._sent[self._next] = self._sent[self._next + self._rows] = self._u
        error = self._sent[self._next + 1 : self._next + 1 + self._rows] - (self._x + asked)
        terms = terms.copy()
        terms[1] += pushes
        if 0 not in self._shown:
            terms[0] = self._a
        self._sums *= self._keep
        self._faded *= self._keep
        self._squares += terms[:, None] * terms
        self._products += terms[:, None] * error
        self._errors += error * error

    @property
    def motion(self) -> float:
        """How much there was to learn from: the sum of int (dx/dt)^2 dt about its mean [rad^2/s]."""
        return float(self._dt * _variance(self._squares, 0).sum())

    def _parts(self, sums: Array) -> tuple[Array, Array, Array]:
        squares, products, errors = np.split(sums, [TERMS * TERMS, TERMS * (TERMS + self._rows)])
        return squares.reshape(TERMS, TERMS, -1), products.reshape(TERMS, self._rows, -1), errors

    def mark(self) -> None:
        """What follows is kept apart, for :meth:`misfits`."""
        self._marked[:], self._faded = self._sums, 1.0

    def misfits(self, responses: Sequence[Response], motion: float) -> list[float]:
        """How badly each response predicts what followed :meth:`mark`: the geometric mean over the joints of its
        squared errors, each with an offset of its own; nothing while there was less :attr:`motion` than that.

        No error counts as less than half a period of the motion, or of torques than :data:`FINE` of those that move
        the joints.
        """
        squares, products, errors = self._parts(self._sums - self._faded * self._marked)
        if self._dt * _variance(squares, 0).sum() < motion:
            return []
        part, term = (0.5 * self._dt, 0) if 0 in self._shown else (FINE, 1)
        least, misfits = part**2 * _variance(squares, term) + LITTLE[-1] / self._dt, []
        for response in responses:
            row = self._rows - 1 - min(round(response.delay / self._dt), self._rows - 1)
            numbers = np.array([*response.rows(squares.shape[-1]), np.zeros(squares.shape[-1])])
            numbers[-1] = (products[-1, row] - (squares[-1] * numbers).sum(axis=0)) / np.maximum(squares[-1, -1], 1.0)
            explained = (numbers * (2.0 * products[:, row] - (squares * numbers).sum(axis=1))).sum(axis=0)
            misfits.append(float(_geometric_mean(np.maximum(errors[row] - explained, 0.0) + least)))
        return misfits

    def response(self, delay: float | None = None) -> Response:
        """What fits best, with a delay that is known where one is given."""
        shown = self._shown
        squares = np.moveaxis(self._squares[np.ix_(shown, shown)], -1, 0)
        products = np.moveaxis(self._products[shown], -1, 0)
        found = np.linalg.solve(squares + np.diag(np.array(LITTLE)[shown] / self._dt), products)
        found[:, :-1] = np.maximum(found[:, :-1], 0.0)
        # The offset that goes with what was cut off
        rest = products[:, -1] - np.einsum("jt,jtd->jd", squares[:, -1, :-1], found[:, :-1])
        found[:, -1] = rest / np.maximum(squares[:, -1, -1], 1.0)[:, None]
        explained = np.einsum("jtd,jtd->jd", found, 2.0 * products - squares @ found)
        # Each joint with noise of its own: the likelihood of a delay is the product over the joints
        least = LITTLE[-1] * np.maximum(squares[:, -1, -1], 1.0)[:, None]
        left = _geometric_mean(np.maximum(self._errors.T - explained, least))
        row = int(left.argmin()) if delay is None else self._rows - 1 - round(delay / self._dt)
        # Row 0 is the longest delay
        doubtful = row - int(np.argmax(left <= AS_GOOD * left[row])) if delay is None else 0
        numbers = np.zeros((TERMS, len(found)))
        numbers[shown] = found[:, :, row].T
        lag, *others, _ = numbers
        return Response(lag, (self._rows - 1 - row) * self._dt, doubtful * self._dt, *others)


def _variance(squares: Array, term: int) -> Array:
    """Of a term about its mean, times the number of samples."""
    about = squares[term, term] - squares[term, -1] ** 2 / np.maximum(squares[-1, -1], 1.0)
    return np.asarray(np.maximum(about, 0.0))


def _geometric_mean(errors: Array) -> Array:
    """Over the joints, the first axis."""
    return np.asarray(np.exp(np.log(errors).mean(axis=0)))


def identify(commands: Any, measured: Any, dt: float, longest_delay: float = 0.05) -> Response:
    """Lag and delay of servos from what they were commanded and what they did: see :class:`Identification`.

    Args:
        commands: u ``[n, joints]``. measured: as each command was sent ``[n, joints]``, positions of a position servo
            or velocities of a velocity servo. dt: between two rows [s]. longest_delay: no delay is longer [s].

    Raises:
        ShapeError, NotFiniteError: other arrays. RangeError: a joint that hardly moves, or too few samples.
    """
    u, x = (validation.ordinary_array(name, a) for name, a in (("commands", commands), ("measured", measured)))
    dt = validation.scalar("dt", dt, low=0.0, open_low=True, unit="s")
    longest = validation.scalar("longest_delay", longest_delay, low=0.0, high=1e4 * dt, unit="s")
    least = 4 * round(longest / dt) + 20
    if u.ndim != 2 or len(u) < least or u.shape[1] < 1:
        raise RangeError("commands", u.shape, f"expected at least {least} samples of some joints")
    validation.real_array("measured", x, u.shape)
    moved = np.ptp(x, axis=0)
    if moved.min() < LEAST_MOTION:
        raise RangeError("measured", float(moved.min()), f"joint {int(moved.argmin())} hardly moves")
    found = Identification(u.shape[1], dt, longest)
    for sent, seen in zip(u, x, strict=True):
        found.add(sent, seen)
    return found.response()
