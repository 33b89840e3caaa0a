"""Declarations of contacts and of torque limits on any robot, for tests that walk the registry."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin

from wbc.robot import Robot
from wbc.robot.transmission import Transmission
from wbc.tasks import (
    DivergentComponent,
    DriveTorqueLimits,
    ExternalWrench,
    Item,
    JointFriction,
    LineContact,
    PointContact,
    RigidGrasp,
    RollingContact,
    SlidingContact,
    SupportRegion,
    SurfaceContact,
    TorqueLimits,
    WrenchSum,
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
    return [(TorqueLimits(), {}), (TorqueLimits(robot.joint_names[-1], slew=100.0), {})]


def wheel(robot: Robot) -> tuple[str, tuple[float, ...]]:
    """A frame with its origin on the axis of the last revolute joint that has one, and the axis; like a wheel's."""
    model = robot.model
    for frame in reversed(list(model.frames)):
        joint = frame.parentJoint
        if joint == 0 or model.nvs[joint] != 1 or not model.joints[joint].shortname().startswith("JointModelR"):
            continue
        index = model.getFrameId(frame.name)
        jacobian = pin.computeFrameJacobian(model, model.createData(), robot.neutral, index, pin.LOCAL)
        screw = np.array(jacobian[:, model.idx_vs[joint]])
        if np.linalg.norm(screw[:3]) < 1e-9:
            return str(frame.name), tuple(screw[3:].tolist())
    raise AssertionError(robot.name)


def _rolling(robot: Robot) -> list[Declared]:
    given = {"gain": 3.0, "friction": 0.5, "least": 1.0, "most": 200.0, "target": TILTED}
    frame, axis = wheel(robot)
    return [(RollingContact(frame, radius=0.2, axis=axis), given)]


def _sum(robot: Robot) -> list[Declared]:
    return [(WrenchSum("contact"), {})]


def _support(robot: Robot) -> list[Declared]:
    return [(SupportRegion(planes=4), {})]


def _divergent(robot: Robot) -> list[Declared]:
    return [(DivergentComponent(omega=3.5), {"omega": 2.0, "gain": 4.0})]


def _drives(robot: Robot) -> list[Declared]:
    followers = {robot.dof_names[c.follower] for c in robot.couplings}
    single = [str(n) for j, n in enumerate(robot.model.names) if j > 0 and int(robot.model.nvs[j]) == 1]
    a, b = [name for name in single if name not in followers][:2]
    wrist = Transmission((a, b), {"left": {a: 1.0, b: 1.0}, "right": {a: 1.0, b: -1.0}})
    return [(DriveTorqueLimits(wrist, torque=(5.0, np.inf)), {})]


#: Classes that have no meaning for a stack that commands velocities
NO_VELOCITIES = frozenset(
    ("TorqueLimits", "DriveTorqueLimits", "ExternalWrench", "JointFriction", "WrenchSum", "DivergentComponent")
)


FACTORIES: dict[str, Callable[[Robot], list[Declared]]] = {
    "RigidGrasp": _grasp,
    "PointContact": _point,
    "SurfaceContact": _surface,
    "LineContact": _line,
    "SlidingContact": _sliding,
    "ExternalWrench": _wrench,
    "JointFriction": _friction,
    "TorqueLimits": _torques,
    "RollingContact": _rolling,
    "WrenchSum": _sum,
    "DivergentComponent": _divergent,
    "SupportRegion": _support,
    "DriveTorqueLimits": _drives,
}
