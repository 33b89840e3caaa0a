"""The arm that the tests of the viewer drive."""

from __future__ import annotations

import functools

import numpy as np
import pinocchio as pin

import wbc
from wbc.api import Controller
from wbc.controller import core_of
from wbc.controller.step import state_of
from wbc.viewer.link import SharedTick

DT, ACCELERATION = 0.01, 6.0
BALL = pin.SE3(np.eye(3), np.array([0.45, 0.4, 0.5]))


@functools.cache
def stack() -> wbc.Stack:
    """A Panda with a hand to drag, its posture and a ball that the hand keeps clear of."""
    robot = wbc.robots.load("panda").with_limits(acceleration=ACCELERATION)
    out = wbc.Stack(robot, dt=DT)
    out.add(wbc.tasks.EndEffector(robot.frames["tip"], gain=5.0), name="hand")
    out.add(wbc.tasks.Posture(), name="posture", weight=1e-4)
    out.add(wbc.tasks.JointLimits(), name="limits")
    ball = wbc.tasks.Obstacle(wbc.shapes.Sphere(0.1), links=("panda_hand",), margin=0.02, pose=BALL)
    out.add(ball, name="ball")
    return out


@functools.cache
def shared() -> Controller:
    """One that is compiled once for a process of tests."""
    return stack().compile(backend="vm")


def fresh() -> Controller:
    """A controller at rest at the robot's neutral configuration."""
    out = shared().clone()
    out.reset(out.stack.robot.neutral)
    return out


def states(ticks: int) -> list[SharedTick]:
    """Of a hand that goes up by 0.2 m."""
    controller, out = fresh(), []
    q = controller.stack.robot.neutral
    target = controller["hand"].target.copy()
    target.translation = target.translation + [0.0, 0.0, 0.2]
    controller["hand"].target = target
    for k in range(ticks):
        step = controller.step(q)
        out.append(SharedTick(k + 1, k * DT, state_of(step)))
        q = controller.stack.robot.integrate(q, step.v, DT)
    return out


def state_size() -> int:
    """Bytes of a state."""
    return 8 * core_of(shared()).context.memory.state
