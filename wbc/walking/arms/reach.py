"""Where the wrist of the walker's arm can be, as far as the first three joints decide."""

from __future__ import annotations

from math import cos, pi, sqrt

import numpy as np

from wbc.robots import WalkerData
from wbc.validation import Array


def shoulder_span(data: WalkerData, theta3: float) -> float:
    """Distance from shoulder to wrist at an elbow angle [m]."""
    es, we = data.upper_arm_length, data.forearm_length
    return sqrt(es * es + we * we + 2 * es * we * cos(theta3))


def wrist_margin(data: WalkerData, points: Array) -> Array:
    """See :meth:`wbc.walking.ArmKinematics.wrist_reach`; points are checked already."""
    es, we = data.upper_arm_length, data.forearm_length
    across2 = (points[..., :2] ** 2).sum(axis=-1) - data.shoulder_offset**2
    r, z = np.sqrt(np.maximum(across2, 0.0)), points[..., 2] - data.neck_length
    distance = np.hypot(r, z)
    longest, shortest = (shoulder_span(data, angle) for angle in (data.elbow_limit, -data.position_limits[2]))
    bend = -np.arccos(np.clip((distance**2 - es * es - we * we) / (2 * es * we), -1.0, 1.0))
    # theta2 + theta3 / 2, which is the direction of the wrist from the shoulder where ES = WE
    lean = np.arctan2(r, z) - np.arctan2(we * np.sin(bend), es + we * np.cos(bend)) + bend / 2
    over = lean - data.shoulder_limit
    cone = np.where(over < pi / 2, distance * np.sin(np.maximum(over, -pi / 2)), distance)
    # Nearer to the axis of joint 1 than the shoulder's offset there is no posture
    cone = np.where(across2 < 0, -np.sqrt(np.maximum(-across2, 0.0)), cone)
    out: Array = np.minimum(np.minimum(longest - distance, distance - shortest), cone)
    return out
