"""``parts``: what operators command of a robot, published or found in the robot itself."""

from __future__ import annotations

import os
from functools import lru_cache
from pathlib import Path

from wbc import validation
from wbc.coordinates.arms.arm_parts import Parts
from wbc.coordinates.arms.found_parts import found_parts
from wbc.coordinates.arms.published_parts import published_parts
from wbc.errors import ShapeError
from wbc.robot import Robot
from wbc.robots import load
from wbc.robots.operator_arms import OPERATOR_ARMS

#: Robots whose parts are cached
KEPT = 32


def parts(robot: str | Robot) -> Parts:
    """Parts of a robot: of the arms of :func:`wbc.robots.operator_arm` the published ones, of any other those that
    :func:`wbc.coordinates.arms.found_parts.found_parts` finds in it.

    Args:
        robot: what :func:`wbc.robots.load` takes by name or file, or a robot.

    Raises:
        UnknownNameError, RobotFileError: no such robot. MissingPartError: it has no arm that stands somewhere.
    """
    if isinstance(robot, Robot):
        return _found(robot)
    if isinstance(robot, os.PathLike):
        robot = os.fspath(robot)
    if not isinstance(robot, str):
        raise ShapeError("robot", robot, "expected a name, a file, or a Robot")
    known = validation.is_file("robot", robot)
    return _named(robot, Path(robot).stat().st_mtime_ns if known else 0)


@lru_cache(maxsize=KEPT)
def _named(robot: str, changed: int) -> Parts:
    """``changed``: when a file was written last, so that another one of its name is read."""
    return published_parts(robot) if robot in OPERATOR_ARMS else found_parts(load(robot))


@lru_cache(maxsize=KEPT)
def _found(robot: Robot) -> Parts:
    return found_parts(robot)
