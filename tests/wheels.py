"""Robots on wheels: plain, mecanum, omni, and legs with wheels; how each moves, from textbooks."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
import pinocchio as pin

import wbc.robots
from wbc.robot import Limits, Robot
from wbc.tasks import Wheel

Array = np.ndarray

#: Height of the wheels' centres above the ground [m], and where they are, as the descriptions give them
TIAGO_RADIUS, TIAGO_HALF_TRACK = 0.0985, 0.2022
PRO_RADIUS, PRO_AT = 0.0762, (0.244, 0.223175)
OMNI_RADIUS, OMNI_ARM, OMNI_ANGLES = 0.05, 0.2, (0.3, 0.3 + 2 * math.pi / 3, 0.3 + 4 * math.pi / 3)
CENTAURO_RADIUS = 0.0762


@dataclass(frozen=True, eq=False)
class Vehicle:
    """A robot with its wheels.

    Attributes:
        base: frame of the body that the wheels carry.
        twist: turns of the wheels, in their order [rad] -> the base's (forwards, sideways, turn) in its own axes; None
            where the wheels are steered.
    """

    robot: Robot
    wheels: tuple[Wheel, ...]
    base: str
    twist: Callable[[Array], Array] | None


def _differential(turned: Array) -> Array:
    left, right = TIAGO_RADIUS * turned
    return np.array([(left + right) / 2, 0.0, (right - left) / (2 * TIAGO_HALF_TRACK)])


def _mecanum(turned: Array) -> Array:
    """Front left, front right, rear left, rear right; the rollers on the ground form a diamond."""
    a, b, c, d = PRO_RADIUS * turned / 4
    return np.array([a + b + c + d, -a + b + c - d, (-a + b - c + d) / sum(PRO_AT)])


def _omni(turned: Array) -> Array:
    rows = [[math.sin(a), -math.cos(a), -OMNI_ARM] for a in OMNI_ANGLES]
    return np.linalg.solve(np.array(rows), OMNI_RADIUS * turned)


def omni_robot() -> Robot:
    """A planar base on three omni wheels with radial axes, and a mast with a joint on top."""
    model = pin.Model()
    base = model.addJoint(0, pin.JointModelPlanar(), pin.SE3.Identity(), "root_joint")
    model.appendBodyToJoint(base, pin.Inertia(10.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    model.addFrame(pin.Frame("base", base, 0, pin.SE3.Identity(), pin.FrameType.BODY))
    for k, angle in enumerate(OMNI_ANGLES):
        turn = pin.AngleAxis(angle, np.array([0.0, 0.0, 1.0])).toRotationMatrix()
        place = pin.SE3(turn, turn @ np.array([OMNI_ARM, 0.0, 0.0]) + np.array([0.0, 0.0, OMNI_RADIUS]))
        model.addJoint(base, pin.JointModelRUBX(), place, f"wheel_{k}")
    mast = model.addJoint(base, pin.JointModelRY(), pin.SE3(np.eye(3), np.array([0.1, 0.0, 0.5])), "mast")
    model.addFrame(pin.Frame("tip", mast, 0, pin.SE3(np.eye(3), np.array([0.3, 0.0, 0.0])), pin.FrameType.OP_FRAME))
    free = np.full(model.nv, np.inf)
    speed = np.array([np.inf] * 3 + [20.0] * 3 + [2.0])
    return Robot("omni", model, Limits(-free, free, speed, free, free), base="planar")


@cache
def vehicle(name: str) -> Vehicle:
    """One of :data:`VEHICLES`."""
    quarter = math.pi / 4
    if name == "tiago":
        robot = wbc.robots.load("tiago_no_hand", lock=(), shapes="none")
        wheels = tuple(Wheel(f"wheel_{side}_joint", TIAGO_RADIUS) for side in ("left", "right"))
        return Vehicle(robot, wheels, "base_link", _differential)
    if name == "tiago_pro":
        robot = wbc.robots.load("tiago_pro", lock=["gripper_*_joint"], shapes="none")
        rollers = {"front_left": -quarter, "front_right": quarter, "rear_left": quarter, "rear_right": -quarter}
        wheels = tuple(Wheel(f"wheel_{corner}_joint", PRO_RADIUS, roller) for corner, roller in rollers.items())
        return Vehicle(robot, wheels, "base_link", _mecanum)
    if name == "omni":
        wheels = tuple(Wheel(f"wheel_{k}", OMNI_RADIUS, 0.0) for k in range(3))
        return Vehicle(omni_robot(), wheels, "base", _omni)
    robot = wbc.robots.load("centauro", lock=["d435_head_joint", "velodyne_joint"], shapes="none")
    wheels = tuple(Wheel(f"j_wheel_{k}", CENTAURO_RADIUS) for k in range(1, 5))
    return Vehicle(robot, wheels, "pelvis", None)


#: Differential drive, mecanum, three omni wheels, four steered wheels on legs
VEHICLES = ("tiago", "tiago_pro", "omni", "centauro")
