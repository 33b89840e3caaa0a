"""Wrong formulas of the limits on frames and tasks; each is differentiated like the class it is made from."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import casadi as ca

from wbc.robot import Robot
from wbc.symbolic.tracer import Tracer
from wbc.tasks import AxisCone, GazeCone, Input, Limit, Values, WorkspaceBox, WorkspacePolyhedron


class OffsetForgotten(WorkspaceBox):
    """The origin of the frame for its point."""

    abstract: ClassVar[bool] = True

    def margins(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        return WorkspaceBox(self.frame, self.lower, self.upper, self.relative_to).margins(robot, kin, inputs)


class WallsAtRest(WorkspaceBox):
    """Moving walls that are taken to stand still."""

    abstract: ClassVar[bool] = True

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        return tuple(replace(declared, rate=None) for declared in super().inputs(robot))


class PlanesNotTurned(WorkspacePolyhedron):
    """n' (p - p_W) for n' R_W' (p - p_W)."""

    abstract: ClassVar[bool] = True

    def margins(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        walls = inputs["pose"]
        return super().margins(robot, kin, {**inputs, "pose": replace(walls, rotation=ca.SX.eye(3))})


class WholeOpening(AxisCone):
    """The whole opening of the cone for half of it."""

    abstract: ClassVar[bool] = True

    def margins(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        return super().margins(robot, kin, {**inputs, "half_angle": 2 * inputs["half_angle"]})


class ReferenceForgotten(AxisCone):
    """A direction in the world for one in the reference."""

    abstract: ClassVar[bool] = True

    def margins(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        return AxisCone(self.frame, self.half_angle, self.axis).margins(robot, kin, inputs)


class ApexForgotten(GazeCone):
    """A cone from the origin of the frame."""

    abstract: ClassVar[bool] = True

    def margins(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        return GazeCone(self.frame, self.half_angle, self.axis, point_frame=self.point_frame, point=self.point).margins(
            robot, kin, inputs
        )


class FirstRows(Limit):
    """The first rows of the task for those that are named."""

    abstract: ClassVar[bool] = True

    def margins(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        labels = [row.label for row in self.task.rows(robot)][: len(self.only or ())]
        return Limit(self.task, self.lower, self.upper, tuple(labels)).margins(robot, kin, inputs)


class SidesSwapped(Limit):
    """e + upper >= 0 and -lower - e >= 0: limits of the quantity's negative."""

    abstract: ClassVar[bool] = True

    def margins(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        turned = {**inputs, "lower": -inputs["upper"], "upper": -inputs["lower"]}
        return super().margins(robot, kin, turned)


#: Check that must fail -> class in the place of the right one
MUTATIONS: dict[str, type] = {
    "box": OffsetForgotten,
    "box on a moving frame": WallsAtRest,
    "walls": PlanesNotTurned,
    "cone": WholeOpening,
    "cone on a moving frame": ReferenceForgotten,
    "view": ApexForgotten,
    "limit of a place": FirstRows,
    "limit of a mass": SidesSwapped,
}
