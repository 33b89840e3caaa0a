"""Tracking of a moving pose by velocity commands, and the test of arrival. Units: inch, radian, second.

    v_c = v_d + (p_d - p_a) / dt,    w_c = w_d + rotation vector of (R_d R_a^T) / dt                            (5-1)

A hand has arrived once the time of its motion is over and errors and commands are within their tolerances.
Source: M. R. Patterson's thesis, 5.3.2 and the listing VELCOM; ROERRC, not listed, is a reconstruction.
"""

from __future__ import annotations

import numpy as np

from wbc.multibody import pin
from wbc.published.three_arm_walker.machine.calibration import WalkerCalibration
from wbc.published.three_arm_walker.machine.grid import INCH
from wbc.published.three_arm_walker.machine.motion import CYCLE, RATE, BodyMotion
from wbc.validation import Array


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
