"""Wrong formulas whose derivatives are right: each is differentiated like the class it is made from."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, ClassVar
from unittest import mock

import casadi as ca
import numpy as np

from wbc.robot import Robot
from wbc.symbolic.kinematics import Pose
from wbc.symbolic.tracer import Tracer
from wbc.tasks import (
    Bounds,
    CenterOfMass,
    Damping,
    Elbow,
    EndEffector,
    Expression,
    Fixed,
    FrameVelocityLimit,
    Hold,
    Input,
    JointLimits,
    Mechanism,
    Obstacle,
    PitchPlane,
    PitchPlaneLimit,
    Posture,
    Rows,
    Values,
    _stereographic,
    hold,
    joint_limits,
)


class TargetTurnedBack(EndEffector):
    """log3(R_d R) for log3(R_d' R)."""

    abstract: ClassVar[bool] = True

    def error(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        target = inputs["target"]
        return super().error(robot, kin, {**inputs, "target": Pose(target.rotation.T, target.position)})


class WorldAxes(EndEffector):
    """Rows in the axes of the world for those of the frame."""

    abstract: ClassVar[bool] = True

    def error(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        return EndEffector(self.frame, kind=self.kind, axes="world").error(robot, kin, inputs)


class ReferenceNotTurned(EndEffector):
    """p - p_b - p_t for R_b' (p - p_b) - p_t."""

    abstract: ClassVar[bool] = True

    def error(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        return kin.position(self.frame) - kin.position(self.relative_to) - inputs["target"]


class ReferenceForgotten(EndEffector):
    """R_d = R_t for R_b R_t."""

    abstract: ClassVar[bool] = True

    def error(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        return kin.rotation_error(self.frame, "world", inputs["target"])


class WrongLever(Elbow):
    """p - R offset for p + R offset."""

    abstract: ClassVar[bool] = True

    def error(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        x, y, z = self.offset
        return Elbow(self.frame, (-x, -y, -z), self.axes).error(robot, kin, inputs)


class TargetWithoutRate(Elbow):
    """A moving target that is taken to stand still."""

    abstract: ClassVar[bool] = True

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        target, feedforward = super().inputs(robot)
        return replace(target, rate=None), feedforward


class EndsSwapped(PitchPlane):
    """The line from the wrist to the shoulder."""

    abstract: ClassVar[bool] = True

    def error(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        return PitchPlane(self.wrist, self.elbow, self.shoulder).error(robot, kin, inputs)


class ConventionalReference(PitchPlane):
    """The angle from the plane through the line and the pole, for the stereographic one."""

    abstract: ClassVar[bool] = True

    def error(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        def conventional(line: ca.SX, direction: ca.SX, reference: Any) -> tuple[ca.SX, ca.SX]:
            normal = ca.cross(line, ca.DM(reference.pole))
            return ca.dot(ca.cross(normal, line), direction), ca.dot(normal, direction)

        with mock.patch.object(_stereographic, "coordinates", conventional):
            return super().error(robot, kin, inputs)


class LineNotUnit(PitchPlane):
    """r.omega for (r / |r|).omega."""

    abstract: ClassVar[bool] = True

    def jacobian(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX | None:
        with mock.patch.object(_stereographic, "unit", lambda vector: vector):
            return super().jacobian(robot, kin, inputs)


class NeighboursTarget(Posture):
    """Each joint is sent to the target of the next; the joints before it count."""

    abstract: ClassVar[bool] = True

    def error(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        target = inputs["target"]
        return super().error(robot, kin, {**inputs, "target": ca.vertcat(target[1:], target[0])})


class WeightsReversed(Damping):
    """Weights in the opposite order."""

    abstract: ClassVar[bool] = True

    def row_weights(self, robot: Robot) -> np.ndarray:
        return super().row_weights(robot)[::-1].copy()


class LeversForgotten(CenterOfMass):
    """Every body's mass in the origin of its joint."""

    abstract: ClassVar[bool] = True

    def error(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        masses = [float(inertia.mass) for inertia in robot.model.inertias]
        points = [kin.kinematics.joint_pose(j).position * masses[j] for j in range(1, robot.model.njoints)]
        return sum(points[1:], points[0]) / sum(masses[1:]) - inputs["target"]


class InputIgnored(Expression):
    """The function sees the default of its input, whatever was set."""

    abstract: ClassVar[bool] = True

    def error(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        return super().error(robot, kin, {d.name: ca.SX(ca.DM(d.default)) for d in self.declared})


class TextbookBraking(JointLimits):
    """v <= sqrt(2 a d), right in continuous time only."""

    abstract: ClassVar[bool] = True

    def bounds(self, robot: Robot, kin: Tracer, inputs: Values, dt: ca.SX) -> Bounds:
        def textbook(distance: ca.SX, acceleration: float, dt: ca.SX, shortest: float | None) -> ca.SX:
            return ca.sqrt(2 * acceleration * distance)

        with mock.patch.object(joint_limits, "braking_bound", textbook):
            return super().bounds(robot, kin, inputs, dt)


class RadiusForgotten(Obstacle):
    """The distance to the centre of a ball for that to its surface."""

    abstract: ClassVar[bool] = True

    def margins(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        return super().margins(robot, kin, inputs) + self.shape.radius


class ObstacleWithoutRate(Obstacle):
    """A moving obstacle that is taken to stand still."""

    abstract: ClassVar[bool] = True

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        pose, *others = super().inputs(robot)
        return replace(pose, rate=None), *others


class AxesTurnedBack(FrameVelocityLimit):
    """C J v for C' J v."""

    abstract: ClassVar[bool] = True

    def velocity_rows(self, robot: Robot, kin: Tracer, inputs: Values, dt: ca.SX) -> Rows:
        right = Tracer.rotation
        with mock.patch.object(Tracer, "rotation", lambda kin, frame: right(kin, frame).T):
            return super().velocity_rows(robot, kin, inputs, dt)


class SpinForgotten(FrameVelocityLimit):
    """J_lin - J_lin,r without the part - w_r x (p - p_r)."""

    abstract: ClassVar[bool] = True

    def velocity_rows(self, robot: Robot, kin: Tracer, inputs: Values, dt: ca.SX) -> Rows:
        with mock.patch.object(ca, "skew", return_value=ca.SX(3, 3)):
            return super().velocity_rows(robot, kin, inputs, dt)


class TurnedTheOtherWay(Hold):
    """log3(R_target R') for log3(R R_target')."""

    abstract: ClassVar[bool] = True

    def velocity_rows(self, robot: Robot, kin: Tracer, inputs: Values, dt: ca.SX) -> Rows:
        right = hold.rot.log3
        with mock.patch.object(hold.rot, "log3", lambda rotation: right(rotation.T)):
            return super().velocity_rows(robot, kin, inputs, dt)


class NextJointFixed(Fixed):
    """The joint after the one that is named."""

    abstract: ClassVar[bool] = True

    def bounds(self, robot: Robot, kin: Tracer, inputs: Values, dt: ca.SX) -> Bounds:
        names = robot.joint_names
        return Fixed(names[names.index(self.joints[0]) + 1]).bounds(robot, kin, inputs, dt)


class MiddleForgotten(PitchPlaneLimit):
    """|psi| <= (upper - lower) / 2, the range moved to zero."""

    abstract: ClassVar[bool] = True

    def margins(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        half = (self.upper - self.lower) / 2
        off = self._fading(kin, with_reference=True) * self._turned(kin, ca.SX(0))
        return ca.vertcat(half + off, half - off)


class RatioTurned(Mechanism):
    """v_follower + ratio v_leader, and the same of q."""

    abstract: ClassVar[bool] = True

    def velocity_rows(self, robot: Robot, kin: Tracer, inputs: Values, dt: ca.SX) -> Rows:
        turned = tuple(replace(c, ratio=-c.ratio) for c in robot.couplings)
        return super().velocity_rows(replace(robot, couplings=turned), kin, inputs, dt)


#: Check that must fail -> class in the place of the right one
TASKS: dict[str, type] = {
    "hand: decay": TargetTurnedBack,
    "hand, turn about z free, own axes: decay": WorldAxes,
    "hand's place from a moving frame: decay": ReferenceNotTurned,
    "hand's turn from a moving frame: decay": ReferenceForgotten,
    "elbow: decay": WrongLever,
    "elbow, own axes: tracking": TargetWithoutRate,
    "plane of three points: decay": EndsSwapped,
    "plane across an axis: decay": ConventionalReference,
    "posture: decay": NeighboursTarget,
    "centre of mass: decay": LeversForgotten,
    "expression: decay": InputIgnored,
    "damping": WeightsReversed,
    "rate of the plane": LineNotUnit,
}
CONSTRAINTS: dict[str, type] = {
    "limits": TextbookBraking,
    "ball, at rest": RadiusForgotten,
    "wall, moving": ObstacleWithoutRate,
    "speed, own axes": AxesTurnedBack,
    "speed from a moving frame": SpinForgotten,
    "hold": TurnedTheOtherWay,
    "fixed": NextJointFixed,
    "plane limit": MiddleForgotten,
}
MECHANISM: dict[str, type] = {"mechanism": RatioTurned}
