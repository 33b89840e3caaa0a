"""What the mechanism itself imposes on the joint velocities: mimic joints, undriven directions and closed loops."""

from __future__ import annotations

from typing import ClassVar

import casadi as ca

from wbc.quick_dataclasses import dataclass
from wbc.robot import Robot
from wbc.symbolic.tracer import Tracer
from wbc.tasks.base import Constraint, Input, Row, Rows, SacrificeOrder, Values
from wbc.tasks.braking import clip

#: How fast a loop that is open closes [characteristic lengths or rad per second]
CLOSING = 0.1


@dataclass(frozen=True)
class Mechanism(Constraint):
    """Equality rows of the robot's couplings, of its undriven degrees of freedom and of its closed loops; every stack
    has them by itself.

        mimic joint   v_follower - ratio v_leader = -gain (q_follower - ratio q_leader - offset)      [rad/s or m/s]
        undriven      v_i = 0          (a differential-drive base sideways; what no motor moves)      [m/s or rad/s]
        loop          de/dq v = -e / dt, as fast as 0.1 lengths or rad/s allow, and e(q (+) v dt) = 0 to 1e-10 of them
        the same      d2e/dt2 = -2 w (de/dt + w e / 2),  w = 0.2 / dt, w e / 2 up to the same rates (accelerations)

    It is added to every stack under the name ``mechanism`` where ``robot.couplings`` (mimic joints that were not
    locked), ``robot.locked_dofs`` or ``robot.loops`` is not empty. The right sides bring back a configuration that does
    not fit. What e bends by within a tick is made up for, see docs/reach.md.

    Inputs:
        gain: how fast a configuration that does not fit its couplings is brought back [1/s].

    What it cannot do: couple unbounded joints in position (they are coupled in velocity only), or know couplings that
    the robot does not state: gears, tendons.

    Example:
        >>> import wbc
        >>> robot = wbc.robots.load("tiago_no_hand", lock=(), shapes="none")
        >>> stack = wbc.Stack(robot, dt=0.01)
        >>> stack.add(wbc.tasks.EndEffector("base_link"), name="base")
        >>> assert [entry.name for entry in stack.entries] == ["mechanism", "base"]
    """

    stands_in_world: ClassVar[bool] = False

    order: ClassVar[SacrificeOrder] = SacrificeOrder.POSITION
    equality: ClassVar[bool] = True
    exact: ClassVar[bool] = True

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        return (Input("gain", unit="1/s", default=5.0, low=0.0),)

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        dofs = [c.follower for c in robot.couplings] + list(robot.locked_dofs)
        rows = [Row(robot.dof_names[i], f"{robot.dof_units[i]}/s") for i in dofs]
        return (*rows, *(Row(label, f"{unit}/s") for label, unit in robot.loops.rows))

    def velocity_rows(self, robot: Robot, kin: Tracer, inputs: Values, dt: ca.SX) -> Rows:
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
        if robot.loops:
            error = robot.loops.error(kin)
            most = ca.SX([robot.characteristic_length if unit == "m" else 1.0 for _, unit in robot.loops.rows])
            matrix = ca.vertcat(matrix, robot.loops.moving(kin.slope(error)))
            right = ca.vertcat(right, clip(-error / dt, -CLOSING * most, CLOSING * most))
        return Rows(matrix, right, right)

    def residual(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX | None:
        """e of loops; couplings do not bend."""
        return self._residual(robot, kin, still=False)

    def curved(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX | None:
        """e of loops along axes that do not turn."""
        return self._residual(robot, kin, still=True)

    def _residual(self, robot: Robot, kin: Tracer, still: bool) -> ca.SX | None:
        if not robot.loops:
            return None
        return ca.vertcat(ca.SX(len(robot.couplings) + len(robot.locked_dofs), 1), robot.loops.error(kin, still))
