"""Weights and prices from 1e-5 to 1e7 in one stack: where one row may give way no tick brakes."""

from __future__ import annotations

import collections

import numpy as np
import pinocchio as pin
import pytest

import wbc.robots
from tests.models import placement
from tests.repeats import repeats
from wbc.api import Stack
from wbc.shapes import Sphere
from wbc.tasks import Damping, EndEffector, FrameVelocityLimit, Hold, JointLimits, Obstacle, Posture

FRAMES = {
    "panda": ("panda_hand_tcp", "panda_link4"),
    "ur5": ("tool0", "forearm_link"),
    "g1": ("left_rubber_hand", "right_ankle_roll_link"),
    "talos": ("gripper_left_base_link", "left_sole_link"),
}
DT = 0.01


def extreme(rng: np.random.Generator) -> float:
    return float(10.0 ** rng.uniform(-5, 7))


def softness(rng: np.random.Generator) -> dict[str, float | bool]:
    """At a price, in the class that gives way first, or hard."""
    kind = rng.random()
    return {"soft": extreme(rng)} if kind < 0.5 else {"hard": False} if kind < 0.8 else {}


def drawn(rng: np.random.Generator, name: str) -> Stack:
    """Tasks and constraints of a robot with weights and prices that are far apart."""
    robot, (tip, middle) = wbc.robots.load(name), FRAMES[name]
    if rng.random() < 0.6:
        robot = robot.with_limits(acceleration=float(10.0 ** rng.uniform(0.5, 2.5)))
    stack = Stack(robot, DT, calm=bool(rng.random() < 0.7))
    stack.add(EndEffector(tip), name="tip", weight=extreme(rng))
    if rng.random() < 0.6:
        stack.add(EndEffector(middle, kind="position"), name="middle", weight=extreme(rng))
    if rng.random() < 0.8:
        stack.add(Posture(), name="posture", weight=extreme(rng))
    if rng.random() < 0.3:
        stack.add(Damping(), name="damping", weight=extreme(rng))
    if rng.random() < 0.7:
        stack.add(Hold(middle, kind="position"), name="hold", **softness(rng))
    if rng.random() < 0.5:
        stack.add(Hold(tip, kind=str(rng.choice(["position", "orientation", "pose"]))), name="grip", **softness(rng))
    if rng.random() < 0.5:
        stack.add(FrameVelocityLimit(tip, linear=0.3), name="speed", **softness(rng))
    if rng.random() < 0.5 and robot.shapes:
        stack.add(Obstacle(Sphere(0.1)), name="ball", **softness(rng))
    return stack.add(JointLimits(), name="limits")


@pytest.mark.parametrize("seed", range(repeats(12)))
def test_no_tick_brakes(seed: int) -> None:
    rng = np.random.default_rng(seed)
    name = list(FRAMES)[seed % len(FRAMES)]
    stack = drawn(rng, name)
    robot, controller = stack.robot, stack.compile(backend="vm")
    found = collections.Counter[str]()
    for k in range(30):
        if k % 10 == 0:
            away = np.r_[np.zeros(robot.base_nv), rng.normal(0, 0.4, robot.nv - robot.base_nv)]
            q = robot.integrate(robot.neutral, away)
            controller.reset(q)
            hand = placement(robot, FRAMES[name][0], q)
            controller["tip"].target = hand * pin.SE3(pin.exp3(rng.normal(0, 0.5, 3)), rng.normal(0, 0.3, 3))
            for held in [item for item in ("hold", "grip") if item in stack and rng.random() < 0.5]:
                off = pin.SE3(pin.exp3(rng.normal(0, 0.2, 3)), rng.normal(0, 0.05, 3))
                controller[held].target = placement(robot, stack[held].item.frame, q) * off
            if "ball" in stack:
                controller["ball"].pose = pin.SE3(np.eye(3), hand.translation + rng.normal(0, 0.2, 3))
        step = controller.step(q)
        found[f"{step.status} {step.answered_by}".strip()] += 1
        q = robot.integrate(q, step.v, DT)
    assert not [how for how in found if how.startswith("braked")], found
