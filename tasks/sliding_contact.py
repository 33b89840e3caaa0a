"""A point that slides on a surface: a hand that wipes, a tool that grinds."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from wbc import validation
from wbc.robot import Robot
from wbc.symbolic.tracer import Tracer
from wbc.tasks._contact import Cone, Contact, Pressing, force_row
from wbc.tasks.base import Input, Row, Rows, Values


@dataclass(frozen=True)
class SlidingContact(Pressing, Contact):
    """The origin of a frame stays on a plane, by a force of known direction: along the normal n, the z axis of the
    target, and against the velocity s with which it slides in the plane, by kinetic friction,

        n'J_lin v = -gain n'(p - p_target)                                                       [m/s]
        force on the robot = f (n - friction s / sqrt(|s|^2 + slow^2)),   least <= f <= most     [N]

    The wrench has one number, f >= 0. Unlike the other contacts it leaves the motion in the plane free: tasks say
    where the frame goes, and the task ``"<contact> force"`` with how many newtons it presses.

    Attributes:
        friction: first value of the input.
        slow: first value of the input.
        others: as in :class:`wbc.tasks.SurfaceContact`.

    Inputs:
        target: pose in the world, of which the plane counts: its origin, and z out of the surface [m, rad]. Default:
            the pose of the frame at the first step.
        gain: how fast the distance from the plane decays [1/s]. Default 10.
        friction: coefficient of kinetic friction [1].
        slow: speed up to which friction grows with speed [m/s].
        others: as in :class:`wbc.tasks.SurfaceContact`.

    What it cannot do: stick: below ``slow`` friction is less than it may be, and at rest 0 (a point that sticks is a
    ``PointContact``). It does not follow a curved surface by itself.

    Example:
        >>> import wbc
        >>> stack = wbc.Stack(wbc.robots.load("panda"), dt=0.002)
        >>> stack.add(wbc.tasks.EndEffector("panda_hand_tcp"), name="hand")
        >>> stack.add(wbc.tasks.SlidingContact("panda_hand_tcp", friction=0.3), name="wiper")
        >>> controller = stack.compile(command="torque")
        >>> controller["wiper force"].target = [10.0]    # presses with 10 N
        >>> controller["wiper force"].weight = 10.0

    Raises:
        UnknownNameError, ShapeError, NotFiniteError, RangeError: on construction or in :meth:`validate`.
    """

    axes: ClassVar[tuple[int, ...]] = (2,)

    friction: float = 0.5
    least: float = 0.0
    most: float = math.inf
    slow: float = 0.01

    def __post_init__(self) -> None:
        super().__post_init__()
        validation.own_scalars(self, "slow", low=0.0, open_low=True)

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return (Row("normal", "m/s"),)

    def velocity_rows(self, robot: Robot, kin: Tracer, inputs: Values, dt: ca.SX) -> Rows:
        normal, wanted = inputs["target"].rotation[:, 2], -inputs["gain"] * self.residual(robot, kin, inputs)
        return Rows(normal.T @ kin.frame_jacobian(self.frame)[:3, :], wanted, wanted)

    def residual(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        target = inputs["target"]
        return ca.SX(ca.dot(target.rotation[:, 2], kin.position(self.frame) - target.position))

    def still(self, inputs: Values, rotation: ca.SX, twist: ca.SX) -> ca.SX:
        return ca.dot(inputs["target"].rotation[:, 2], twist[:3])

    def unit_wrenches(self, inputs: Values, rotation: ca.SX, twist: ca.SX) -> ca.SX:
        normal = inputs["target"].rotation[:, 2]
        slip = twist[:3] - normal * ca.dot(normal, twist[:3])
        force = normal - inputs["friction"] * slip / ca.sqrt(ca.sumsqr(slip) + inputs["slow"] ** 2)
        return ca.horzcat((rotation.T @ force).T, ca.SX(1, 3))

    def limits(self) -> tuple[Input, ...]:
        return (*super().limits(), Input("slow", unit="m/s", default=self.slow, low=1e-6))

    def cone_rows(self, robot: Robot) -> tuple[Row, ...]:
        return (force_row(robot, "normal"),)

    def cone(self, inputs: Values) -> Cone:
        return Cone(ca.SX.ones(1, 1), inputs["least"], inputs["most"])
