"""Motion of a hand past poses, cycle by cycle. Units: inch, radian, second.

The via-point generator is ``wbc.trajectory.via_points``: the rules of ARMPTH and SETPTH, with what they round kept.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc.published.three_arm_walker.machine.calibration import WalkerCalibration
from wbc.published.three_arm_walker.machine.grid import INCH
from wbc.trajectory import via_points
from wbc.validation import Array

#: Cycles a second, and TIMINC [s]
RATE = 10.0
CYCLE = 1.0 / RATE


class BodyMotion:
    """From rest at the first pose past all others to rest at the last.

    Args:
        poses: 4 x 4 each. calibration: speeds and accelerations.

    Attributes:
        duration: [s]. end: the last pose.
    """

    def __init__(self, poses: Sequence[Array], calibration: WalkerCalibration) -> None:
        law = via_points(
            [_scaled(pose, INCH) for pose in poses],
            speed=calibration.hand_speed,
            acceleration=calibration.hand_acceleration,
            angular_acceleration=calibration.hand_angular_acceleration,
            deviation=calibration.corner_deviation,
        )
        self.duration, self.end = law.duration, poses[-1]
        states = law.at(np.arange(np.ceil(law.duration * RATE)) / RATE)
        self._poses, self._twists = states.position, states.velocity
        self._poses[:, :3, 3] /= INCH
        self._twists[:, :3] /= INCH

    def at(self, cycles: int) -> tuple[Array, Array]:
        """(pose, twist in fixed axes) a number of cycles after the start; the last pose at rest from the end on."""
        if cycles / RATE >= self.duration:
            return self.end, np.zeros(6)
        return self._poses[cycles], self._twists[cycles]


def _scaled(pose: Array, factor: float) -> Array:
    out = pose.copy()
    out[:3, 3] *= factor
    return out
