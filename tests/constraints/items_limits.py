"""Declarations of limits on frames and on tasks on any of the test robots, for the test that walks the registry."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin

from tests.tasks.robots import FRAMES
from wbc.robot import Robot
from wbc.tasks import (
    AxisCone,
    CenterOfMass,
    Elbow,
    EndEffector,
    Expression,
    GazeCone,
    Input,
    Item,
    Limit,
    PitchPlane,
    PlaneReference,
    WorkspaceBox,
    WorkspacePolyhedron,
)

#: An item and the run-time values that the test may not draw at random
Declared = tuple[Item, dict[str, Any]]

OFFSET = (0.1, -0.2, 0.05)


def _box(robot: Robot) -> list[Declared]:
    f = FRAMES[robot.name]
    return [
        (WorkspaceBox(f.tip, lower=(-1, -2, -3), upper=(1, 2, 3)), {}),
        (WorkspaceBox(f.tip, lower=-1.0, relative_to=f.base, offset=OFFSET), {}),
        (WorkspaceBox(f.tip, upper=1.0, offset=OFFSET), {}),
    ]


def _polyhedron(robot: Robot) -> list[Declared]:
    f = FRAMES[robot.name]
    normals = [(0, 0, 2), (1, -1, 0.5), (-0.3, 0.2, -0.1)]
    moved = pin.SE3(pin.exp3(np.array([0.3, -0.2, 0.1])), np.array([0.2, 0.3, -0.1]))
    return [
        (WorkspacePolyhedron(f.tip, normals, offsets=[0.1, 0.2, -0.3], pose=moved), {}),
        (WorkspacePolyhedron(f.tip, normals[1:], relative_to=f.base, offset=OFFSET), {}),
    ]


def _axis_cone(robot: Robot) -> list[Declared]:
    f = FRAMES[robot.name]
    return [
        (AxisCone(f.tip, 0.4), {}),
        (AxisCone(f.tip, 2.0, axis=(1, -2, 0.5)), {"half_angle": 2.0}),
        (AxisCone(f.tip, 1.0, axis=(0, 0, -1), direction=(1, 0, 0), relative_to=f.base), {}),
    ]


def _gaze_cone(robot: Robot) -> list[Declared]:
    f = FRAMES[robot.name]
    return [
        (GazeCone(f.tip, 0.4, apex=OFFSET), {}),
        (GazeCone(f.tip, 2.0, axis=(1, -2, 0.5), point_frame=f.base), {"half_angle": 2.0}),
        (GazeCone("world", 1.0, point_frame=f.tip), {}),
    ]


def _limit(robot: Robot) -> list[Declared]:
    f = FRAMES[robot.name]
    height = Expression(
        lambda kin, p: kin.position(f.tip)[2] - p["height"], units="m", inputs=(Input("height", unit="m", default=0.4),)
    )
    reference = PlaneReference(pole=(0.0, 1.0, 0.2), direction=(1.0, 0.0, 0.0))
    return [
        (Limit(EndEffector(f.tip), lower=-0.1, upper=np.arange(1, 7)), {}),
        (Limit(EndEffector(f.tip, kind="position", axes=f.base), lower=(-1, 0), only=("z", "x")), {}),
        (Limit(CenterOfMass(), upper=0.3, only="z"), {}),
        (Limit(Elbow(f.middle, offset=OFFSET), lower=-0.3, upper=0.3), {}),
        (Limit(height, lower=-0.3, upper=0.3), {}),
        (Limit(PitchPlane(*f.plane), lower=-0.5, upper=1.0), {"lower": [-0.5], "upper": [1.0]}),
        (Limit(PitchPlane(*f.plane, axis=f.axis, reference=reference), lower=-0.5), {}),
    ]


#: Class name -> declarations on a robot
FACTORIES: dict[str, Callable[[Robot], list[Declared]]] = {
    "WorkspaceBox": _box,
    "WorkspacePolyhedron": _polyhedron,
    "AxisCone": _axis_cone,
    "GazeCone": _gaze_cone,
    "Limit": _limit,
}
