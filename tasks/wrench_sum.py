"""What the wrenches of several contacts add up to."""

from __future__ import annotations

from typing import ClassVar

import casadi as ca
import numpy as np

from wbc.quick_dataclasses import dataclass
from wbc.robot import Robot
from wbc.symbolic.tracer import Tracer
from wbc.tasks._contact import WRENCH_LABELS, WRENCH_UNITS, force_row
from wbc.tasks._selection import selection
from wbc.tasks.base import Command, Constraint, Input, Row, Rows, SacrificeOrder, Values


@dataclass(frozen=True)
class WrenchSum(Constraint):
    """The wrenches of some contacts on the robot, in the axes of the world and about one point, add up to a wrench:

        sum_i (f_i; m_i + (p_i - point) x f_i) = target        [N; N m]

    p_i is the origin of the frame of contact i. Of all contacts it is the rate of the robot's momentum about the point
    less the moment of its weight; of two hands what they carry together: a box of mass m that accelerates at a asks for
    the force m (g - a). With ``soft=`` it is a task with a price. Only a stack that commands torques can have it.

    Attributes:
        contacts: names of contacts of the stack.

    Inputs:
        target: force and moment on the robot [N, N m]. Default 0.
        point: about which moments are taken, in the world [m]. Default: the origin.

    What it cannot do: know the body that the contacts are with: its weight, and what accelerates it, are in
    ``target``, and a body that swings freely between hands is not in the dynamics. A contact that is not enabled
    counts as 0.

    Example:
        >>> import wbc
        >>> stack = wbc.Stack(wbc.robots.load("talos"), dt=0.002)
        >>> for side in ("left", "right"):
        ...     foot = wbc.tasks.SurfaceContact(f"{side}_sole_link", half_lengths=(0.1, 0.06))
        ...     stack.add(foot, name=f"{side} foot")
        >>> stack.add(wbc.tasks.WrenchSum(("left foot", "right foot")), name="sum")
        >>> stack.add(wbc.tasks.Posture())

    Raises:
        ShapeError, DuplicateNameError: on construction. UnknownNameError: no such contact, when the stack is compiled.
    """

    order: ClassVar[SacrificeOrder] = SacrificeOrder.HOLD
    stands_in_world: ClassVar[bool] = False
    equality: ClassVar[bool] = True

    contacts: tuple[str, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "contacts", selection("WrenchSum.contacts", self.contacts))

    def refusal(self, robot: Robot, command: Command) -> str:
        return "" if command == "torque" else 'is about forces: compile with command="torque"'

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        return (
            Input("target", unit="N, N m", size=6, default=np.zeros(6)),
            Input("point", unit="m", size=3, default=np.zeros(3)),
        )

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return tuple(force_row(robot, label, unit) for label, unit in zip(WRENCH_LABELS, WRENCH_UNITS, strict=True))

    def velocity_rows(self, robot: Robot, kin: Tracer, inputs: Values, dt: ca.SX) -> Rows | None:
        return None
