"""One picture of a run: the robot at several times, its path and the obstacles."""

from __future__ import annotations

import pathlib

import numpy as np
import pinocchio as pin

from wbc.robot import Robot
from wbc.shapes import Sphere
from wbc.track.log import Log
from wbc.track.scene import ELBOW, Scene
from wbc.validation import Array


def save_picture(
    log: Log, robot: Robot, file: pathlib.Path, main: float | None = None, size: tuple[int, int] = (960, 600)
) -> pathlib.Path | None:
    """Draw a run; returns the file, or None for a log without ticks.

    Args:
        main: time [s] at which the robot is drawn solid; default: where it is nearest to an obstacle, else the middle.
        size: width and height [pixels].
    """
    if len(log) == 0:
        return None
    solid = _main_tick(log) if main is None else int(np.argmin(np.abs(log["t"] - main)))
    scene = Scene(robot, dark=(log.meta["frame"],))
    scene.add_robot(log.array("q")[solid])
    for k in _other_ticks(log, solid):
        scene.add_robot(log.array("q")[k], pale=True)
    scene.add_path(log.array("pose")[:, :3], f"path of {log.meta['frame']}")
    if "plane.command" in log:
        scene.add_path(_elbow(log, robot), "path of the elbow", ELBOW, radius=0.004)
    for obstacle in log.meta["obstacles"].values():
        if obstacle["radius"] is not None:
            center = np.array(obstacle["pose"])[:3, 3] + float(log["t"][solid]) * np.array(obstacle["velocity"])
            scene.add_shape(Sphere(obstacle["radius"]), pin.SE3(np.eye(3), center), "obstacles")
    return scene.save(file, size)


def _main_tick(log: Log) -> int:
    gaps = log.array("clearance")
    return int(np.argmin(gaps.min(axis=1))) if gaps.size else len(log) // 2


def _other_ticks(log: Log, solid: int) -> list[int]:
    """Up to two ticks at which the frame is far from where it is at the main one, and far from each other."""
    place = log.array("pose")[:, :3]
    chosen: list[int] = []
    away = np.linalg.norm(place - place[solid], axis=1)
    least = 0.3 * float(away.max())
    while len(chosen) < 2 and away.max() > max(least, 0.02):
        chosen.append(int(np.argmax(away)))
        away = np.minimum(away, np.linalg.norm(place - place[chosen[-1]], axis=1))
    return chosen


def _elbow(log: Log, robot: Robot) -> Array:
    data = robot.model.createData()
    index = robot.model.getFrameId(robot.frames["elbow"])
    points = []
    for q in log.array("q"):
        pin.framesForwardKinematics(robot.model, data, q)
        points.append(data.oMf[index].translation.copy())
    return np.array(points)
