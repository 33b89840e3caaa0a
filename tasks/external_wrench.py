"""A push, a payload, or what a force sensor measures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca
import numpy as np

from wbc.robot import Robot
from wbc.symbolic.kinematics import Kinematics
from wbc.tasks._load import Load
from wbc.tasks.base import Input, Values


@dataclass(frozen=True)
class ExternalWrench(Load):
    """A known wrench on a frame is part of the dynamics: w = (f; m), along the axes of the world and about the frame's
    origin,

        M a + h = tau + J'w,        J = (J_lin; J_ang), 6 x nv

    so that the torques bear it: a payload that the description does not have, a push that a force sensor measures,
    what a tool is known to do. Only a stack that commands torques can have it.

    Attributes:
        frame: name of the frame.

    Inputs:
        wrench: on the robot, force and moment [N, N m]. Default 0.

    What it cannot do: estimate: what is written is taken as true. A wrench that a contact of the stack bears would be
    counted twice. A payload's inertia belongs into the description.

    Example:
        >>> import wbc
        >>> stack = wbc.Stack(wbc.robots.load("panda"), dt=0.002).add(wbc.tasks.Posture())
        >>> stack.add(wbc.tasks.ExternalWrench("panda_hand_tcp"), name="payload")
        >>> controller = stack.compile(command="torque")
        >>> controller["payload"].wrench = [0.0, 0.0, -20.0, 0.0, 0.0, 0.0]

    Raises:
        UnknownNameError, RangeError: in :meth:`validate`: no such frame, or one that no joint moves.
    """

    frame_fields: ClassVar[tuple[str, ...]] = ("frame",)

    frame: str

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        return (Input("wrench", unit="N, N m", size=6, default=np.zeros(6)),)

    def load(self, robot: Robot, kin: Kinematics, inputs: Values) -> ca.SX:
        return ca.SX(kin.jacobian(self.frame).T @ inputs["wrench"])
