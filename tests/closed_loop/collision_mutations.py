"""Wrong formulas of collision constraints whose derivatives are right."""

from __future__ import annotations

from typing import Any, ClassVar
from unittest import mock

import casadi as ca

from wbc.robot import Robot
from wbc.shapes import Box, Capsule
from wbc.symbolic.tracer import Tracer
from wbc.tasks import Obstacle, SelfCollision, Values, _bodies, _gap


class WholeSides(Obstacle):
    """The sides of a box taken for half of them."""

    abstract: ClassVar[bool] = True

    def margins(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        right = _gap.out_of_box

        def wrong(point: ca.SX, box: Box) -> tuple[ca.SX, ca.SX]:
            x, y, z = box.size
            return right(point, Box((2 * x, 2 * y, 2 * z)))

        with mock.patch.object(_gap, "out_of_box", wrong):
            return super().margins(robot, kin, inputs)


class LengthForgotten(Obstacle):
    """The middle of a cylinder's axis for all of it."""

    abstract: ClassVar[bool] = True

    def margins(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        def wrong(point: ca.SX, cylinder: Any) -> tuple[ca.SX, ca.SX]:
            distance = ca.norm_2(point)
            return distance - cylinder.radius, point / distance

        with mock.patch.object(_gap, "out_of_cylinder", wrong):
            return super().margins(robot, kin, inputs)


class LinesForSegments(Obstacle):
    """Cores of capsules without an end."""

    abstract: ClassVar[bool] = True

    def margins(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        with mock.patch.object(_gap, "clamp", lambda x, half: x):
            return super().margins(robot, kin, inputs)


class MarginForgotten(Obstacle):
    """Sensed pairs may come to touch."""

    abstract: ClassVar[bool] = True

    def margins(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        with mock.patch.object(_bodies, "sensed_margins", lambda inputs, count: inputs["distance"]):
            return super().margins(robot, kin, inputs)


class OneRadius(SelfCollision):
    """The radius of the second shape left out."""

    abstract: ClassVar[bool] = True

    def margins(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        def wrong(first: Any, second: Any) -> list[Any]:
            shape = second.shape
            thin = Capsule(0.0, shape.length) if isinstance(shape, Capsule) else type(shape)(0.0)
            return right(first, _gap.Placed(thin, second.frame, second.pose, second.placement))

        right = _gap.gaps
        with mock.patch.object(_gap, "gaps", wrong):
            return super().margins(robot, kin, inputs)


class MarginAdded(SelfCollision):
    """h = distance + margin for distance - margin."""

    abstract: ClassVar[bool] = True

    def margins(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        return super().margins(robot, kin, {**inputs, "margin": -inputs["margin"]})


#: Item -> class in the place of the right one
MUTATIONS: dict[str, type] = {
    "crate": WholeSides,
    "can": LengthForgotten,
    "rod": LinesForSegments,
    "rock": MarginForgotten,
    "self": OneRadius,
    "self, sensed": MarginAdded,
}
