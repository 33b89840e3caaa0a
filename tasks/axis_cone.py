"""An axis of a frame stays within an angle of a direction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca
import numpy as np

from wbc import validation
from wbc.robot import Robot
from wbc.symbolic.kinematics import WORLD
from wbc.symbolic.tracer import Tracer
from wbc.tasks._cone import angle_between, checked_half_angle, cone_margin, half_angle_inputs
from wbc.tasks._stereographic import Triple, triple, unit
from wbc.tasks.base import Constraint, Input, Row, Values


@dataclass(frozen=True)
class AxisCone(Constraint):
    """An axis a, fixed in a frame R, stays within an angle alpha of a direction d in a reference frame b. One row:

        h = (alpha - theta) (1 + min(theta / alpha, 1)) / 2 >= 0,    theta = angle between R a and R_b d     [rad]

    On the cone h has slope -1 in theta: near it h is the angle that is left, beyond it exactly alpha - theta. The turn
    about the axis is free.

    Attributes:
        half_angle: first value of the input [rad].
        direction: first value of the input; ``(0, 0, 1)`` is up.
        others: as in :class:`wbc.tasks.AxisAlign`.

    Inputs:
        direction: d, 3 numbers of any length, kept at unit length, in the axes of the reference.
        direction_rate: derivative of the unit vector d [1/s]; w x d for a direction that turns at w. Default 0.
        half_angle: alpha [rad].
        half_angle_rate: its rate [rad/s]. Default 0.

    What it cannot do: hold an axis in a direction (``AxisAlign``, ``Hold``), or limit the point that the axis goes
    through (``GazeCone``). alpha must be large against what the axis turns in a tick.

    Example:
        >>> import wbc
        >>> robot = wbc.robots.load("panda")
        >>> stack = wbc.Stack(robot, dt=0.005)
        >>> stack.add(wbc.tasks.EndEffector("panda_hand_tcp"), name="hand")
        >>> stack.add(wbc.tasks.AxisCone("panda_hand_tcp", axis=(0, 0, -1), half_angle=0.2), name="cup")
        >>> stack.add(wbc.tasks.JointLimits())
        >>> controller = stack.compile(backend="vm")
        >>> controller["cup"].half_angle = 0.1

    Raises:
        UnknownNameError, ShapeError, NotFiniteError: a bad field.
        RangeError: a vector without length, a half angle out of range, or a frame that no joint moves.
    """

    frame_fields: ClassVar[tuple[str, ...]] = ("frame", "relative_to")

    initial_only: ClassVar[tuple[str, ...]] = ("half_angle", "direction")

    frame: str
    half_angle: float
    axis: Triple = (0.0, 0.0, 1.0)
    direction: Triple = (0.0, 0.0, 1.0)
    relative_to: str = WORLD

    def __post_init__(self) -> None:
        for name in ("axis", "direction"):
            vector = validation.unit_vector(f"AxisCone.{name}", getattr(self, name))
            object.__setattr__(self, name, triple(vector))
        object.__setattr__(self, "half_angle", checked_half_angle("AxisCone.half_angle", self.half_angle))

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        return (
            Input("direction", size=3, default=self.direction, rate="direction_rate", direction=True),
            Input("direction_rate", unit="1/s", size=3, default=np.zeros(3)),
            *half_angle_inputs(self.half_angle),
        )

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return (Row("cone", "rad"),)

    def margins(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        # A direction that its rate has moved on is a little longer than 1
        direction = unit(inputs["direction"])
        if self.relative_to != WORLD:
            direction = kin.rotation(self.relative_to) @ direction
        return cone_margin(angle_between(self.axis, kin.rotation(self.frame).T @ direction), inputs["half_angle"])
