"""A point stays within a cone that a frame carries."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca
import numpy as np

from wbc import validation
from wbc.robot import Robot
from wbc.symbolic import rotations as rot
from wbc.symbolic.kinematics import WORLD
from wbc.symbolic.tracer import Tracer
from wbc.tasks._cone import angle_between, checked_half_angle, cone_margin, half_angle_inputs, reach
from wbc.tasks._stereographic import Triple, triple
from wbc.tasks.base import Constraint, Input, Row, Values


@dataclass(frozen=True)
class GazeCone(Constraint):
    """A point stays within a cone of half angle alpha about an axis a, both fixed in a frame: in the field of view of a
    camera, or, with the cone in the world, within a funnel. One row:

        h = |r| (alpha - theta) (1 + min(theta / alpha, 1)) / 2 >= 0,      theta = angle between r and a       [m]

        r = R' (p_t + R_t point - p) - apex,        (R, p) the frame, (R_t, p_t) the frame of the point

    Near the cone h is the length of the arc, at the point's distance, that is left to the cone; beyond it exactly that
    arc, negative.

    Attributes:
        frame: name of the frame that carries the cone; ``"world"`` for one at rest.
        half_angle: first value of the input [rad].
        axis: a in ``frame``, of any length.
        apex: tip of the cone in ``frame`` [m].
        point_frame: name of the frame that carries the point; ``"world"`` for one that the input moves.
        point: first value of the input [m].

    Inputs:
        point: 3 numbers in the axes of ``point_frame`` [m].
        point_velocity: their rate [m/s]. Default 0.
        half_angle: alpha [rad].
        half_angle_rate: its rate [rad/s]. Default 0.

    What it cannot do: see what hides the point, keep it between two distances (``Limit`` of a ``Distance``), match a
    rectangular image, or turn the camera to the point (``LookAt``).

    Example:
        >>> import wbc
        >>> robot = wbc.robots.load("talos")
        >>> stack = wbc.Stack(robot, dt=0.005)
        >>> hand = "gripper_left_base_link"
        >>> stack.add(wbc.tasks.EndEffector(hand, kind="position"), name="hand")
        >>> view = wbc.tasks.GazeCone("head_2_link", half_angle=0.5, axis=(1, 0, 0), point_frame=hand)
        >>> stack.add(view, name="hand in view")
        >>> stack.add(wbc.tasks.JointLimits())

    Raises:
        UnknownNameError, ShapeError, NotFiniteError: a bad field.
        RangeError: an axis without length, a half angle out of range, or two frames that no joint moves against each
            other.
    """

    frame_fields: ClassVar[tuple[str, ...]] = ("frame", "point_frame")

    initial_only: ClassVar[tuple[str, ...]] = ("half_angle", "point")

    frame: str
    half_angle: float
    axis: Triple = (0.0, 0.0, 1.0)
    apex: Triple = (0.0, 0.0, 0.0)
    point_frame: str = WORLD
    point: Triple = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        object.__setattr__(self, "axis", triple(validation.unit_vector("GazeCone.axis", self.axis)))
        for name in ("apex", "point"):
            given = validation.real_array(f"GazeCone.{name}", getattr(self, name), (3,))
            object.__setattr__(self, name, triple(given))
        object.__setattr__(self, "half_angle", checked_half_angle("GazeCone.half_angle", self.half_angle))

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        return (
            Input("point", unit="m", size=3, default=self.point, rate="point_velocity"),
            Input("point_velocity", unit="m/s", size=3, default=np.zeros(3)),
            *half_angle_inputs(self.half_angle),
        )

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return (Row("cone", "m"),)

    def margins(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        point = kin.pose(self.point_frame).point(inputs["point"])
        seen = kin.pose(self.frame).inverse_point(point) - rot.constant(self.apex)
        seen, length = reach(self.axis, seen)
        return length * cone_margin(angle_between(self.axis, seen, length), inputs["half_angle"])
