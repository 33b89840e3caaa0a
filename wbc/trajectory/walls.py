"""Position limits of all joints in a loop: who could no longer stop within them brakes."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from wbc.trajectory.braking import guarded, reach
from wbc.trajectory.course import Point
from wbc.validation import Array

#: Positions beyond their limits by less than this [rad or m] are rounding
ROOM = 1e-9


class Kernel:
    """A scalar function of one array, bound to where the array stands: a call costs a microsecond."""

    def __init__(self, function: ca.Function, at: Array) -> None:
        self._function, self._out = function, np.zeros(1)
        buffer: Any = function.buffer()
        self._buffer, self._run = buffer
        self._buffer.set_arg(0, memoryview(at.reshape(-1).data))
        self._buffer.set_res(0, memoryview(self._out.data))

    def __call__(self) -> float:
        self._run()
        value: float = self._out[0]
        return value


class Walls:
    """Limits of positions and what a joint needs to stop before them.

    Args:
        lower, upper: n each, None: none [rad or m].
        fastest: the highest speeds that joints can have [per s].
        acceleration, jerk: sizes allowed [per s^2, s^3]. dt: a tick [s].

    Attributes:
        lower, upper: n each, infinite where there is no limit.
        closed: whether any limit is finite.
    """

    def __init__(
        self, lower: Array | None, upper: Array | None, fastest: Array, acceleration: Array, jerk: Array, dt: float
    ) -> None:
        none = np.full(len(acceleration), np.inf)
        self.lower = -none if lower is None else lower
        self.upper = none if upper is None else upper
        self.closed = bool(np.isfinite([self.lower, self.upper]).any())
        self._low, self._high = self.lower.tolist(), self.upper.tolist()
        self._acceleration, self._jerk, self._dt = acceleration.tolist(), jerk.tolist(), dt
        # A joint that is farther from its walls than its longest stop need not be looked at
        sizes = zip(fastest.tolist(), self._acceleration, self._acceleration, self._jerk, strict=True)
        far = [reach(*row)[1] for row in sizes]
        short = (0.5 / acceleration).tolist(), (0.5 * acceleration / jerk).tolist(), (1.0 / jerk).tolist()
        near = (self.lower + far).tolist(), (self.upper - far).tolist()
        self._rows = list(zip(*near, self._low, self._high, self._acceleration, *short, strict=True))
        self._place, self._state = np.zeros(len(far)), np.zeros((3, len(far)))
        self._inside, self._room = Kernel(self._within(), self._place), Kernel(self._least_room(), self._state)

    def contain(self, place: Array) -> bool:
        """Whether a position is within; not if a number of it is none."""
        self._place[:] = place
        return self._inside() >= 0.0

    def clear(self, state: Array) -> bool:
        """Whether every joint of a state, 3 x n, can stop within, by a bound; if not, :meth:`guard` looks closer."""
        self._state[:] = state
        return self._room() >= 0.0

    def _within(self) -> ca.Function:
        """Least distance from the walls."""
        x = ca.SX.sym("x", len(self._rows))
        return ca.Function("within", [x], [ca.fmin(ca.mmin(x - self.lower), ca.mmin(self.upper - x))])

    def _least_room(self) -> ca.Function:
        """Least room of a joint: what is left of the way to a wall after a stop, or the distance from where it counts.

        From w = |v| + a^2/2j, the highest speed to come, a stop is no longer than w (w/2A + A/2j + |a|/j).
        """
        state = ca.SX.sym("state", 3 * len(self._rows))
        place, rate, push = ca.vertsplit(state, len(self._rows))
        rooms = []
        for i, (near_low, near_high, low, high, most, slow, ramp, soft) in enumerate(self._rows):
            size = ca.fabs(push[i])
            speed = ca.fabs(rate[i]) + 0.5 * soft * size * size
            way = speed * (speed * slow + ramp + size * soft) - ROOM
            far = ca.fmin(place[i] - near_low, near_high - place[i])
            left = ca.fmin(ca.fmin(place[i] - low - way, high - way - place[i]), most - size)
            rooms.append(ca.fmax(far, left))
        return ca.Function("room", [state], [ca.mmin(ca.vertcat(*rooms))])

    def nearest(self, place: list[float]) -> list[float]:
        """The nearest position within."""
        return [
            low if x < low else high if x > high else x
            for x, low, high in zip(place, self._low, self._high, strict=True)
        ]

    def guard(self, now: tuple[list[float], ...], p: list[float], v: list[float], a: list[float]) -> bool:
        """Brake joints that could no longer stop within, in the next state (p, v, a); whether there were any."""
        changed = False
        for i, wanted in enumerate(zip(p, v, a, strict=True)):
            other = self.held_back(i, (now[0][i], now[1][i], now[2][i]), wanted)
            if other is not None:
                p[i], v[i], a[i] = other
                changed = True
        return changed

    def held_back(self, i: int, now: Point, wanted: Point) -> Point | None:
        """See :func:`guarded`, for one joint."""
        return guarded(now, wanted, self._low[i], self._high[i], self._acceleration[i], self._jerk[i], self._dt, ROOM)
