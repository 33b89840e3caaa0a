"""Forces on the robot that are known: they enter the dynamics and leave no choice."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from wbc.robot import Robot
from wbc.symbolic.kinematics import Kinematics
from wbc.symbolic.tracer import Tracer
from wbc.tasks.base import Command, Constraint, Row, Rows, Values


@dataclass(frozen=True)
class Load(Constraint):
    """A generalised force L in  M a + h = tau + J'w + L. It has no rows; a disabled one is 0."""

    abstract: ClassVar[bool] = True
    equality: ClassVar[bool] = True
    stands_in_world: ClassVar[bool] = False

    def refusal(self, robot: Robot, command: Command) -> str:
        return "" if command == "torque" else 'is a force: compile with command="torque"'

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return ()

    def velocity_rows(self, robot: Robot, kin: Tracer, inputs: Values, dt: ca.SX) -> Rows:
        return Rows(ca.SX(0, robot.nv), ca.SX(0, 1), ca.SX(0, 1))

    def load(self, robot: Robot, kin: Kinematics, inputs: Values) -> ca.SX:
        raise TypeError(f"{type(self).__name__} declares no load")
