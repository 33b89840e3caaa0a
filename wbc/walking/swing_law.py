"""A swing as the controller follows it: where the hand is to be at each time, from lifting to landing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.validation import Array
from wbc.walking.swing_speed import speeds
from wbc.walking.swings import FINE, Asked, Swings

#: Rows of the table are this far apart [s]
SPACING = 0.005


@dataclass(frozen=True, eq=False)
class Aim:
    """What a swinging hand is to do: position, velocity, z axis, its rate, and the part of the way, 0 to 1."""

    position: Array
    velocity: Array
    axis: Array
    axis_rate: Array
    part: float


class SwingLaw:
    """A table of the least-time law along the curve of a move, stretched to the duration that the plan gives it.

    Between rows straight lines; rows are 5 ms apart, so that they miss the curve by a hundredth of a millimetre.
    """

    def __init__(self, swings: Swings, move: Asked) -> None:
        way = swings.curve([move])
        x = np.linspace(0.0, 1.0, FINE)
        samples = (move.lift + (move.land - move.lift) * x)[None]
        found = speeds(swings.walker, move.arm, swings.path, way, samples)
        planned = swings.duration(move)
        motion = max(float(found.duration[0]), 0.0 if planned is None else planned - swings.extra)
        times = np.concatenate([[0.0], np.cumsum(found.time[0])]) * (motion / float(found.duration[0]))
        self.duration = motion
        count = int(np.ceil(motion / SPACING)) + 1
        self._times = np.linspace(0.0, motion, count)
        along = np.interp(self._times, times, x)
        # dx/dt from the table itself, so that position and velocity agree
        rate = np.gradient(along, self._times)
        rate[0] = rate[-1] = 0.0
        place, slope = way.at(along)
        axis, turn = way.axes(along)
        self._rows = np.concatenate(
            [place[0], slope[0] * rate[:, None], axis[0], turn[0] * rate[:, None], along[:, None]], axis=1
        )

    def at(self, time: float) -> Aim:
        """The aim at a time since lifting, clipped to the swing."""
        place = min(max(time / self.duration, 0.0), 1.0) * (len(self._times) - 1)
        low = min(int(place), len(self._times) - 2)
        row = self._rows[low] + (place - low) * (self._rows[low + 1] - self._rows[low])
        return Aim(row[:3], row[3:6], row[6:9] / np.linalg.norm(row[6:9]), row[9:12], float(row[12]))
