"""The direction of a task's command, kept: what ``stack.add(task, scaled=True)`` adds below the task."""

from __future__ import annotations

from typing import ClassVar

import casadi as ca

from wbc.quick_dataclasses import dataclass
from wbc.robot import Robot
from wbc.symbolic.tracer import Tracer
from wbc.tasks.base import Command, Constraint, Row, Rows, Task, Values

#: Price of a task's direction against the task's own weight: what is off the line is this many times as expensive as
#: what is missing along it
DIRECTION_PRICE = 1e6


@dataclass(frozen=True)
class Direction(Constraint):
    """J v = lambda w with one number lambda in [0, 1], for the rates w = -gain e - de/dt that a task asks for.

    The tick has the variable nu = lambda |w| for it, and the rows

        factor_i (J_i v - nu w_i / |w|) = 0        for the task's rows i      [unit of e per second]
        0 <= nu <= |w|

    of which the first are soft at the price 1e6 times the task's weight. Fading and the run-time mask are the task's.

    Attributes:
        of: the task's name in the stack. task: the task.
    """

    # made by the stack, so no part of the vocabulary
    abstract: ClassVar[bool] = True
    equality: ClassVar[bool] = True

    of: str
    task: Task

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        own = self.task.rows(robot)
        rates = [Row(r.label, r.unit if r.unit.endswith("/s") else f"{r.unit or '1'}/s") for r in own]
        return (*rates, Row("scale", ""))

    def refusal(self, robot: Robot, command: Command) -> str:
        return "" if command == "velocity" else "keeps the direction of a velocity; leave scaled=True out"

    def velocity_rows(self, robot: Robot, kin: Tracer, inputs: Values, dt: ca.SX) -> Rows | None:
        return None
