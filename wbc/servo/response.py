"""How a servo responds: its lag and its delay, found from a recording or while it works."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import RangeError
from wbc.validation import Array

#: Both sides of the equation are smoothed over this time, which makes the derivative one of measured values [s]
SMOOTHING = 0.02
#: A joint's share of int (dx/dt)^2 dt below which its lag is said to be less than what is found [rad^2/s, m^2/s]
LITTLE = 1e-4
#: A joint that moves less than this between its extremes says nothing of its lag [rad or m, rad/s or m/s]
LEAST_MOTION = 1e-3


@dataclass(frozen=True, eq=False)
class Response:
    """A servo as a lag and a delay, joint by joint:

        T dx/dt + x = u(t - D) + offset,   x = q of a position servo, v of a velocity servo

    Attributes:
        lag: T [s], one number or nv of them. delay: D, of command and measurement together [s].

    Raises:
        ShapeError, NotFiniteError, RangeError: no times.
    """

    lag: Array | float = 0.0
    delay: float = 0.0

    def __post_init__(self) -> None:
        lag = validation.ordinary_array("response.lag", self.lag)
        if lag.ndim > 1 or (lag < 0.0).any():
            raise RangeError("response.lag", self.lag, "expected one time, or one a joint, of at least 0 s")
        validation.scalar("response.delay", self.delay, low=0.0, unit="s")

    def __repr__(self) -> str:
        return f"Response(lag={np.round(self.lag, 4).tolist()}, delay={self.delay:g})"


class Identification:
    """Least squares over what has been sent and measured so far, for every delay up to a longest one:

        min over D, T >= 0, offset of  int f |x + T dx/dt - u(t - D) - offset|^2 dt

    f forgets the past with a time constant. u and x are smoothed alike, which leaves T and D as they are.

    Args:
        joints: how many. dt: between samples [s]. longest_delay, memory: of D and of f [s].
    """

    def __init__(self, joints: int, dt: float, longest_delay: float, memory: float = np.inf) -> None:
        self._dt, self._keep = dt, np.exp(-dt / memory)
        self._part = -np.expm1(-dt / SMOOTHING)
        self._rows = round(longest_delay / dt) + 1
        # Written twice, so that the last rows always lie in one piece, the oldest first
        self._sent = np.zeros((2 * self._rows, joints))
        self._error = np.zeros((self._rows, joints))
        self._sums = np.zeros((3, self._rows, joints))
        self._count, self._next = 0.0, -1
        self._u, self._x, self._rate = np.zeros((3, joints))
        self._rates, self._squares = np.zeros((2, joints))

    def add(self, u: Array, x: Array) -> None:
        """What is sent now, and what is measured now."""
        if self._next < 0:
            self._u[:], self._x[:], self._sent[:] = u, x, u
        self._next = (self._next + 1) % self._rows
        self._u += self._part * (u - self._u)
        np.subtract(x, self._x, out=self._rate)
        self._rate *= self._part / self._dt
        self._x += self._dt * self._rate
        self._sent[self._next] = self._sent[self._next + self._rows] = self._u
        error, rate, keep = self._error, self._rate, self._keep
        np.subtract(self._sent[self._next + 1 : self._next + 1 + self._rows], self._x, out=error)
        self._count = keep * self._count + 1.0
        self._rates *= keep
        self._rates += rate
        self._squares *= keep
        self._squares += rate * rate
        self._sums *= keep
        self._sums[0] += error
        self._sums[1] += error * rate
        error *= error
        self._sums[2] += error

    @property
    def motion(self) -> float:
        """How much there was to learn from: the sum of int (dx/dt)^2 dt about its mean [rad^2/s]."""
        return float(self._dt * (self._squares - self._rates**2 / max(self._count, 1.0)).sum())

    def response(self) -> Response:
        """What fits best."""
        count, mean = max(self._count, 1.0), self._rates / max(self._count, 1.0)
        error, product, square = self._sums
        variance = np.maximum(self._squares - mean * self._rates, 0.0)
        product, square = product - error * mean, square - error * error / count
        lag = np.maximum(product / (variance + LITTLE / self._dt), 0.0)
        left = (square - 2.0 * lag * product + lag * lag * variance) / (variance + LITTLE / self._dt)
        row = int(left.sum(axis=1).argmin())
        return Response(lag[row], (self._rows - 1 - row) * self._dt)


def identify(commands: Any, measured: Any, dt: float, longest_delay: float = 0.05) -> Response:
    """Lag and delay of servos from what they were commanded and what they did: see :class:`Identification`.

    Args:
        commands: u ``[n, joints]``. measured: as each command was sent, positions of a position servo or velocities of a
            velocity servo ``[n, joints]``. dt: between two rows [s]. longest_delay: no delay is longer [s].

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
