"""How fast a plan's time goes: it slows down to stops and goes on again as the joints' accelerations allow."""

from __future__ import annotations

from math import inf, sqrt

import numpy as np

from wbc.climb.loop.reference import PlanReference
from wbc.robot import Robot

#: Time in which a plan comes to a stop, or goes on again, where joints allow that [s]
STOPPING = 0.2
#: Share of the joints' accelerations that is used meanwhile [1]: feedback has the rest
ACCELERATION_SHARE = 0.9
#: What is left at least where a plan itself needs all of them, dr/dt [1/s]
SLOWEST_STOP = 0.5
#: How much of its rate a plan loses in a tick at most, where it has to stop in less than that time [1]: what a body
#: does changes by a fifth of it at most
STEEPEST = 0.15
#: Rates of joints below this have no part in a stop [m/s, rad/s]
MOVES = 1e-9


class PlanPace:
    """The rate r = ds/dt of a plan's time s, 0 <= r <= 1. With q(s) of the plan, joints have

        qdd = q'' r^2 + q' dr/dt,       |qdd_i| <= 0.9 of their limits,   |dr/dt| <= 1 / (0.2 s),

    and before an instant that must not be passed r falls as fast as the joints alone allow.

    Args:
        robot: whose joints have accelerations. dt: period [s]. hard: whether stops before such an instant may be
            shorter than 0.2 s.

    Attributes:
        rate: r [1].
    """

    def __init__(self, robot: Robot, dt: float, hard: bool) -> None:
        limits = robot.limits.acceleration[robot.base_nv :]
        self._most = np.where(np.isfinite(limits) & (limits > 0.0), ACCELERATION_SHARE * limits, inf)
        self._first, self._dt, self._hard, self.rate = robot.base_nv, dt, hard, 1.0

    def begin(self, reference: PlanReference, rate: float) -> None:
        """Another plan, at a rate of it."""
        self._reference, self.rate, self._end = reference, rate, -inf

    def stops(self, time: float, end: float, rate: float = 1.0) -> bool:
        """Whether it can come to a stop between these times of the plan from a rate."""
        return rate**2 <= self._most_squared(time, end)

    def go(self, time: float, aimed: float, end: float) -> float:
        """The rate of this tick.

        Args:
            time: of the plan. aimed: rate that is wanted. end: time of the plan that must not be passed [s].
        """
        rate, dt, most = self.rate, self._dt, inf
        if end < inf:
            most = min(sqrt(self._most_squared(time + rate * dt, end)), max(end - time, 0.0) / dt)
            aimed = min(aimed, most)
        if aimed == rate:
            return rate
        low, high = self._changes(time)
        # Only as much steeper than in other stops as the end asks for
        low = max(low, -max(1.0 / STOPPING, (rate - most) / dt if self._hard else 0.0))
        self.rate = rate + dt * min(max((aimed - rate) / dt, low), high, 1.0 / STOPPING)
        return self.rate

    def _most_squared(self, time: float, end: float) -> float:
        """The largest r^2 from which it can stop until an end: back from there, interval by interval."""
        if end != self._end:
            self._end, times = end, self._reference.times
            last = min(int(times.searchsorted(end, side="left")), len(times) - 1)
            at, squared = [end], [0.0]
            while last > 0 and squared[-1] < 1.0:
                last -= 1
                v, a = (part[last, self._first :] for part in self._reference.knots)
                moves = v > MOVES
                room = (self._most[moves] - a[moves] * squared[-1]) / v[moves]
                falls = float(room.min(initial=STEEPEST / self._dt if self._hard else 1.0 / STOPPING))
                at.append(float(times[last]))
                squared.append(squared[-1] + 2.0 * max(falls, SLOWEST_STOP) * (at[-2] - at[-1]))
            self._before = at[::-1], squared[::-1]
        return float(np.interp(time, *self._before)) if time < end else 0.0

    def _changes(self, time: float) -> tuple[float, float]:
        """Least and largest dr/dt that the joints allow now; 0 is one of them."""
        v, a = self._reference.derivatives(time)
        v, a = v[self._first :], a[self._first :] * self.rate**2
        size = np.abs(v)
        moves = size > MOVES
        if not moves.any():
            return -inf, inf
        turned = np.sign(v[moves]) * a[moves]
        most, size = self._most[moves], size[moves]
        return min(float(((-most - turned) / size).max()), 0.0), max(float(((most - turned) / size).min()), 0.0)
