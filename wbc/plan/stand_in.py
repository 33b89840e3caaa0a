"""The stack without the expressions of distances, which a planner measures itself: it compiles in no time."""

from __future__ import annotations

import copy
from dataclasses import dataclass, replace
from typing import ClassVar

import casadi as ca

from wbc.robot import Robot
from wbc.stack.declaration import Declaration
from wbc.symbolic.tracer import Tracer
from wbc.tasks import Obstacle, SelfCollision
from wbc.tasks.base import Constraint, Input, Row, Values

#: Constraints about bodies that keep apart
Apart = Obstacle | SelfCollision


@dataclass(frozen=True)
class MeasuredApart(Constraint):
    """The run-time values of an obstacle or of links that keep apart, with one row that always holds."""

    abstract: ClassVar[bool] = True

    item: Apart

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        return self.item.inputs(robot)

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return (Row("apart", "m"),)

    def margins(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        return ca.SX.ones(1)


def without_distances(stack: Declaration) -> Declaration:
    """A copy of a stack, in which bodies that keep apart have only their run-time values."""
    out = copy.copy(stack)
    out._entries = {
        entry.name: replace(entry, item=MeasuredApart(entry.item), added=entry.added or entry.item)
        if isinstance(entry.item, Apart)
        else entry
        for entry in stack.entries
    }
    return out
