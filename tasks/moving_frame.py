"""A reference frame outside the robot that moves: a table, a ship's deck, a satellite."""

from __future__ import annotations

from typing import ClassVar

import casadi as ca
import numpy as np

from wbc import validation
from wbc.multibody import pin
from wbc.quick_dataclasses import dataclass
from wbc.robot import Robot
from wbc.symbolic.tracer import Tracer
from wbc.tasks.base import Constraint, Input, Row, Rows, Values


@dataclass(frozen=True)
class MovingFrame(Constraint):
    """A frame T outside the robot, whose pose, twist and acceleration are run-time values, for other items to be stated
    in. It has no rows.

        stack.add(MovingFrame(), name="table")
        stack.add(EndEffector("tool0", relative_to="table"), name="hand")
        stack.add(Obstacle(Box((0.1, 0.1, 0.3))), name="post", relative_to="table")

    For such an item T takes the place of the world: targets, poses, points, planes and directions are given in T, and
    ``"world"`` is its name. Whatever the item says of poses it says of T^-1 (R, p), and of velocities

        R_T' (J v - (v_T + w_T x (p - p_T); w_T)),

    so T's twist is fed forward exactly, and a robot and an object that move together need no command.
    Within a tick the twist changes: for velocities its mean over the tick counts, twist + acceleration dt / 2, and
    every row is its mean over what robot and frame do meanwhile, docs/moving_frames.md. Of accelerations and torques
    both are fed forward as they are, with the terms of Coriolis and of the centrifuge.

    Attributes:
        pose: first value of the input; None: it must be set before the first step.

    Inputs:
        pose: of the frame in the world [m, rad].
        twist: velocity of its origin and angular velocity, world axes [m/s, rad/s]. Default 0.
        acceleration: rate of ``twist`` [m/s^2, rad/s^2]. Default 0.

    Raises:
        ShapeError, NotFiniteError, RotationError: a bad pose.
    """

    # declared by the stack's user, but no part of the vocabulary of rows
    abstract: ClassVar[bool] = True
    equality: ClassVar[bool] = True
    stands_in_world: ClassVar[bool] = False
    initial_only: ClassVar[tuple[str, ...]] = ("pose",)

    pose: pin.SE3 | None = None

    def __post_init__(self) -> None:
        if self.pose is not None:
            object.__setattr__(self, "pose", validation.pose("MovingFrame.pose", self.pose))

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        return (
            Input("pose", "pose", unit="m, rad", default=self.pose, rate="twist"),
            Input("twist", unit="m/s, rad/s", size=6, default=np.zeros(6), rate="acceleration"),
            Input("acceleration", unit="m/s^2, rad/s^2", size=6, default=np.zeros(6)),
        )

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return ()

    def velocity_rows(self, robot: Robot, kin: Tracer, inputs: Values, dt: ca.SX) -> Rows:
        return Rows(ca.SX(0, robot.nv), ca.SX(0, 1), ca.SX(0, 1))
