"""Closed loops of joints in a linear relation; angles are read from the poses that Pinocchio gives the bodies."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin

from tests.closed_loop.eyes import Array, Eyes, wrap
from tests.closed_loop.loop import Loop
from tests.closed_loop.machines import machine
from tests.closed_loop.subjects import Subject
from tests.closed_loop.tasks import DT
from tests.rates import single_joints
from tests.tasks.robots import FRAMES
from wbc.robot import Robot
from wbc.tasks import JointCoupling


def relations(names: tuple[str, ...]) -> list[dict[str, float]]:
    """Two joints in a gear's ratio, and a sum of three; whole numbers, as unbounded joints need them."""
    a, b, c = names[0], names[2], names[-1]
    return [{a: 2.0, b: -3.0}, {b: 1.0, a: 1.0, c: -1.0}]


@cache
def axes(robot: Robot) -> dict[str, Array]:
    """Axis of every joint of the relations in its own frame."""
    names = dict.fromkeys(joint for row in relations(single_joints(robot)) for joint in row)
    numbers = {joint: robot.model.getJointId(joint) for joint in names}
    return {j: np.asarray(robot.model.joints[k].createData().S).ravel()[3:] for j, k in numbers.items()}


def angle(eyes: Eyes, joint: str) -> float:
    """Turn of a body about its joint's axis, from its pose in its parent; in (-pi, pi]."""
    number = eyes.model.getJointId(joint)
    turn = eyes.model.jointPlacements[number].rotation.T @ eyes.data.liMi[number].rotation
    return float(axes(eyes.robot)[joint] @ pin.log3(turn))


def totals(eyes: Eyes, q: Array) -> list[float]:
    pin.forwardKinematics(eyes.model, eyes.data, q)
    turned = {joint: angle(eyes, joint) for joint in axes(eyes.robot)}
    return [sum(c * turned[joint] for joint, c in row.items()) for row in relations(single_joints(eyes.robot))]


def sums(eyes: Eyes, f: Any, q: Array) -> Array:
    """The sums of angles, each in (-pi, pi]."""
    return np.array([wrap(total) for total in totals(eyes, q)])


def lacking(eyes: Eyes, f: Any, q: Array, target: Array) -> Array:
    return np.array([wrap(total - t) for total, t in zip(totals(eyes, q), target, strict=True)])


def fits(eyes: Eyes, f: Any, q: Array) -> bool:
    """Bounded joints count from zero and not by whole turns, so their sums must be within half a turn."""
    unbounded = eyes.robot.base == "fixed" and eyes.model.nq > eyes.model.nv
    return unbounded or all(abs(total) < math.pi - 1.0 for total in totals(eyes, q))


SUBJECTS: dict[str, Subject] = {
    "gear": Subject(
        JointCoupling,
        lambda f, robot: JointCoupling(relations(single_joints(robot))),
        sums,
        lacking,
        reach=0.15,
        usable=fits,
    )
}


def build(name: str) -> Loop:
    """The coupling alone."""
    items = {key: s.declare(FRAMES[name], machine(name)) for key, s in SUBJECTS.items()}
    return Loop(machine(name), items, DT, name)
