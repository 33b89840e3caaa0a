"""Joints that must stand still."""

from __future__ import annotations

import math
from typing import ClassVar

import casadi as ca

from wbc import validation
from wbc.quick_dataclasses import dataclass
from wbc.robot import Robot
from wbc.symbolic.tracer import Tracer
from wbc.tasks._selection import dof_rows, joint_dofs, selection
from wbc.tasks.base import Bounds, Constraint, Row, SacrificeOrder, Values
from wbc.tasks.braking import clip


@dataclass(frozen=True)
class Fixed(Constraint):
    """The named joints stand still, as bounds lower = upper; one that still moves brakes at its acceleration limit A:

        v_i = v0_i - clip(v0_i, -A dt, A dt)     for every degree of freedom i of the joints     [rad/s, m/s]

    ``enabled`` and ``mask`` fix and release joints while running. Full braking is always within ``JointLimits``; a
    joint outside its position limits returns if they ask for it.

    Attributes:
        joints: names of the joints, one or several; a base joint fixes the whole base.
        acceleration: bring moving joints to rest at ``robot.limits.acceleration``; False: at once.

    What it cannot do: bring back a joint that something else moved (``Posture`` does). A joint that never moves is
    better locked when the robot is loaded.

    Example:
        >>> import wbc
        >>> stack = wbc.Stack(wbc.robots.load("talos"), dt=0.002)
        >>> stack.add(wbc.tasks.Fixed(["head_1_joint", "head_2_joint"]), name="head")
    """

    stands_in_world: ClassVar[bool] = False

    order: ClassVar[SacrificeOrder] = SacrificeOrder.HOLD

    joints: tuple[str, ...]
    acceleration: bool = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "joints", selection("Fixed.joints", self.joints))
        object.__setattr__(self, "acceleration", validation.flag("Fixed.acceleration", self.acceleration))

    def validate(self, robot: Robot) -> None:
        """Check the joint names.

        Raises:
            UnknownNameError: an unknown joint.
        """
        joint_dofs(robot, "Fixed.joints", self.joints)

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return dof_rows(robot)

    def bounds(self, robot: Robot, kin: Tracer, inputs: Values, dt: ca.SX) -> Bounds:
        lower, upper = -ca.SX.inf(robot.nv), ca.SX.inf(robot.nv)
        for i in joint_dofs(robot, "Fixed.joints", self.joints):
            limit = float(robot.limits.acceleration[i]) if self.acceleration else math.inf
            rest = ca.SX(0)
            if math.isfinite(limit):
                # As JointLimits writes its acceleration ends, so that both give the same number to the last bit
                rest = clip(rest, kin.v[i] - limit * dt, kin.v[i] + limit * dt)
            lower[i] = upper[i] = rest
        return Bounds(lower, upper)
