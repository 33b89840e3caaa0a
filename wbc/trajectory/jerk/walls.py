"""Position limits of all joints in a loop: who could no longer stop within them brakes."""

from __future__ import annotations

from struct import Struct

import casadi as ca
import numpy as np

from wbc.symbolic.evaluation import SingleState
from wbc.symbolic.operators import quick_operators
from wbc.trajectory.jerk.braking import guarded, reach
from wbc.trajectory.jerk.course import Point
from wbc.validation import Array

#: Positions beyond their limits by less than this [rad or m] are rounding
WALL_TOLERANCE = 1e-9
#: Accelerations beyond their limits by less than this share are rounding
SHARE = 1e-12
#: The most ticks for which a state is known to be clear
TICKS = 1e6


class Walls:
    """Limits of positions and what a joint needs to stop before them.

    Args:
        lower, upper: n each, None: none [rad or m].
        fastest: the highest speeds that joints can have [per s].
        acceleration, jerk: sizes allowed [per s^2, s^3]. dt: a tick [s].

    Attributes:
        lower, upper: n each, infinite where there is no limit.
        state: positions, velocities and accelerations that :meth:`clear` looks at, 3 n, as :meth:`put` wrote them.
    """

    def __init__(
        self, lower: Array | None, upper: Array | None, fastest: Array, acceleration: Array, jerk: Array, dt: float
    ) -> None:
        none = np.full(len(acceleration), np.inf)
        self.lower = -none if lower is None else lower
        self.upper = none if upper is None else upper
        self._low, self._high = self.lower.tolist(), self.upper.tolist()
        # Numbers that are none, or infinite, are within no pair of these
        most = np.finfo(np.float64).max
        within = np.clip([self.lower, self.upper], -most, most).T
        self._bounds: list[list[float]] = within.tolist()
        self._acceleration, self._jerk, self._dt = acceleration.tolist(), jerk.tolist(), dt
        # A joint that is farther from its walls than its longest stop need not be looked at
        sizes = zip(fastest.tolist(), self._acceleration, self._acceleration, self._jerk, strict=True)
        far = [reach(*row)[1] for row in sizes]
        short = (0.5 / acceleration).tolist(), (0.5 * acceleration / jerk).tolist(), (1.0 / jerk).tolist()
        near = (self.lower + far).tolist(), (self.upper - far).tolist()
        self._rows = list(zip(*near, self._low, self._high, self._acceleration, *short, strict=True))
        # Changes of these clearances in a tick are bounded, so a state with large ones is clear for a while
        top = fastest + acceleration * acceleration / jerk
        stop = 3.0 * (top + acceleration * acceleration / jerk)
        self._changes = (dt * top).tolist(), (dt * (top + stop)).tolist()
        self._ticks_clear = SingleState(self._ticks())
        self.state = self._ticks_clear.inputs[0]
        self._memory = memoryview(self.state.data)
        self._pack = Struct(f"{len(self.state)}d").pack_into

    def contain(self, position: list[float]) -> bool:
        """Whether a position is within; not if a number of it is none or infinite."""
        for x, (low, high) in zip(position, self._bounds, strict=True):  # noqa: SIM110 (a generator takes twice as long)
            if not low <= x <= high:
                return False
        return True

    def put(self, p: list[float], v: list[float], a: list[float]) -> None:
        """Write :attr:`state`."""
        self._pack(self._memory, 0, *p, *v, *a)

    def clear(self) -> int:
        """For how many ticks, this one and those after it, every joint can surely stop within; 0: see :meth:`guard`.

        So long as the joints keep the limits of acceleration and jerk, and of velocity but for the overshoot a^2/2j.
        """
        self._ticks_clear.run()
        ticks = self._ticks_clear.output[0]
        return 1 + int(ticks) if ticks >= 0.0 else 0

    @quick_operators()
    def _ticks(self) -> ca.Function:
        """Least clearance of a joint, in ticks: to a wall after a stop, or to where a wall counts.

        From w = |v| + a^2/2j, the highest speed to come, a stop is no longer than w (w/2A + A/2j + |a|/j). In a tick,
        with W = V + A^2/j at least w, its change is at most 3 (W + A^2/j) dt and that of the position W dt.
        """
        state = ca.SX.sym("state", 3 * len(self._rows))
        position, rate, push = ca.vertsplit(state, len(self._rows))
        clearances = []
        for i, (near_low, near_high, low, high, most, slow, ramp, soft) in enumerate(self._rows):
            size = ca.fabs(push[i])
            speed = ca.fabs(rate[i]) + 0.5 * soft * size * size
            stop = speed * (speed * slow + ramp + size * soft) - WALL_TOLERANCE
            far = ca.fmin(position[i] - near_low, near_high - position[i]) / self._changes[0][i]
            left = ca.fmin(position[i] - low - stop, high - stop - position[i]) / self._changes[1][i]
            clearances.append(ca.if_else(size > most * (1.0 + SHARE), -1.0, ca.fmax(far, left)))
        return ca.Function("ticks", [state], [ca.fmin(ca.mmin(ca.vertcat(*clearances)), TICKS)])

    def nearest(self, position: list[float]) -> list[float]:
        """The nearest position within."""
        return [
            low if x < low else high if x > high else x
            for x, low, high in zip(position, self._low, self._high, strict=True)
        ]

    def guard(
        self, now: tuple[list[float], list[float], list[float]], p: list[float], v: list[float], a: list[float]
    ) -> bool:
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
        walls, sizes = (self._low[i], self._high[i]), (self._acceleration[i], self._jerk[i])
        return guarded(now, wanted, walls, sizes, self._dt, WALL_TOLERANCE)
