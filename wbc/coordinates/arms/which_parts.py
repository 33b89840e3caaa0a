"""``parts``: what operators command of a robot, published or found in the robot itself."""

from __future__ import annotations

import os
from functools import lru_cache
from pathlib import Path

import numpy as np

from wbc import validation
from wbc.analysis.rows import BodyRows, JointRows, PitchPlaneRows
from wbc.coordinates.arms.arm_parts import Arm, Held, Parts, components
from wbc.coordinates.arms.found_parts import found_parts
from wbc.coordinates.rows import Coordinate
from wbc.errors import ShapeError
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.robots import load, operator_arm
from wbc.robots.operator_arms import OPERATOR_ARMS
from wbc.symbolic.kinematics import WORLD

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


def published_parts(name: str) -> Parts:
    """Parts of a robot of :func:`wbc.robots.operator_arm`; the name is known."""
    robot = operator_arm(name).robot
    if name == "spdm":
        arms = _seven("arm1_", 2), _seven("arm2_", 2)
        return Parts(robot, arms, "body_joint", free_body=_free_body(arms[0]))
    if name == "spdm_on_ssrms":
        return Parts(robot, (_seven("arm1_", 2), _seven("arm2_", 2)), "body_joint", _seven("carrier_", 1))
    if name == "planar_rp":
        tip = BodyRows("tip", expressed=WORLD, translation=(0, 1), rotation=(), name="tip")
        # One joint cannot lead a point in the plane: what it can is one of its coordinates
        middle = BodyRows("end1", expressed=WORLD, translation=(1,), rotation=(), name="end of link 1 y")
        return Parts(robot, (Arm("", ("joint1", "joint2"), tip, middle, 1, None, (), ((),), (), None, ()),))
    if name == "planar_3r":
        tip = BodyRows("tip", expressed=WORLD, translation=(0, 1), rotation=(), name="tip")
        robot = robot.with_frame("middle", "F2", pin.SE3(np.eye(3), np.array([0.4, 0.0, 0.0])))
        middle = BodyRows("middle", expressed=WORLD, translation=(0, 1), rotation=(), name="middle")
        joints = ("joint1", "joint2", "joint3")
        sets: tuple[Held, ...] = tuple((one,) for one in components(middle))
        return Parts(robot, (Arm("", joints, tip, middle, 2, None, (), sets, (), (), ()),))
    if name == "spherical_4r":
        elbow = BodyRows("end3", rotation=(), name="elbow")
        four = tuple(f"joint{k}" for k in range(1, 5))
        alpha, beta = PitchPlaneRows("F3", "tip"), _beta("", 1)
        sets = _single(alpha, (beta,), four[:2], elbow)
        tip = BodyRows("tip", rotation=(), name="tip")
        return Parts(robot, (Arm("", four, tip, elbow, 3, alpha, (beta,), sets, (alpha,), (), ()),))
    return Parts(robot, (_seven("", 2 if name.startswith("spdm") else 1),))


def _beta(prefix: str, pitch: int) -> BodyRows:
    return BodyRows(f"{prefix}F2", expressed=f"{prefix}F3", translation=(), rotation=(pitch,), name=f"{prefix}beta")


def _seven(prefix: str, pitch: int) -> Arm:
    """An arm with seven joints; ``pitch``: axis of its frames about which the pitch joints turn."""
    beta = _beta(prefix, pitch)
    gamma = BodyRows(f"{prefix}F6", expressed=f"{prefix}F5", translation=(), rotation=(pitch,), name=f"{prefix}gamma")
    joints = tuple(f"{prefix}joint{k}" for k in range(1, 8))
    elbow = BodyRows(f"{prefix}end3", rotation=(), name=f"{prefix}elbow")
    alpha = PitchPlaneRows(f"{prefix}F3", f"{prefix}F5", name=f"{prefix}alpha")
    sets = _single(alpha, (beta, gamma), (joints[0], joints[1], joints[6]), elbow)
    wrist = tuple(JointRows(name) for name in joints[4:])
    # Three joints whose axes meet lead the elbow over a sphere; the turn about the line to it is the pitch plane's
    position: tuple[Held, ...] = (alpha, *wrist), (JointRows(joints[0]), *wrist)
    tip = BodyRows(f"{prefix}tip", name=f"{prefix}xi")
    return Arm(prefix, joints, tip, elbow, 3, alpha, (beta, gamma), sets, (alpha,), (), position)


def _single(alpha: Coordinate, in_plane: Held, locks: tuple[str, ...], point: BodyRows) -> tuple[Held, ...]:
    """Coordinates that take one degree of redundancy up, the default first."""
    return tuple((one,) for one in (alpha, *in_plane, *map(JointRows, locks), *components(point)))


def _free_body(arm: Arm) -> tuple[Held, ...]:
    """What is held where the arm by itself is singular and the body joint moves.

    The five were chosen by a search over all twos of alpha, beta, gamma and locks; how well they do is measured in
    docs/coordinates.md.
    """
    assert arm.alpha is not None
    held: list[Held] = [(arm.alpha, JointRows(arm.joints[k])) for k in (1, 4)]
    return (*held, *((JointRows(arm.joints[i]), JointRows(arm.joints[k])) for i, k in ((0, 4), (1, 2), (2, 4))))
