"""Motion of a hand past poses, cycle by cycle, and its tracking by velocity commands. Units: inch, radian, second.

    v_c = v_d + (p_d - p_a) / dt,    w_c = w_d + rotation vector of (R_d R_a^T) / dt                            (5-1)

A hand has arrived once the time of its motion is over and errors and commands are within their tolerances. Via points
are passed by ``wbc.trajectory.via_points``: the rules of ARMPTH and SETPTH, with what they round kept.

Source: M. R. Patterson's thesis, 5.3.2 and the listing VELCOM; ROERRC, not listed, is a reconstruction.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc.multibody import pin
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


def pose_error(desired: Array, actual: Array) -> Array:
    """What leads from the actual pose to the desired one, fixed axes: translation, rotation vector; 6."""
    turn = np.asarray(pin.log3(desired[:3, :3] @ actual[:3, :3].T))
    return np.concatenate([desired[:3, 3] - actual[:3, 3], turn])


def tracking_command(motion: BodyMotion, cycles: int, actual: Array) -> Array:
    """VELCOM: the hand's twist, fixed axes, some cycles after a motion began [in/s, rad/s]."""
    desired, twist = motion.at(cycles)
    return np.asarray(twist + pose_error(desired, actual) / CYCLE)


def has_arrived(motion: BodyMotion, cycles: int, actual: Array, command: Array, tolerances: WalkerCalibration) -> bool:
    """Whether the hand may grasp."""
    if cycles / RATE < motion.duration:
        return False
    error = pose_error(motion.end, actual)
    return bool(
        _size(error[:3]) * INCH <= tolerances.grasp_tolerance
        and _size(error[3:]) <= tolerances.grasp_angle
        and _size(command[:3]) * INCH <= tolerances.grasp_speed * (1.0 + 1e-9)
        and _size(command[3:]) <= tolerances.grasp_rate * (1.0 + 1e-9)
    )


def _size(vector: Array) -> float:
    return float(np.linalg.norm(vector))
