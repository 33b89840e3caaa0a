"""Position limits of all joints in a loop: who could no longer stop within them brakes. Plain floats and lists."""

from __future__ import annotations

from operator import le

import numpy as np

from wbc.trajectory.braking import guarded, reach
from wbc.trajectory.course import Point
from wbc.validation import Array

#: Positions beyond their limits by less than this [rad or m] are rounding
ROOM = 1e-9


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

    def contain(self, place: list[float]) -> bool:
        """Whether a position is within."""
        return all(map(le, self._low, place)) and all(map(le, place, self._high))

    def nearest(self, place: list[float]) -> list[float]:
        """The nearest position within."""
        return [
            low if x < low else high if x > high else x
            for x, low, high in zip(place, self._low, self._high, strict=True)
        ]

    def guard(self, now: tuple[list[float], ...], p: list[float], v: list[float], a: list[float]) -> bool:
        """Brake joints that could no longer stop within, in the next state (p, v, a); whether there were any."""
        changed = False
        i = -1
        # strict=True costs a microsecond here; the lists come from one place
        for place, rate, push, (near_low, near_high, low, high, most, slow, ramp, soft) in zip(p, v, a, self._rows):  # noqa: B905
            i += 1
            if near_low < place < near_high:
                continue
            # From w = |v| + a^2/2j, the highest speed to come, a stop is no longer than w (w/2A + A/2j + |a|/j)
            speed, size = abs(rate), abs(push)
            speed += 0.5 * soft * size * size
            way = speed * (speed * slow + ramp + size * soft) - ROOM
            if low + way <= place <= high - way and size <= most:
                continue
            other = self.held_back(i, (now[0][i], now[1][i], now[2][i]), (place, rate, push))
            if other is not None:
                p[i], v[i], a[i] = other
                changed = True
        return changed

    def held_back(self, i: int, now: Point, wanted: Point) -> Point | None:
        """See :func:`guarded`, for one joint."""
        return guarded(now, wanted, self._low[i], self._high[i], self._acceleration[i], self._jerk[i], self._dt, ROOM)
