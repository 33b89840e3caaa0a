"""Hand poses of the walker whose paths the thesis generates, in metres: grid places on a cylinder of 100 in."""

from __future__ import annotations

import numpy as np

from wbc.trajectory import Law, via_points

INCH = 0.0254


def rot_z(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def grid_pose(column: int, row: int, radius: float) -> np.ndarray:
    """At angle 25 + 5 T degrees round the cylinder, 9.25 in a row along it, its z axis inward (ZYZ -angle, 90, 0)."""
    angle = np.radians(25.0 + 5.0 * column)
    pose = np.eye(4)
    pose[:3, :3] = rot_z(-angle) @ np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    pose[:3, 3] = INCH * np.array([-radius * np.cos(angle), radius * np.sin(angle), -9.25 * row])
    return pose


def swing(start: tuple[int, int], end: tuple[int, int]) -> list[np.ndarray]:
    """Off one hold, over to the next at 3 in above the cylinder, and down."""
    return [grid_pose(*start, 100.0), grid_pose(*start, 103.0), grid_pose(*end, 103.0), grid_pose(*end, 100.0)]


def inches(
    poses: list[np.ndarray], speed: float, acceleration: float, deviation: float = 1.0, angular: float = 4.0
) -> Law:
    """The law with its bounds in inches."""
    return via_points(
        poses,
        speed=speed * INCH,
        acceleration=acceleration * INCH,
        deviation=deviation * INCH,
        angular_acceleration=angular,
    )


def place(x: float, y: float = 0.0, z: float = 0.0, turn: float = 0.0) -> np.ndarray:
    """A pose turned about z."""
    pose = np.eye(4)
    pose[:3, :3] = rot_z(turn)
    pose[:3, 3] = x, y, z
    return pose
