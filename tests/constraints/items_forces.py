"""Declarations of contacts and of torque limits on any robot, for tests that walk the registry."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin

from wbc.robot import Robot
from wbc.tasks import (
    ExternalWrench,
    Item,
    JointFriction,
    LineContact,
    PointContact,
    RigidGrasp,
    SlidingContact,
    SurfaceContact,
    TorqueLimits,
)

#: A plane like any other, for what slides
TILTED = pin.SE3(pin.exp3(np.array([0.4, -0.7, 0.2])), np.array([0.3, 0.1, 0.5]))

#: An item and the run-time values that differ from its defaults
Declared = tuple[Item, dict[str, Any]]


def _tip(robot: Robot) -> str:
    depth = [0] * robot.model.njoints
    for j in range(1, robot.model.njoints):
        depth[j] = depth[robot.model.parents[j]] + 1
    last = max(range(robot.model.njoints), key=depth.__getitem__)
    return str(next(f.name for f in robot.model.frames if f.parentJoint == last))


def _grasp(robot: Robot) -> list[Declared]:
    full = {"gain": 3.0, "force": np.array([50.0, 60.0, 70.0])}
    return [
        (RigidGrasp(_tip(robot)), {"gain": 3.0}),
        (RigidGrasp(_tip(robot), force=(100.0, np.inf, 50.0), torque=20.0), full | {"torque": np.full(3, 20.0)}),
    ]


def _point(robot: Robot) -> list[Declared]:
    given = {"gain": 3.0, "friction": 0.5, "least": 1.0, "most": 200.0}
    return [(PointContact(_tip(robot)), given), (PointContact(_tip(robot), friction=0.8, edges=7), given)]


def _surface(robot: Robot) -> list[Declared]:
    given = {"gain": 3.0, "friction": 0.5, "least": 1.0, "most": 200.0}
    return [(SurfaceContact(_tip(robot), half_lengths=(0.1, 0.05)), given)]


def _line(robot: Robot) -> list[Declared]:
    given = {"gain": 3.0, "friction": 0.5, "least": 1.0, "most": 200.0}
    return [(LineContact(_tip(robot), half_length=0.07), given)]


def _sliding(robot: Robot) -> list[Declared]:
    given = {"gain": 3.0, "friction": 0.5, "least": 1.0, "most": 200.0, "slow": 0.02, "target": TILTED}
    return [(SlidingContact(_tip(robot)), given)]


def _wrench(robot: Robot) -> list[Declared]:
    return [(ExternalWrench(_tip(robot)), {})]


def _friction(robot: Robot) -> list[Declared]:
    return [(JointFriction(viscous=0.2, coulomb=0.4, slow=0.02), {})]


def _torques(robot: Robot) -> list[Declared]:
    return [(TorqueLimits(), {}), (TorqueLimits(robot.joint_names[-1]), {})]


FACTORIES: dict[str, Callable[[Robot], list[Declared]]] = {
    "RigidGrasp": _grasp,
    "PointContact": _point,
    "SurfaceContact": _surface,
    "LineContact": _line,
    "SlidingContact": _sliding,
    "ExternalWrench": _wrench,
    "JointFriction": _friction,
    "TorqueLimits": _torques,
}
