"""Declarations of every constraint on any robot, for tests that walk the registry."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from tests.constraints.items_collisions import FACTORIES as COLLISIONS
from tests.constraints.items_forces import FACTORIES as FORCES
from tests.constraints.robots import with_test_shapes
from wbc.robot import Robot
from wbc.tasks.base import Item
from wbc.tasks.fixed import Fixed
from wbc.tasks.frame_velocity_limit import FrameVelocityLimit
from wbc.tasks.hold import Hold
from wbc.tasks.joint_limits import JointLimits
from wbc.tasks.mechanism import Mechanism

#: An item and the run-time values that differ from its defaults
Declared = tuple[Item, dict[str, Any]]


def shaped(robot: Robot) -> Robot:
    """The robot, with link shapes for the test where it has none; ``Obstacle`` needs them."""
    return robot if any(robot.shapes.values()) else with_test_shapes(robot)


def tip(robot: Robot) -> str:
    """A frame at the end of the longest chain."""
    depth = [0] * robot.model.njoints
    for j in range(1, robot.model.njoints):
        depth[j] = depth[robot.model.parents[j]] + 1
    last = max(range(robot.model.njoints), key=depth.__getitem__)
    return str(next(f.name for f in robot.model.frames if f.parentJoint == last))


def first(robot: Robot) -> str:
    """A frame on the first moving body."""
    return str(next(f.name for f in robot.model.frames if f.parentJoint == 1))


def _joint_limits(robot: Robot) -> list[Declared]:
    return [
        (JointLimits(), {}),
        (JointLimits(margin=1e-3), {"velocity_scale": 0.5, "return_rate": 2.0}),
        (JointLimits(shortest_dt=0.002, joints=robot.joint_names[-1]), {}),
        (JointLimits(position=False), {}),
        (JointLimits(acceleration=False), {}),
    ]


def _frame_velocity_limit(robot: Robot) -> list[Declared]:
    end = tip(robot)
    items = [
        (FrameVelocityLimit(end, linear=0.5, angular=1.0), {}),
        (FrameVelocityLimit(end, linear=(0.1, 0.2, float("inf")), axes=end), {"linear": [0.3, 0.0]}),
    ]
    if robot.model.njoints > 2:
        items.append((FrameVelocityLimit(end, linear=0.5, angular=1.0, relative_to=first(robot)), {}))
    return items


def _hold(robot: Robot) -> list[Declared]:
    return [(Hold(tip(robot), kind), {"gain": 3.0}) for kind in ("pose", "position", "orientation", "axis")]


def _fixed(robot: Robot) -> list[Declared]:
    return [(Fixed(robot.joint_names[-1]), {}), (Fixed(robot.joint_names[:2], acceleration=False), {})]


def _mechanism(robot: Robot) -> list[Declared]:
    return [(Mechanism(), {"gain": 3.0})]


#: Class name -> declarations on a robot. Obstacles need ``shaped(robot)``.
FACTORIES: dict[str, Callable[[Robot], list[Declared]]] = {
    "JointLimits": _joint_limits,
    "FrameVelocityLimit": _frame_velocity_limit,
    "Hold": _hold,
    "Fixed": _fixed,
    "Mechanism": _mechanism,
    **COLLISIONS,
    **FORCES,
}
