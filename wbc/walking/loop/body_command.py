"""The body's command from tick to tick along its path."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wbc.stack.single import SingleState
from wbc.validation import Array
from wbc.walking.body_path import BodyPath
from wbc.walking.loop.way_function import AFTER, POSE, TARGET, way_function


class BodyCommand:
    """Where the body is to be as a tick begins, how fast it is to move, and where it is then as the tick ends.

    Args:
        dt: control period [s].

    Attributes:
        pose: at the end of the tick: position [m] and quaternion x, y, z, w.
    """

    def __init__(self, dt: float) -> None:
        self._step = SingleState(way_function())
        self._now, self._first, self._last, self._part, rate = self._step.inputs
        rate[0] = 1.0 / dt
        self._path: BodyPath | None = None
        self._place, self._row = np.nan, -1
        self.pose: Array = np.zeros(7)

    def go(self, path: BodyPath, begin: float, end: float) -> Array:
        """From one path time to another [s].

        Returns:
            The target, rotation by columns and position, and its rate (linear; angular) in the structure's axes
            ``[18]`` [m, m/s, rad/s].
        """
        out = self._step.output
        if path is not self._path:
            self._path, self._row = path, -1
            self._now[:] = pose_numbers(path.at(begin)[0])
        elif begin != self._place:
            self._now[:] = pose_numbers(path.at(begin)[0])
        else:
            self._now[:] = out[AFTER]
        row, part = path.place(end)
        self._part[0] = part
        if row != self._row:
            self._first[:], self._last[:] = path.numbers[row : row + 2]
            self._row = row
        self._step.run()
        self._place = end
        self.pose = out[POSE].copy()
        return out[TARGET]


def pose_numbers(pose: pin.SE3) -> Array:
    """A pose as 12 numbers, rotation by columns, then position."""
    out: Array = pose.homogeneous[:3].ravel(order="F")
    return out
