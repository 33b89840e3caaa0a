"""Limits of joint position, velocity and acceleration as bounds on v that never contradict each other."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import ClassVar

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from wbc import validation
from wbc.errors import RangeError
from wbc.quick_dataclasses import dataclass
from wbc.robot import Limits, Robot
from wbc.symbolic.tracer import Tracer
from wbc.tasks._selection import dof_rows, joint_dofs, selection
from wbc.tasks.base import Bounds, Constraint, Input, Row, SacrificeOrder, Values
from wbc.tasks.braking import braking_bound, clip
from wbc.tasks.stopping import allowed_accelerations

#: Part of its limit of acceleration by which a joint of a linkage counts on braking before a limit of position: the
#: rest is for what the linkage asks of it on the way, and for the other joints that it takes along
LINKAGE_BRAKING = 0.25


@dataclass(frozen=True)
class JointLimits(Constraint):
    """Position, velocity and acceleration limits of the joints, as one interval a degree of freedom, never empty:

        actuator  [-s V, s V] cut with [v0 - A dt, v0 + A dt]
        position  -b(q - q_lower - margin) <= v <= b(q_upper - margin - q)             [rad/s, m/s]

    The braking bound at distance d >= 0 is the largest speed from which the joint can still stop on the limit by
    braking at A over ticks of any length (proofs, and the bound with ``shortest_dt``: tasks/braking.py):

        b(d) = 2 d / (dt + sqrt(dt^2 + 2 d / A)),      outside: b(d) = -min(return_rate |d|, b(|d|))

    v0 is the velocity that accelerations are counted from (that given to ``step``, else the last command); V and A are
    ``robot.limits.velocity`` and ``.acceleration``; s is ``velocity_scale``. A joint that follows others has one
    interval with its leaders. In stacks that command accelerations or torques these are bounds on the acceleration.
    Joints of closed loops count on A / 4 in b; rows ``"<name> linkages"`` slow loops before bends and limits that A
    does not follow (docs/robots.md).

    Where limits exclude each other actuators come first, acceleration before velocity. From a viable state (v0^2 / (2
    A) <= d, limits unchanged) that does not happen, and the position limit is not passed however dt varies. From
    outside the joint brakes at A, then returns.

    Attributes:
        position, velocity, acceleration: which limits to keep. Without ``acceleration`` the joint may stop at once,
            b(d) = d / dt.
        margin: distance kept from both position limits [rad or m].
        joints: names of the joints to limit; None: all.
        shortest_dt: promise that no tick is shorter [s]; None: none. The longer it is, the faster a joint may approach
            its limit, by up to A shortest_dt / 2; with ``shortest_dt`` = dt constant the bound is the exact one.
        return_rate: initial value of the input [1/s].

    Inputs:
        velocity_scale: s, from 0 to 1, shrinks the velocity limits.
        return_rate: slowest return from outside [1/s]; 0: none is asked for.

    What it cannot do: keep the limit when v0 is not the velocity that the joint has, or when the robot starts too fast
    too close to it. The promise ``shortest_dt`` is not checked. Floating and planar bases, ball and unbounded joints
    have no position limit. Whether the motors have the torque for A is considered on a floating base, and
    in loops without A, with ``TorqueLimits`` only.

    Example:
        >>> import wbc
        >>> robot = wbc.robots.load("panda")
        >>> stack = wbc.Stack(robot, dt=0.005)
        >>> stack.add(wbc.tasks.JointLimits(margin=0.02), name="limits")
    """

    stands_in_world: ClassVar[bool] = False

    order: ClassVar[SacrificeOrder] = SacrificeOrder.ACTUATOR

    position: bool = True
    velocity: bool = True
    acceleration: bool = True
    margin: float = 0.0
    joints: tuple[str, ...] | None = None
    shortest_dt: float | None = None
    return_rate: float = 5.0

    def __post_init__(self) -> None:
        for name in ("position", "velocity", "acceleration"):
            object.__setattr__(self, name, validation.flag(f"JointLimits.{name}", getattr(self, name)))
        validation.own_scalars(self, "margin", low=0.0, unit="rad or m")
        validation.own_scalars(self, "return_rate", low=0.0, unit="1/s")
        if self.shortest_dt is not None:
            validation.own_scalars(self, "shortest_dt", low=0.0, open_low=True, unit="s")
        if self.joints is not None:
            object.__setattr__(self, "joints", selection("JointLimits.joints", self.joints))

    def validate(self, robot: Robot) -> None:
        """Check joint names, and that the margin leaves something of every range.

        Raises:
            UnknownNameError: an unknown joint.
            RangeError: a margin above half of a joint's range.
        """
        for i in joint_dofs(robot, "JointLimits.joints", self.joints):
            width = robot.limits.position_upper[i] - robot.limits.position_lower[i]
            if self.position and robot.position_index[i] >= 0 and 2 * self.margin > width:
                reason = f"above half of the range {width:g} {robot.dof_units[i]} of {robot.dof_names[i]!r}"
                raise RangeError("JointLimits.margin", self.margin, reason)

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        return (
            Input("velocity_scale", default=1.0, low=0.0, high=1.0),
            Input("return_rate", unit="1/s", default=self.return_rate, low=0.0),
        )

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return dof_rows(robot)

    def limits(self, robot: Robot) -> Limits:
        """Those that are kept, infinite for the others: the chosen joints' less the margin, coupled ones as one."""
        known, dofs = robot.limits, list(joint_dofs(robot, "JointLimits.joints", self.joints))
        kept = {name: np.full(robot.nv, np.inf) for name in ("velocity", "acceleration", "upper", "lower")}
        kept["lower"] *= -1.0
        here = [i for i in dofs if robot.position_index[i] >= 0] if self.position else []
        kept["lower"][here] = known.position_lower[here] + self.margin
        kept["upper"][here] = known.position_upper[here] - self.margin
        if self.velocity:
            kept["velocity"][dofs] = known.velocity[dofs]
        if self.acceleration:
            kept["acceleration"][dofs] = known.acceleration[dofs]
        return robot.coupled(Limits(kept["lower"], kept["upper"], kept["velocity"], kept["acceleration"], known.effort))

    def acceleration_limits(self, robot: Robot) -> NDArray[np.float64]:
        return self.limits(robot).acceleration

    def velocity_limits(self, robot: Robot) -> NDArray[np.float64]:
        return self.limits(robot).velocity

    def position_limits(self, robot: Robot) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        limits = self.limits(robot)
        return limits.position_lower, limits.position_upper

    def bounds(self, robot: Robot, kin: Tracer, inputs: Values, dt: ca.SX) -> Bounds:
        return self._intervals(robot, kin, inputs, partial(allowed_interval, dt=dt, shortest_dt=self.shortest_dt))

    def acceleration_bounds(
        self,
        robot: Robot,
        kin: Tracer,
        inputs: Values,
        dt: ca.SX,
        longest: float,
        motors: Mapping[int, ca.SX] | None = None,
    ) -> Bounds:
        interval = partial(allowed_accelerations, dt=dt, longest=longest)
        return self._intervals(robot, kin, inputs, interval, motor=motors or {})

    def _intervals(
        self,
        robot: Robot,
        kin: Tracer,
        inputs: Values,
        interval: Callable[..., tuple[ca.SX, ca.SX]],
        **own: Mapping[int, ca.SX],
    ) -> Bounds:
        """What ``interval`` allows each chosen degree of freedom: one at a time where ``own`` has arguments of theirs,
        else columns of those that have the same kinds of limits.
        """
        limits, count, shares = self.limits(robot), robot.nv, np.ones(robot.nv)
        shares[[dof for linkage in robot.loops.linkages for dof in linkage.dofs]] = LINKAGE_BRAKING
        free = robot.position_index < 0
        columns = (
            np.where(free, -np.inf, limits.position_lower), np.where(free, np.inf, limits.position_upper),
            limits.velocity, limits.acceleration, limits.acceleration * shares,
        )  # fmt: skip
        alike: dict[object, list[int]] = {}
        for i, values in enumerate(zip(*columns, strict=True)):
            kind = tuple([float(value) if value in (0.0, np.inf, -np.inf) else None for value in values])
            alike.setdefault(i if own else kind, []).append(i)
        lower, upper = -ca.SX.inf(count), ca.SX.inf(count)
        for dofs in alike.values():
            low, high, velocity, acceleration, braking = (
                float(column[dofs[0]]) if len(dofs) == 1 or np.all(column[dofs] == column[dofs[0]]) else
                ca.SX(column[dofs]) for column in columns
            )  # fmt: skip
            lower[dofs], upper[dofs] = interval(
                ca.vertcat(*[ca.SX(0) if free[i] else kin.q[int(robot.position_index[i])] for i in dofs])
                if free[dofs].any()
                else kin.q[robot.position_index[dofs].tolist()],
                kin.v[dofs],
                position=(low, high),
                velocity=velocity,
                acceleration=acceleration,
                braking=braking,
                velocity_scale=inputs["velocity_scale"],
                return_rate=inputs["return_rate"],
                **{name: values[dofs[0]] for name, values in own.items() if dofs[0] in values},
            )
        return Bounds(lower, upper)


def allowed_interval(
    q: ca.SX,
    v: ca.SX,
    dt: ca.SX,
    *,
    position: tuple[float | ca.SX, float | ca.SX],
    velocity: float | ca.SX,
    acceleration: float | ca.SX,
    velocity_scale: ca.SX,
    return_rate: ca.SX,
    shortest_dt: float | None = None,
    braking: float | ca.SX | None = None,
) -> tuple[ca.SX, ca.SX]:
    """The interval of :class:`JointLimits` for one coordinate, or a column of them, lower <= upper always.

    Limits are numbers, infinite where there is none, and cost no operation there, or columns of finite ones.
    ``braking``, before a limit of position, is no more than ``acceleration``; None: the same.
    """
    braking = acceleration if braking is None else braking
    low, high = -ca.SX.inf(1), ca.SX.inf(1)
    bounded = _finite(velocity) or _finite(acceleration)
    if _finite(velocity):
        high = velocity_scale * velocity
        low = -high
    if _finite(acceleration):
        step = acceleration * dt
        # Clipping both ends gives the intersection, or where it is empty the acceleration end nearest to it
        low, high = (
            clip(end, v - step, v + step) if _finite(velocity) else v + s * step for end, s in ((low, -1), (high, 1))
        )
    lower, upper = low, high
    if _finite(position[1]):
        upper = _approach(position[1] - q, braking, dt, return_rate, shortest_dt)
        upper = clip(upper, low, high) if bounded else upper
    if _finite(position[0]):
        lower = -_approach(q - position[0], braking, dt, return_rate, shortest_dt)
        lower = clip(lower, low, high) if bounded else lower
        if _finite(position[1]):
            # Equal in exact arithmetic at worst (a range of width 0 seen from outside)
            lower = ca.fmin(lower, upper)
    return lower, upper


def _finite(limit: float | ca.SX) -> bool:
    return isinstance(limit, ca.SX) or math.isfinite(limit)


def _approach(
    distance: ca.SX, acceleration: float | ca.SX, dt: ca.SX, return_rate: ca.SX, shortest_dt: float | None
) -> ca.SX:
    """Largest velocity towards a limit ``distance`` away; negative outside (distance < 0): the slowest return.

    The return is no faster than a speed from which the joint stops on the limit, so that it never conflicts with
    the opposite limit, however narrow the range.
    """
    speed = braking_bound(ca.fabs(distance), acceleration, dt, shortest_dt)
    return ca.if_else(distance < 0, ca.fmax(return_rate * distance, -speed), speed)
