"""What the motors can do."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import casadi as ca
import numpy as np

from wbc.symbolic.tracer import Tracer
from wbc.tasks._selection import joint_dofs, selection
from wbc.tasks.base import Command, Constraint, Input, Row, Rows, SacrificeOrder, Torques, Values

if TYPE_CHECKING:
    from wbc.robot import Robot


@dataclass(frozen=True)
class TorqueLimits(Constraint):
    """Torques of the joints stay within those of ``robot.limits.effort``, T:

        -scale T <= M a + h - J'w <= scale T      [N m; N for sliding joints]

    with the mass matrix M, the inertia of the motors included, h of Coriolis forces and gravity, and the wrenches w of
    the contacts. They never give way. Only a stack that commands torques can have them.

    Inputs:
        scale: shrinks the limits, from 0 to 1.

    Example:
        >>> TorqueLimits()

    What it cannot do: limits that depend on speed, and friction of gears, are not in it.

    Attributes:
        joints: names of the joints to limit; None: all whose limit is finite.

    Raises:
        UnknownNameError, DuplicateNameError: an unknown joint, or one twice.
    """

    order: ClassVar[SacrificeOrder] = SacrificeOrder.ACTUATOR
    stands_in_world: ClassVar[bool] = False

    joints: tuple[str, ...] | None = None

    def __post_init__(self) -> None:
        if self.joints is not None:
            object.__setattr__(self, "joints", selection("TorqueLimits.joints", self.joints))

    def validate(self, robot: Robot) -> None:
        """Check the joint names, see :meth:`Item.validate`."""
        joint_dofs(robot, "TorqueLimits.joints", self.joints)

    def refusal(self, robot: Robot, command: Command) -> str:
        """Only a stack of torques has torques."""
        return "" if command == "torque" else 'limits torques: compile with command="torque"'

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        """``scale``."""
        return (Input("scale", default=1.0, low=0.0, high=1.0),)

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        """One row a degree of freedom with a limit."""
        efforts = robot.limits.effort
        return tuple(
            Row(robot.dof_names[i], "N m" if robot.dof_units[i] == "rad" else "N", max(float(efforts[i]), 1e-3))
            for i in self.dofs(robot)
        )

    def velocity_rows(self, robot: Robot, kin: Tracer, inputs: Values, dt: ca.SX) -> Rows | None:
        """None: its rows are on torques."""
        return None

    def torque_rows(self, robot: Robot, inputs: Values) -> Torques:
        """See the class."""
        dofs = self.dofs(robot)
        most = inputs["scale"] * ca.SX(ca.DM(robot.limits.effort[list(dofs)]))
        return Torques(dofs, -most, most)

    def dofs(self, robot: Robot) -> tuple[int, ...]:
        """Degrees of freedom with a limit, in the order of the rows."""
        followers = {c.follower for c in robot.couplings}
        chosen = joint_dofs(robot, "TorqueLimits.joints", self.joints)
        base = 6 if robot.base == "floating" else 0
        return tuple(i for i in chosen if i >= base and np.isfinite(robot.limits.effort[i]) and i not in followers)
