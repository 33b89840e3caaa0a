"""What the mechanism itself imposes on the joint velocities: mimic joints and undriven directions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import casadi as ca

from wbc.symbolic.tracer import Tracer
from wbc.tasks.base import Constraint, Input, Row, Rows, SacrificeOrder, Values

if TYPE_CHECKING:
    from wbc.robot import Robot


@dataclass(frozen=True)
class Mechanism(Constraint):
    """Equality rows of the robot's couplings and of its undriven degrees of freedom; every stack has them by itself.

        mimic joint   v_follower - ratio v_leader = -gain (q_follower - ratio q_leader - offset)      [rad/s or m/s]
        undriven      v_i = 0          (a differential-drive base sideways; what no motor moves)      [m/s or rad/s]

    The right side of a mimic row brings back a configuration that does not fit. It is added under the name
    ``mechanism`` where ``robot.couplings`` or ``robot.locked_dofs`` is not empty.

    Inputs:
        gain: how fast a configuration that does not fit its couplings is brought back [1/s].

    It cannot couple joints without a plain coordinate (unbounded joints are coupled in velocity only).
    """

    stands_in_world: ClassVar[bool] = False

    order: ClassVar[SacrificeOrder] = SacrificeOrder.POSITION
    equality: ClassVar[bool] = True

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        """``gain`` of the mimic rows."""
        return (Input("gain", unit="1/s", default=5.0, low=0.0),)

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        """One row a coupling, named by its follower, then one an undriven degree of freedom."""
        dofs = [c.follower for c in robot.couplings] + list(robot.locked_dofs)
        return tuple(Row(robot.dof_names[i], f"{robot.dof_units[i]}/s") for i in dofs)

    def velocity_rows(self, robot: Robot, kin: Tracer, inputs: Values, dt: ca.SX) -> Rows:
        """See the class."""
        count = len(robot.couplings) + len(robot.locked_dofs)
        matrix, right = ca.SX(count, robot.nv), ca.SX.zeros(count)
        for k, coupling in enumerate(robot.couplings):
            matrix[k, coupling.follower] = 1
            matrix[k, coupling.leader] = -coupling.ratio
            here, there = (int(robot.position_index[i]) for i in (coupling.follower, coupling.leader))
            if here >= 0 and there >= 0:
                right[k] = -inputs["gain"] * (kin.q[here] - coupling.ratio * kin.q[there] - coupling.offset)
        for k, i in enumerate(robot.locked_dofs, start=len(robot.couplings)):
            matrix[k, i] = 1
        return Rows(matrix, right, right)
