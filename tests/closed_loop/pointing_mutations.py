"""Wrong formulas of axes, cameras, distances and momentum, each differentiated like the class it is made from."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar
from unittest import mock

import casadi as ca

from wbc.robot import Robot
from wbc.symbolic.dynamics import Centroidal, Dynamics
from wbc.symbolic.tracer import Tracer
from wbc.tasks import AxisAlign, Distance, Input, LookAt, Momentum, Values, axis_align, look_at


class ReferenceForgotten(AxisAlign):
    """R d for R_b d."""

    abstract: ClassVar[bool] = True

    def error(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        return AxisAlign(self.frame, self.axis, around=self.around).error(robot, kin, inputs)


class SineForAngle(AxisAlign):
    """d x a for theta n: right near 0 only."""

    abstract: ClassVar[bool] = True

    def error(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        with mock.patch.object(axis_align, "shortest_turn", lambda d: ca.vertcat(d[1], -d[0])):
            return super().error(robot, kin, inputs)


class CameraInTheOrigin(LookAt):
    """c = p for c = p + R offset."""

    abstract: ClassVar[bool] = True

    def error(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        return LookAt(self.frame, self.axis, around=self.around).error(robot, kin, inputs)


class CameraOnlyTurns(LookAt):
    """The rows w of the angular velocity alone, as if camera, reference and target stood still."""

    abstract: ClassVar[bool] = True

    def error(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        with mock.patch.object(look_at.ca, "cross", return_value=ca.SX(3, 1)):
            return super().error(robot, kin, inputs)


class WrongLever(Distance):
    """p - R offset for p + R offset."""

    abstract: ClassVar[bool] = True

    def error(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        x, y, z = self.offset
        return Distance(self.frame, self.other, offset=(-x, -y, -z)).error(robot, kin, inputs)


class PointWithoutRate(Distance):
    """A moving point that is taken to stand still."""

    abstract: ClassVar[bool] = True

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        return tuple(replace(d, rate=None) if d.name == "point" else d for d in super().inputs(robot))


class AboutTheOrigin(Momentum):
    """Angular momentum about the origin of the world for that about the centre of mass."""

    abstract: ClassVar[bool] = True

    def jacobian(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        matrix = Centroidal(Dynamics(kin.kinematics)).matrix
        linear = matrix[:3, :]
        shifted = matrix[3:, :] + ca.skew(kin.kinematics.center_of_mass) @ linear
        return ca.vertcat(linear, shifted)[self._rows, :]


class LagAddedTwice(Momentum):
    """A v = target + 2 gain lag."""

    abstract: ClassVar[bool] = True

    def error(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        return super().error(robot, kin, {**inputs, "lag": inputs["lag"] + kin.held(inputs["lag"])})


#: Check that must fail -> class in the place of the right one
MUTATIONS: dict[str, type] = {
    "axis: opposite": SineForAngle,
    "axis from a moving frame: decay": ReferenceForgotten,
    "camera: decay": CameraInTheOrigin,
    "camera from a moving frame: tracking": CameraOnlyTurns,
    "distance from a moving point": PointWithoutRate,
    "distance of frames: decay": WrongLever,
    "angular momentum": AboutTheOrigin,
    "linear momentum": LagAddedTwice,
}
