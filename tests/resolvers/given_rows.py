"""Stacks whose rows are numbers: what a resolver and a QP answer to the same matrices."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any, ClassVar

import casadi as ca
import numpy as np

import wbc
from wbc.tasks.base import Input, Row, Task


@dataclass(frozen=True)
class GivenRows(Task):
    """A v = speed with A [count, nv] and speed given at run time."""

    abstract: ClassVar[bool] = True
    count: int = 1

    def inputs(self, robot: Any) -> tuple[Input, ...]:
        return (
            Input("matrix", size=self.count * robot.nv, default=np.zeros(self.count * robot.nv)),
            Input("offset", size=self.count, default=np.zeros(self.count), rate="speed"),
            Input("speed", size=self.count, default=np.zeros(self.count)),
        )

    def rows(self, robot: Any) -> tuple[Row, ...]:
        return tuple(Row(str(k), "rad") for k in range(self.count))

    def error(self, robot: Any, kin: Any, inputs: Any) -> ca.SX:
        return ca.SX(-inputs["offset"])

    def jacobian(self, robot: Any, kin: Any, inputs: Any) -> ca.SX:
        return ca.reshape(inputs["matrix"], self.count, robot.nv)


@cache
def controller(joints: int, rows: tuple[int, ...]) -> Any:
    """A stack on a chain of joints, with so many rows at each level, and the whole of v at the last."""
    robot = wbc.robots.from_dh([wbc.robots.DHRow(a=0.1, alpha=0.3 * k) for k in range(joints)])
    stack = wbc.Stack(robot, dt=0.01, damping=1e-12, length=1.0, calm=False)
    for level, count in enumerate(rows):
        stack.add(GivenRows(count), name=f"level{level}", level=level)
    return stack.compile(backend="vm")


def stack_rates(*levels: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """v of strict levels (matrix, speed), the first never disturbed by the next."""
    made = controller(levels[0][0].shape[1], tuple(len(speed) for _, speed in levels))
    made.reset(np.zeros(levels[0][0].shape[1]))
    for k, (matrix, speed) in enumerate(levels):
        made[f"level{k}"].matrix = matrix.ravel(order="F")
        made[f"level{k}"].speed = speed
    return made.step(np.zeros(levels[0][0].shape[1])).v
