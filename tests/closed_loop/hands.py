"""Closed loops of two hands on one object, on three robots with two arms; judged with Pinocchio's poses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin

import wbc.robots
from tests.closed_loop.eyes import Array, Eyes
from tests.closed_loop.loop import Loop
from tests.closed_loop.subjects import Subject
from tests.closed_loop.tasks import DT
from tests.repeats import ALL, MORE, repeats
from wbc.robot import Robot
from wbc.tasks import Item, RelativePose

#: A humanoid, an arm on either side of a fixed torso, and two arms with unbounded joints on a mobile base
ROBOTS = ("talos", "pr2") if MORE < ALL else ("talos", "baxter", "pr2")

#: A point of the object in the left hand's frame, away from both hands [m]
AT = (0.1, -0.2, 0.15)


@dataclass(frozen=True)
class Hands:
    """Frames of the two hands."""

    left: str
    right: str


FRAMES = {
    "talos": Hands("gripper_left_base_link", "gripper_right_base_link"),
    "baxter": Hands("left_gripper", "right_gripper"),
    "pr2": Hands("l_gripper_tool_frame", "r_gripper_tool_frame"),
}


class HandsLoop(Loop):
    """A loop whose checks speak of two hands."""

    def __init__(self, robot: Robot, items: Mapping[str, Item], dt: float, name: str) -> None:
        self._hands = FRAMES[name]
        super().__init__(robot, items, dt, name)

    @property
    def frames(self) -> Any:
        return self._hands


def seen(eyes: Eyes, f: Hands, q: Array) -> pin.SE3:
    """The right hand from the left."""
    left, right = eyes.poses(q, f.left, f.right)
    return left.actInv(right)


def images(eyes: Eyes, f: Hands, q: Array, target: pin.SE3) -> tuple[pin.SE3, pin.SE3]:
    """The object as each hand holds it: frames at the point, parallel when the grasp is as wanted."""
    left, right = eyes.poses(q, f.left, f.right)
    held = pin.SE3(np.eye(3), np.array(AT))
    return left * held, right * target.inverse() * held


def midway(eyes: Eyes, f: Hands, q: Array, target: pin.SE3) -> Array:
    """From the left image to the right one, in the axes of the rotation halfway between them."""
    a, b = images(eyes, f, q, target)
    turn = pin.log3(a.rotation.T @ b.rotation)
    half = pin.Quaternion(a.rotation).slerp(0.5, pin.Quaternion(b.rotation)).matrix()
    return np.concatenate([half.T @ (b.translation - a.translation), half.T @ a.rotation @ turn])


def apart(eyes: Eyes, f: Hands, q: Array, target: pin.SE3) -> Array:
    return midway(eyes, f, q, target)[:3]


def turned(eyes: Eyes, f: Hands, q: Array, target: pin.SE3) -> Array:
    a, b = images(eyes, f, q, target)
    return np.array(pin.log3(a.rotation.T @ b.rotation))


def subject(kind: str, error: Any) -> Subject:
    def declare(f: Any, robot: Robot) -> Item:
        return RelativePose(f.left, f.right, kind=kind, at=AT)

    measure: Any = seen
    return Subject(RelativePose, declare, measure, error)


SUBJECTS: dict[str, Subject] = {
    "object": replace(subject("pose", midway), starts=repeats(48)),
    "pivot": subject("position", apart),
    "parallel": subject("orientation", turned),
}


@cache
def robot(name: str) -> Robot:
    return wbc.robots.load(name, shapes="none")


def build(name: str) -> Loop:
    """Every form of the task."""
    f: Any = FRAMES[name]
    return HandsLoop(robot(name), {key: s.declare(f, robot(name)) for key, s in SUBJECTS.items()}, DT, name)
