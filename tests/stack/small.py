"""Small stacks of these tests: a planar arm of two joints, compiled in about a second."""

from __future__ import annotations

import wbc
from wbc.api import Controller, Stack
from wbc.robots import DHRow, from_dh
from wbc.tasks import EndEffector, JointLimits, Posture

DT = 0.01
Q = (0.3, 0.8)
TARGET = (0.2, 0.6, 0.0)


def arm(length: float = 0.5, velocity: float = 1.0) -> wbc.robot.Robot:
    """Two revolute joints; both links lie in the plane."""
    return from_dh([DHRow(a=length, velocity=velocity), DHRow(a=0.4, velocity=1.0)])


def stack(robot: wbc.robot.Robot | None = None, **hand: object) -> Stack:
    """A place of the tip, a posture, joint limits."""
    out = Stack(robot if robot is not None else arm(), DT)
    out.add(EndEffector("tip", kind="position", **hand), name="hand")
    out.add(Posture(), name="posture", weight=1e-3)
    out.add(JointLimits(), name="limits")
    return out


def command(controller: Controller) -> list[float]:
    """Velocities of one tick that has something to do."""
    controller.reset()
    controller["posture"].target = Q
    controller["hand"].target = TARGET
    return controller.step(Q).v.tolist()
