"""How fast a linkage may move so that joints with limits of acceleration can follow it where it bends."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import casadi as ca
import numpy as np

from wbc.quick_dataclasses import dataclass
from wbc.symbolic.tracer import Tracer
from wbc.tasks.base import Constraint, Row, Rows, SacrificeOrder, Values
from wbc.tasks.joint_limits import JointLimits

if TYPE_CHECKING:
    from collections.abc import Callable

    from wbc.robot import Robot
    from wbc.robot.loops import Linkage
    from wbc.validation import Array

#: Part of what joints can accelerate by that the bend of a linkage may take; the rest brakes it
SHARE = 0.5
#: Joints without a limit of acceleration have so many times the largest of the others
UNLIMITED = 1e3
#: Below this singular value, as part of the root mean square of all, rows of a linkage count as dependent
REGULAR = 1e-5
#: Added to the square of what a linkage asks for, as a part of what its joints can do: it divides
LEAST = 1e-12
#: Linkages stop so many ticks at their speed before a dead point, next to which they bend within one
TICKS = 3.0
#: A linkage whose bend takes less than this part of the limits is not slowed: the bend hardly depends on its speed
SLIGHT = 1e-3
#: Most of :attr:`Bend.missed` where a linkage is slowed
MISSED = 1e-8
#: A linkage is at rest below this part of the speed that its joints reach in a tick
AT_REST = 1e-3


@dataclass(frozen=True)
class LinkageSpeed(Constraint):
    """Speeds from which the joints of a linkage can follow it, one row a linkage; made by the stack where its joints
    have limits A of acceleration.

        v0' (v - v0 - c dt) / A^2 <= s (s_max - s),    s = |v0 / A|,    r = d log|y| / dt / 2

        s_max = min(s sqrt(SHARE / |c / A|), w) >= s - (1 - SHARE) dt,    TICKS w dt + w^2 / (2 (1 - SHARE)) = s / r

    The norm |x / A| is over the joints that move the loops. At v0 these ask for accelerations, of which c = -A^2 J'y
    are the least: (J A^2 J') y = (dJ/dt) v0. At the first of both speeds the bend takes SHARE of the limits. At w the
    linkage can brake by the rest, TICKS later, until y is infinite, if it grows on as the inverse square of what is
    left of the way: before a dead point, whose weak rows count in y before they do in c. The row asks for less speed
    and not for another direction, in which the linkage would bend less here and come as near to its dead point.

    Attributes:
        limits: whose limits they are.
    """

    abstract: ClassVar[bool] = True
    stands_in_world: ClassVar[bool] = False
    order: ClassVar[SacrificeOrder] = SacrificeOrder.MARGIN
    later: ClassVar[bool] = True

    limits: JointLimits

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        """One a linkage, named by its loops."""
        return tuple(Row(linkage.name, "rad/s") for linkage in self._limited(robot))

    def _limited(self, robot: Robot) -> list[Linkage]:
        limits = self.limits.limits(robot).acceleration
        return [linkage for linkage in robot.loops.linkages if np.isfinite(limits[list(linkage.dofs)]).any()]

    def velocity_rows(self, robot: Robot, kin: Tracer, inputs: Values, dt: ca.SX) -> Rows:
        """See the class."""
        linkages, kept = self._limited(robot), self.limits.limits(robot).acceleration
        matrix, most = ca.SX(len(linkages), robot.nv), ca.SX.zeros(len(linkages))
        for k, linkage in enumerate(linkages):
            dofs, limits = list(linkage.dofs), kept[list(linkage.dofs)]
            limits = np.where(np.isfinite(limits), limits, UNLIMITED * limits[np.isfinite(limits)].max())
            weights, bend = ca.DM(limits), bend_of(robot, kin, linkage, limits)
            speed = ca.sqrt(ca.sumsqr(kin.v[dofs] / weights) + (AT_REST * dt) ** 2)
            size = ca.sumsqr(bend.asked / weights) + LEAST
            # 1 over what is left of the way, and s / s_max
            near, ticks = ca.fmax(bend.rate, 0.0) / speed, TICKS * dt
            slow = 0.5 * (ticks * near + ca.sqrt((ticks * near) ** 2 + 2.0 / (1.0 - SHARE) * near))
            slow = ca.fmax(ca.sqrt(ca.sqrt(size) / SHARE), speed * slow)
            left = ca.fmax(1.0 / slow, 1.0 - (1.0 - SHARE) * dt / speed)
            along, unit = kin.v[dofs] / weights / speed, float(limits.min())
            matrix[k, dofs] = unit * (along / weights).T
            side = unit * (ca.dot(along, (kin.v[dofs] + dt * bend.asked) / weights) + speed * (left - 1.0))
            # Where loops branch their rows depend on each other, and no accelerations are what they ask for
            bends = ca.logic_and(size > SLIGHT**2, ca.fmax(size, bend.missed / MISSED) <= 1.0)
            most[k] = ca.if_else(bends, side, ca.inf)
        return Rows(matrix, -ca.inf * ca.SX.ones(len(linkages)), most)


@dataclass(frozen=True)
class Bend:
    """What a linkage asks of its joints at the velocity v: the accelerations c = -A^2 J'y with J c = -(dJ/dt) v.

    Attributes:
        asked: c, by its degrees of freedom.
        rate: r = d log|y| / dt / 2 at v and c [1/s].
        missed: of what is asked for, the part that c is not, |J c + (dJ/dt) v|^2 / |(dJ/dt) v|^2.
    """

    asked: ca.SX
    rate: ca.SX
    missed: ca.SX


def bend_of(robot: Robot, kin: Tracer, linkage: Linkage, limits: Array) -> Bend:
    """The accelerations of a linkage and their slopes; ``limits``: A, by its degrees of freedom."""
    dofs, rows, weights = list(linkage.dofs), list(linkage.rows), ca.DM(limits)
    error = robot.loops.error(kin)
    from wbc.symbolic.motion import MotionExpressions  # few robots have loops

    bias = kin.second(error, MotionExpressions(kin.kinematics))[1][rows]
    jacobian = ca.densify(kin.jacobian(error))[rows, dofs]
    seen = jacobian @ ca.diag(weights)
    solve = _solver(seen)
    forces = solve(bias)
    weak = solve(forces)
    asked, other = (-weights * (seen.T @ each) for each in (forces, weak))
    y, tangent = ca.SX.sym("y", len(rows)), kin.kinematics.tangent_map
    work = ca.dot(y, bias)
    sweep = ca.substitute(ca.densify(ca.gradient(work, ca.vertcat(kin.q, kin.v))), y, ca.densify(weak))
    slope = ca.substitute(ca.densify(ca.gradient(work, kin.v)), y, ca.densify(forces))[dofs]
    # y'(dy/dt) = z'(d/dt)((dJ/dt) v) - z'(d/dt)(J A^2 J') y with z of the weak rows; z'(dJ/dt) c along v is half of the
    # slope along c, but for what motions along v and c do not commute
    growth = ca.dot(sweep[: kin.q.numel()], tangent @ kin.v) + 1.5 * ca.dot(sweep[kin.q.numel() :][dofs], asked)
    growth += 0.5 * ca.dot(slope, other)
    for one, along in ((other, asked), (asked, other)):
        whole = ca.SX.zeros(robot.nv)
        whole[dofs] = along
        growth -= 0.5 * ca.dot(one / weights**2, _bracket(kin.q, tangent, kin.v, whole)[dofs])
    rate = 0.5 * growth / (ca.sumsqr(forces) + LEAST / ca.trace(seen @ seen.T))
    missed = ca.sumsqr(jacobian @ asked + bias) / (ca.sumsqr(bias) + LEAST**2)
    return Bend(asked, rate, missed)


def _bracket(q: ca.SX, tangent: ca.SX, v: ca.SX, c: ca.SX) -> ca.SX:
    """[v, c], the velocity by which moving along v, then c, differs from the other order; of a ball joint v x c [nv].

    Args:
        tangent: dq/dt by velocities, whose columns are at right angles to each other.
    """
    first, second = ca.SX.sym("first", v.numel()), ca.SX.sym("second", v.numel())
    change = ca.jtimes(tangent @ second, q, tangent @ first) - ca.jtimes(tangent @ first, q, tangent @ second)
    out = (tangent.T @ change) / ca.sum1(tangent**2).T
    return ca.densify(ca.substitute(out, ca.vertcat(first, second), ca.vertcat(v, c)))


def _solver(seen: ca.SX) -> Callable[[ca.SX], ca.SX]:
    """b -> (J J')^-1 b, of rows that depend on each other bounded."""
    gram = seen @ seen.T
    gram += REGULAR**2 * ca.trace(gram) / gram.shape[0] * ca.SX.eye(gram.shape[0])
    upper = ca.chol(gram)
    return lambda sides: ca.solve(upper, ca.solve(upper.T, sides))
