"""Velocities stay small."""

from __future__ import annotations

from typing import ClassVar

import casadi as ca

from wbc.quick_dataclasses import dataclass
from wbc.robot import Robot
from wbc.symbolic.tracer import Tracer
from wbc.tasks.base import Row, Task, Values
from wbc.tasks.frames import checked_weights


@dataclass(frozen=True)
class Damping(Task):
    """Every velocity is to be zero, with a weight of its own:

        v_i = 0                             [rad/s or m/s, as each degree of freedom]

    There is no error to correct: e is zero, its rows are those of the identity, and ``gain`` has no effect. Rows have
    the labels ``robot.dof_names``, so a mask can spare one joint at run time.

    Attributes:
        weights: one number >= 0 a degree of freedom, the base's included, in the order of v; None: 1 each.

    Inputs:
        gain: has no effect.

    What it cannot do: bring the robot back anywhere (``Posture`` does) or smooth the command (acceleration limits do).
    It slows the other tasks of its level by about its weight over theirs.

    Example:
        >>> import wbc
        >>> stack = wbc.Stack(wbc.robots.load("panda"), dt=0.005)
        >>> stack.add(wbc.tasks.EndEffector("panda_hand_tcp"), name="hand")
        >>> stack.add(wbc.tasks.Damping(weights=(1, 1, 1, 1, 1, 1, 100)), name="spare the last joint", weight=1e-4)

    Raises:
        ShapeError, NotFiniteError, RangeError: on construction or in :meth:`validate`.
    """

    stands_in_world: ClassVar[bool] = False
    asks: ClassVar[bool] = False

    weights: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "weights", checked_weights("Damping.weights", self.weights))

    def validate(self, robot: Robot) -> None:
        checked_weights("Damping.weights", self.weights, robot.nv)

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return tuple(Row(n, u) for n, u in zip(robot.dof_names, robot.dof_units, strict=True))

    def error(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        return ca.SX.zeros(robot.nv)

    def jacobian(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        return ca.SX(ca.DM.eye(robot.nv))
