"""A planar arm of five joints with levels, compiled in a second, and random states of it."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wbc.api import Controller, Stack
from wbc.robot import Robot
from wbc.robots import DHRow, from_dh
from wbc.shapes import PlacedShape, Sphere
from wbc.tasks import Elbow, EndEffector, FrameVelocityLimit, JointLimits, Obstacle, Posture

DT = 0.01
JOINTS = 5


def arm() -> Robot:
    """Links of 0.3 m in a plane, 1 rad/s."""
    robot = from_dh([DHRow(a=0.3, velocity=1.0)] * JOINTS)
    return robot.with_shapes({"link5": [PlacedShape(Sphere(0.05), pin.SE3.Identity())]})


def levels(calm: bool = False, soft: bool = True) -> Stack:
    """A tip, a knee below it, a posture below both; a slow link in between, a ball that is hard."""
    robot = arm()
    stack = Stack(robot, DT, calm=calm)
    stack.add(Posture(), name="posture", level=7)
    stack.add(EndEffector("tip", kind="position"), name="tip")
    stack.add(Elbow("link3"), name="knee", level=2)
    if soft:
        stack.add(FrameVelocityLimit("link2", linear=0.05), name="slow", level=3)
        stack.add(Obstacle(Sphere(0.1), links="link5"), name="ball")
    stack.add(JointLimits(), name="limits")
    return stack


def put(controller: Controller, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Random targets, and a state: sometimes stretched, sometimes folded; q and v."""
    q = rng.uniform(-2.0, 2.0, JOINTS)
    kind = rng.random()
    if kind < 0.15:
        q[1:] = 0.0
    elif kind < 0.3:
        q[1:] = 1e-3 * rng.normal(size=JOINTS - 1)
    controller.reset(q)
    controller["tip"].target = [*rng.uniform(-1.2, 1.2, 2), 0.0]
    controller["knee"].target = [*rng.uniform(-0.8, 0.8, 2), 0.0]
    controller["posture"].target = rng.uniform(-1.0, 1.0, JOINTS)
    if "ball" in controller:
        controller["ball"].pose = pin.SE3(np.eye(3), np.append(rng.uniform(-1.0, 1.0, 2), 0.0))
    return q, rng.normal(size=JOINTS) * rng.choice([0.0, 0.5])
