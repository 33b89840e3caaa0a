"""A swing as the controller follows it: where the hand is to be at each time, from lifting to landing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking.body_path import BodyPath
from wbc.walking.swing_curve import Curves
from wbc.walking.swing_speed import speeds
from wbc.walking.swings import FINE, Asked, Swings

#: Rows of the table are this far apart [s]
SPACING = 0.005


@dataclass(frozen=True, eq=False)
class Aim:
    """What a swinging hand is to do: position, velocity, direction of the z axis, its rate, part of the way, 0 to 1."""

    position: Array
    velocity: Array
    axis: Array
    axis_rate: Array
    part: float


class SwingLaw:
    """A table of the least-time law of an arm along a curve, stretched where it has to take longer.

    Between rows straight lines; rows are 5 ms apart, so that they miss the curve by a hundredth of a millimetre.

    Args:
        walker, arm, path: whose hand moves while the body is at ``samples`` ``[FINE]`` of the path.
        way: one curve. least: duration that it takes at least [s].
    """

    def __init__(
        self, walker: Walker, arm: int, path: BodyPath, way: Curves, samples: Array, least: float = 0.0
    ) -> None:
        x = np.linspace(0.0, 1.0, FINE)
        found = speeds(walker, np.array([arm]), path, way, samples[None])
        fastest = float(found.duration[0])
        self.possible = bool(found.possible[0])
        self.duration = max(fastest, least)
        times = np.concatenate([[0.0], np.cumsum(found.time[0])]) * (self.duration / fastest)
        count = int(np.ceil(self.duration / SPACING)) + 1
        self._times = np.linspace(0.0, self.duration, count)
        along = np.interp(self._times, times, x)
        # dx/dt from the table itself, so that position and velocity agree
        rate = np.gradient(along, self._times)
        rate[0] = rate[-1] = 0.0
        place, slope = way.at(along)
        axis, turn = way.axes(along)
        self._rows = np.concatenate(
            [place[0], slope[0] * rate[:, None], axis[0], turn[0] * rate[:, None], along[:, None]], axis=1
        )

    @staticmethod
    def of(swings: Swings, move: Asked, planned: float) -> SwingLaw:
        """The law of a planned move, as long as the plan says [s]."""
        samples = move.lift + (move.land - move.lift) * np.linspace(0.0, 1.0, FINE)
        return SwingLaw(swings.walker, move.arm, swings.path, swings.curve([move]), samples, planned - swings.extra)

    def at(self, time: float) -> Aim:
        """The aim at a time since lifting, clipped to the swing."""
        place = min(max(time / self.duration, 0.0), 1.0) * (len(self._times) - 1)
        low = min(int(place), len(self._times) - 2)
        row = self._rows[low] + (place - low) * (self._rows[low + 1] - self._rows[low])
        return Aim(row[:3], row[3:6], row[6:9], row[9:12], float(row[12]))
