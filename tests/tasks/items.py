"""Declarations of every shipped class on any of the test robots, for the test that walks the registry."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

from tests.constraints.items import FACTORIES as CONSTRAINTS
from tests.constraints.items_limits import FACTORIES as LIMITS
from tests.tasks.items_coordination import FACTORIES as COORDINATION
from tests.tasks.items_pointing import FACTORIES as POINTING
from tests.tasks.robots import FRAMES
from wbc.robot import Robot
from wbc.tasks import (
    CenterOfMass,
    Damping,
    Elbow,
    EndEffector,
    Expression,
    Input,
    Item,
    PitchPlane,
    PitchPlaneLimit,
    Posture,
)

#: An item and the run-time values that the test may not draw at random.
Declared = tuple[Item, dict[str, Any]]


def _end_effector(robot: Robot) -> list[Declared]:
    f = FRAMES[robot.name]
    items = [
        EndEffector(f.tip),
        EndEffector(f.tip, axes="frame"),
        EndEffector(f.tip, axes=f.base),
        EndEffector(f.tip, relative_to=f.base),
        EndEffector(f.tip, relative_to=f.base, axes="world", weights=(1, 2, 3, 4, 5, 0)),
        EndEffector(f.tip, relative_to=f.base, axes="frame"),
        EndEffector(f.tip, relative_to=f.base, axes=f.middle),
        EndEffector(f.tip, kind="position", relative_to=f.base, axes=f.middle),
        EndEffector(f.tip, kind="position"),
        EndEffector(f.tip, kind="orientation", axes="frame"),
        EndEffector(f.tip, kind="orientation", relative_to=f.base),
    ]
    return [(item, {}) for item in items]


def _elbow(robot: Robot) -> list[Declared]:
    f = FRAMES[robot.name]
    items = [
        Elbow(f.middle),
        Elbow(f.middle, offset=(0.1, -0.2, 0.05)),
        Elbow(f.middle, offset=(0.1, -0.2, 0.05), axes="frame"),
        Elbow(f.middle, offset=(0.1, -0.2, 0.05), axes=f.tip),
    ]
    return [(item, {}) for item in items]


def _posture(robot: Robot) -> list[Declared]:
    some = (robot.joint_names[-1], robot.joint_names[0])
    return [(Posture(), {}), (Posture(joints=some), {}), (Posture(start="neutral"), {})]


def _damping(robot: Robot) -> list[Declared]:
    return [(Damping(), {}), (Damping(weights=range(1, robot.nv + 1)), {})]


def _center_of_mass(robot: Robot) -> list[Declared]:
    return [(CenterOfMass(), {}), (CenterOfMass(axes=FRAMES[robot.name].tip), {})]


def _expression(robot: Robot) -> list[Declared]:
    f = FRAMES[robot.name]
    height = Expression(
        lambda kin, p: kin.position(f.tip)[2] - p["height"],
        units="m",
        inputs=(Input("height", unit="m", default=0.4, rate="speed"), Input("speed", unit="m/s", default=0.0)),
    )
    mixed = Expression(
        lambda kin, p: [
            kin.center_of_mass() - p["place"].point(kin.position(f.middle)),
            kin.joint(robot.joint_names[-1]) * ca.dot(kin.rotation(f.tip)[:, 0], p["turn"][:, 1]),
            ca.sin(kin.rotation_error(f.tip, f.base, p["turn"])[0]),
        ],
        units=("m", "m", "m", "rad", "rad"),
        inputs=(
            Input("place", "pose", default=np.eye(4), rate="twist"),
            Input("twist", size=6, default=np.zeros(6)),
            Input("turn", "rotation", default=np.eye(3), rate="spin"),
            Input("spin", size=3, default=np.zeros(3)),
        ),
    )
    return [(height, {}), (mixed, {})]


def _pitch_plane(robot: Robot) -> list[Declared]:
    f = FRAMES[robot.name]
    return [
        (PitchPlane(*f.plane), {}),
        (PitchPlane(*f.plane, axis=f.axis), {}),
        (PitchPlane(*f.plane, elbow_offset=(0.02, 0.03, -0.01), base=f.base), {}),
    ]


def _pitch_plane_limit(robot: Robot) -> list[Declared]:
    return [(PitchPlaneLimit(*FRAMES[robot.name].plane, lower=-0.5, upper=1.0), {})]


#: Class name -> declarations on a robot.
FACTORIES: dict[str, Callable[[Robot], list[Declared]]] = {
    "EndEffector": _end_effector,
    "Elbow": _elbow,
    "Posture": _posture,
    "Damping": _damping,
    "CenterOfMass": _center_of_mass,
    "Expression": _expression,
    "PitchPlane": _pitch_plane,
    "PitchPlaneLimit": _pitch_plane_limit,
    **POINTING,
    **COORDINATION,
    **CONSTRAINTS,
    **LIMITS,
}
