"""Where frames of a robot are at many configurations at once."""

from __future__ import annotations

from functools import lru_cache

import casadi as ca
import numpy as np

from wbc.retarget.clip import Array
from wbc.robot import Robot
from wbc.symbolic.kinematics import Kinematics


def frame_poses(robot: Robot, names: tuple[str, ...], q: Array) -> tuple[Array, Array]:
    """Rotations [n, names, 3, 3] and positions [n, names, 3] [m] of frames at configurations [n, nq]."""
    numbers = np.asarray(_poses_of(robot, names)(q.T)).reshape(3, len(q), len(names), 4).transpose(1, 2, 0, 3)
    return np.ascontiguousarray(numbers[..., :3]), np.ascontiguousarray(numbers[..., 3])


@lru_cache(maxsize=8)
def _poses_of(robot: Robot, names: tuple[str, ...]) -> ca.Function:
    """From a configuration to [R p] of the frames, side by side."""
    kinematics = Kinematics(robot.model)
    poses = [kinematics.pose(name) for name in names]
    return ca.Function(
        "poses", [kinematics.q], [ca.horzcat(*(x for pose in poses for x in (pose.rotation, pose.position)))]
    )
