"""Declarations of the tasks that point, keep a distance or move the mass, and what their rows are by Pinocchio."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin

from tests.tasks.robots import FRAMES, placement, velocity
from wbc.robot import Robot
from wbc.tasks import AxisAlign, Distance, Item, LookAt, Momentum

Declared = tuple[Item, dict[str, Any]]

AXIS, AROUND, OFFSET, POINT = (0.0, -1.0, 2.0), (1.0, 1.0, 0.0), (0.1, -0.2, 0.05), (0.05, 0.1, -0.1)

#: What the cameras look at, in their reference
SEEN = (0.3, -1.5, 0.7)


def _axis_align(robot: Robot) -> list[Declared]:
    f = FRAMES[robot.name]
    items = [
        AxisAlign(f.tip),
        AxisAlign(f.tip, axis=AXIS, around=AROUND),
        AxisAlign(f.tip, axis=AXIS, around=AROUND, relative_to=f.base),
    ]
    return [(item, {}) for item in items]


def _look_at(robot: Robot) -> list[Declared]:
    f = FRAMES[robot.name]
    items = [
        LookAt(f.tip),
        LookAt(f.tip, axis=AXIS, around=AROUND, offset=OFFSET),
        LookAt(f.tip, axis=AXIS, around=AROUND, offset=OFFSET, relative_to=f.base),
    ]
    return [(item, {"target": np.array(SEEN)}) for item in items]


def _distance(robot: Robot) -> list[Declared]:
    f = FRAMES[robot.name]
    items = [
        Distance(f.tip),
        Distance(f.middle, offset=OFFSET),
        Distance(f.tip, f.base, offset=OFFSET),
    ]
    return [(item, {}) for item in items]


def _momentum(robot: Robot) -> list[Declared]:
    return [(Momentum(), {}), (Momentum("linear", weights=(1, 1, 0)), {}), (Momentum("angular"), {})]


def axes(item: AxisAlign | LookAt) -> np.ndarray:
    """Columns b1, b2 and the axis, in the frame; for a z axis without ``around`` they are those of the frame."""
    if item.around is None:
        assert item.axis == (0.0, 0.0, 1.0)
        return np.eye(3)
    axis = np.array(AXIS) / np.linalg.norm(AXIS)
    across = np.array(AROUND) - axis * (axis @ AROUND)
    first = across / np.linalg.norm(across)
    return np.column_stack([first, np.cross(axis, first), axis])


def line_of_sight(item: LookAt, robot: Robot, q: np.ndarray, target: Any) -> np.ndarray:
    """From the camera to the target, in the world [m]."""
    camera = placement(robot, item.frame, q).act(np.array(item.offset))
    return np.array(placement(robot, item.relative_to, q).act(np.array(target)) - camera)


def spin_across(item: AxisAlign, robot: Robot, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """The relative angular velocity about b1 and b2."""
    spin = velocity(robot, item.frame, q, v)[3:] - velocity(robot, item.relative_to, q, v)[3:]
    return (placement(robot, item.frame, q).rotation @ axes(item)).T[:2] @ spin


def spin_past_sight(item: LookAt, robot: Robot, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """The angular velocity about b1 and b2 less that of the line of sight, from its values 4e-6 s apart."""
    step = 2e-6
    before, after = (line_of_sight(item, robot, pin.integrate(robot.model, q, t * v), SEEN) for t in (-step, step))
    here = line_of_sight(item, robot, q, SEEN)
    turning = np.cross(here, (after - before) / (2 * step)) / (here @ here)
    spin = velocity(robot, item.frame, q, v)[3:] - turning
    return (placement(robot, item.frame, q).rotation @ axes(item)).T[:2] @ spin


def momentum(item: Momentum, robot: Robot, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    h = np.array(pin.computeCentroidalMomentum(robot.model, robot.model.createData(), q, v).vector)
    return {"both": h, "linear": h[:3], "angular": h[3:]}[item.kind]


#: Class name -> declarations on a robot.
FACTORIES: dict[str, Callable[[Robot], list[Declared]]] = {
    "AxisAlign": _axis_align,
    "LookAt": _look_at,
    "Distance": _distance,
    "Momentum": _momentum,
}

#: What the rows times v are, where they are not the derivative of a value.
RATES: dict[type, Callable[..., np.ndarray]] = {
    AxisAlign: spin_across,
    LookAt: spin_past_sight,
    Momentum: momentum,
}
