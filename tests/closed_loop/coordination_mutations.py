"""Wrong formulas of hands, couplings, wheels and manipulability; each is differentiated like its class."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import casadi as ca

from wbc.robot import Robot
from wbc.symbolic.kinematics import Pose
from wbc.symbolic.tracer import Tracer
from wbc.tasks import Input, JointCoupling, Manipulability, RelativePose, Rolling, Rows, Values


class GraspTurnedBack(RelativePose):
    """R_t (at - p_t) for R_t' (at - p_t)."""

    abstract: ClassVar[bool] = True

    def error(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        target = inputs["target"]
        at = target.position + target.rotation @ target.rotation @ (inputs["at"] - target.position)
        return super().error(robot, kin, {**inputs, "at": at})


class WithinTheHand(RelativePose):
    """Axes of hand a for those midway: the same errors, not on a straight line."""

    abstract: ClassVar[bool] = True

    def error(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        return RelativePose(self.frame_a, self.frame_b, self.kind, axes=self.frame_a).error(robot, kin, inputs)


class TargetsWithoutRate(RelativePose):
    """A moving target that is taken to stand still."""

    abstract: ClassVar[bool] = True

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        target, *others = super().inputs(robot)
        return replace(target, rate=None), *others


class SignForgotten(JointCoupling):
    """sum |c_i| q_i."""

    abstract: ClassVar[bool] = True

    def error(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        positive = [{joint: abs(c) for joint, c in relation} for relation in self.coefficients]
        return JointCoupling(positive).error(robot, kin, inputs)


class RollersMirrored(Rolling):
    """The rollers of mecanum wheels the other way round."""

    abstract: ClassVar[bool] = True

    def velocity_rows(self, robot: Robot, kin: Tracer, inputs: Values, dt: ca.SX) -> Rows:
        wheels = tuple(replace(w, roller=-w.roller if w.roller else w.roller) for w in self.wheels)
        return Rolling(wheels, self.contact).velocity_rows(robot, kin, inputs, dt)


class ContactAbove(Rolling):
    """The top of the wheel for its lowest point."""

    abstract: ClassVar[bool] = True

    def velocity_rows(self, robot: Robot, kin: Tracer, inputs: Values, dt: ca.SX) -> Rows:
        ground: Pose = inputs["ground"]
        turned = Pose(ground.rotation @ ca.diag(ca.SX([1, -1, -1])), ground.position)
        return super().velocity_rows(robot, kin, {**inputs, "ground": turned}, dt)


class LengthForgotten(Manipulability):
    """Metres as pure numbers."""

    abstract: ClassVar[bool] = True

    def error(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        return Manipulability(self.frame, self.kind, relative_to=self.relative_to, length=1.0).error(robot, kin, inputs)


class SquareRootForgotten(Manipulability):
    """det(J J') for its square root."""

    abstract: ClassVar[bool] = True

    def error(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        error, target = super().error(robot, kin, inputs), inputs["target"]
        return error + ca.log(target) + error if self.form == "log" else (error + target) ** 2 - target


#: Every mutation of this module, and the classes that ``test_coordination`` runs
MUTATIONS: tuple[type, ...] = (
    GraspTurnedBack,
    WithinTheHand,
    TargetsWithoutRate,
    SignForgotten,
    RollersMirrored,
    ContactAbove,
    LengthForgotten,
    SquareRootForgotten,
)
CLASSES = {cls.__bases__[0] for cls in MUTATIONS}
