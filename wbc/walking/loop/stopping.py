"""How far a body and a hand can travel after an abort."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking.loop.hand_pace import BEHIND, HAND_STOP
from wbc.walking.planner.plan import Plan

#: A body comes to rest from full pace in [s], and from rest to it in
BRAKE, RAMP = 0.25, 0.5
#: What a body may be off its path at the end of a stop [m]
OFF = 0.002


def slowness(walker: Walker) -> float:
    """How many times longer than the shortest its joints need to their full rates: what all times above grow with."""
    with np.errstate(divide="ignore", invalid="ignore"):
        times = walker.robot.limits.velocity[6:] / walker.robot.limits.acceleration[6:]
    return max(1.0, float(np.max(np.nan_to_num(times, nan=0.0, posinf=0.0))) / BRAKE)


@dataclass(frozen=True)
class Stops:
    """Of a machine whose body comes to rest from full pace in T, and whose hand in T': 0 <= pace <= 1, in proportion.

    Attributes:
        dt: control period [s]. brake, hand: T and T' [s]. ramp: from rest to full pace [s].
    """

    dt: float
    brake: float = BRAKE
    hand: float = HAND_STOP
    ramp: float = RAMP

    @classmethod
    def of(cls, walker: Walker, dt: float) -> Stops:
        """Of a body with arms: longer where joints speed up more slowly than in :data:`BRAKE`."""
        slower = slowness(walker)
        return cls(dt, BRAKE * slower, HAND_STOP * slower, RAMP * slower)

    def of_body(self, places: Array, spacing: float, at: Array, pace: float, behind: float) -> Array:
        """How far a body's origin travels [m]: along its path while the pace p falls to 0, which is p^2 T / 2 of path
        time, and a tick; what it is behind now; and :data:`OFF`.

        Args:
            places: of the body ``[n, 3]`` [m], ``spacing`` [s] of path time apart. at: path times of the abort [s].
            behind: [m].
        """
        return _length(places, spacing, at, 0.5 * pace**2 * self.brake + pace * self.dt) + behind + OFF

    def of_hand(self, places: Array, spacing: float, at: Array, pace: float, behind: float) -> Array:
        """How far a hand travels [m]: as :meth:`of_body` with T' for T, and at the end :data:`BEHIND`, as the arm was
        planned for full pace and not for the stop.
        """
        return _length(places, spacing, at, 0.5 * pace**2 * self.hand + pace * self.dt) + behind + BEHIND

    def longest(self, plan: Plan) -> tuple[float, float]:
        """The most that body and hand travel after an abort anywhere in a plan [m], at full pace.

        The body may be :data:`OFF` behind, a hand :data:`BEHIND`. Of a hand that is brought to where a plan begins,
        ``Walk.stopping`` knows.
        """
        path = plan.path
        body = self.of_body(path.poses[:, :3, 3], path.spacing, _times(path.poses, path.spacing), 1.0, OFF)
        return float(body.max()), max((self.longest_of_hand(law.places, law.spacing) for law in plan.laws), default=0.0)

    def longest_of_hand(self, places: Array, spacing: float) -> float:
        """The most that :meth:`of_hand` says anywhere on a hand's path [m], at full pace and :data:`BEHIND` behind."""
        return float(self.of_hand(places, spacing, _times(places, spacing), 1.0, BEHIND).max())


def _times(places: Array, spacing: float) -> Array:
    return np.arange(len(places), dtype=np.float64) * spacing


def _length(places: Array, spacing: float, at: Array, left: float) -> Array:
    """Lengths [m] that are covered in ``left`` [s] from some times on."""
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    times, lengths = _times(places, spacing), np.concatenate([[0.0], np.cumsum(steps)])
    out: Array = np.interp(at + left, times, lengths) - np.interp(at, times, lengths)
    return out
