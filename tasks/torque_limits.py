"""What the motors can do."""

from __future__ import annotations

from typing import ClassVar

import casadi as ca
import numpy as np

from wbc import validation
from wbc.errors import RangeError
from wbc.quick_dataclasses import dataclass
from wbc.robot import Robot
from wbc.symbolic.tracer import Tracer
from wbc.tasks._limits import checked_limits
from wbc.tasks._selection import joint_dofs, selection
from wbc.tasks.base import Command, Constraint, Input, Row, Rows, SacrificeOrder, Torques, Values
from wbc.tasks.braking import clip

#: In place of a torque that is not known
NOT_KNOWN = 1e30


@dataclass(frozen=True)
class TorqueLimits(Constraint):
    """Torques of the joints stay within those of ``robot.limits.effort``, T:

        -scale T <= M a + h - J'w <= scale T      [N m; N for sliding joints]

    with the mass matrix M, the inertia of the motors included, h of Coriolis forces and gravity, and the wrenches w of
    the contacts. They never give way. Only a stack that commands torques can have them. With ``slew`` they also change
    no faster than that from the last command tau0:

        tau0 - slew dt <= tau <= tau0 + slew dt,      as far as that is within the limits above

    Where no command within both keeps the joints' limits as well, the tick brakes (status ``braked``) with torques that
    are within both, and says how many N m are missing. After a reset the last torque is not known: the first tick is
    free.

    Attributes:
        joints: names of the joints to limit; None: all with a motor whose limit is finite.
        slew: first value of the input, one number or one a row; None: torques may change at once.

    Inputs:
        scale: shrinks the limits, from 0 to 1.
        slew: with ``slew``, one number a row [N m/s, N/s].
        last: with ``slew``, tau0, read-only; 1e30: not known [N m, N].

    What it cannot do: know limits that fall with speed, or the friction of gears (``JointFriction``). Where no torque
    within the limits carries the robot, what is held gives way.

    Example:
        >>> import wbc
        >>> stack = wbc.Stack(wbc.robots.load("panda"), dt=0.001)
        >>> stack.add(wbc.tasks.TorqueLimits(), name="motors")
        >>> stack.add(wbc.tasks.Posture())

    Raises:
        UnknownNameError, DuplicateNameError: an unknown joint, or one twice. RangeError: one without a motor.
        ShapeError, NotFiniteError, RangeError, BoundsError: ``slew``.
    """

    order: ClassVar[SacrificeOrder] = SacrificeOrder.ACTUATOR
    stands_in_world: ClassVar[bool] = False

    joints: tuple[str, ...] | None = None
    slew: float | tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        if self.slew is not None:
            validation.real_array("TorqueLimits.slew", self.slew)
            object.__setattr__(self, "slew", checked_limits("TorqueLimits.slew", 0.0, self.slew)[1])
        if self.joints is not None:
            object.__setattr__(self, "joints", selection("TorqueLimits.joints", self.joints))

    def validate(self, robot: Robot) -> None:
        named = joint_dofs(robot, "TorqueLimits.joints", self.joints)
        if self.joints is not None and (passive := [i for i in named if i in robot.passive]):
            raise RangeError("TorqueLimits.joints", robot.dof_names[passive[0]], "no motor drives this joint")
        if isinstance(self.slew, tuple):
            validation.real_array("TorqueLimits.slew", self.slew, (len(self.dofs(robot)),))

    def refusal(self, robot: Robot, command: Command) -> str:
        return "" if command == "torque" else 'limits torques: compile with command="torque"'

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        scale, count = Input("scale", default=1.0, low=0.0, high=1.0), len(self.dofs(robot))
        if self.slew is None or not count:
            return (scale,)
        rates = np.broadcast_to(np.array(self.slew, dtype=float), count).copy()
        last = Input("last", unit="N m, N", size=count, default=np.full(count, NOT_KNOWN), sensed=True)
        return (scale, Input("slew", unit="N m/s, N/s", size=count, default=rates, low=0.0, each=True), last)

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        efforts = robot.limits.effort
        return tuple(
            Row(robot.dof_names[i], "N m" if robot.dof_units[i] == "rad" else "N", max(float(efforts[i]), 1e-3))
            for i in self.dofs(robot)
        )

    def velocity_rows(self, robot: Robot, kin: Tracer, inputs: Values, dt: ca.SX) -> Rows | None:
        return None

    def torque_rows(self, robot: Robot, inputs: Values, dt: ca.SX) -> Torques:
        dofs = self.dofs(robot)
        most = inputs["scale"] * ca.SX(ca.DM(robot.limits.effort[list(dofs)]))
        if "last" not in inputs:
            return Torques(dofs, -most, most)
        change, last = inputs["slew"] * dt, inputs["last"]
        ends = (clip(last + sign * change, -most, most) for sign in (-1.0, 1.0))
        low, high = (ca.if_else(last < NOT_KNOWN, end, s * most) for end, s in zip(ends, (-1.0, 1.0), strict=True))
        return Torques(dofs, low, high)

    def dofs(self, robot: Robot) -> tuple[int, ...]:
        """Degrees of freedom with a limit, in the order of the rows."""
        chosen = joint_dofs(robot, "TorqueLimits.joints", self.joints)
        others = {*robot.unactuated, *(c.follower for c in robot.couplings)}
        return tuple(i for i in chosen if i not in others and np.isfinite(robot.limits.effort[i]))
