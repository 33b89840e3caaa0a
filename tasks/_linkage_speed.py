"""How fast a linkage may move so that joints with limits of acceleration can follow it where it bends."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import casadi as ca
import numpy as np

from wbc.quick_dataclasses import dataclass
from wbc.symbolic.motion import MotionExpressions
from wbc.symbolic.tracer import Tracer
from wbc.tasks.base import Constraint, Row, Rows, SacrificeOrder, Values
from wbc.tasks.joint_limits import JointLimits

if TYPE_CHECKING:
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

        df/dv (v - v0 - c dt) <= 4 f (s_max / s - 1),    f = |c / A|^2 / 2,    s = |v0 / A|

        1 / s_max^2 = max(k / SHARE, (dk/dt) / (2 (1 - SHARE) k s)),    s_max >= s - (1 - SHARE) dt

    The norm |x / A| is over the joints that move the loops. At v0 these ask for accelerations, of which c are the
    least: J c = -(dJ/dt) v0; k = |c / A| / s^2 is how much the linkage bends on its way. At the first of both speeds
    the bend takes SHARE of the limits. At the second the linkage can brake by the rest until 1 / k is 0, if that falls
    on as it does: before a dead point. The row is f of v to first order; f grows with the fourth power of speed.

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
            slow = ca.fmax(ca.sqrt(size) / SHARE, speed * bend.growth / size / (2.0 * (1.0 - SHARE)))
            stops = (1.0 - SHARE) * dt / speed
            left = ca.fmax(1.0 / ca.sqrt(slow), ca.fmax(1.0 - stops, stops))
            slope = bend.slope[dofs]
            length = ca.sqrt(ca.sumsqr(slope * weights) + LEAST * ca.sqrt(size) / speed) / float(limits.min())
            matrix[k, dofs] = slope.T / length
            side = (ca.dot(slope, kin.v[dofs] + dt * bend.asked) + 2.0 * size * (left - 1.0)) / length
            # Where loops branch their rows depend on each other, and no accelerations are what they ask for
            bends = ca.logic_and(size > SLIGHT**2, ca.fmax(size, bend.missed / MISSED) <= 1.0)
            most[k] = ca.if_else(bends, side, ca.inf)
        return Rows(matrix, -ca.inf * ca.SX.ones(len(linkages)), most)


@dataclass(frozen=True)
class Bend:
    """What a linkage asks of its joints at the velocity v: the accelerations c = -A^2 J'y with J c = -(dJ/dt) v.

    Attributes:
        asked: c, by its degrees of freedom.
        slope: of |c / A|^2 / 2 by v, y' d(d2e/dt2)/dv [nv].
        growth: of the same in time, y' d3e/dt3 at v and c without jerk.
        missed: of what is asked for, the part that c is not, |J c + (dJ/dt) v|^2 / |(dJ/dt) v|^2.
    """

    asked: ca.SX
    slope: ca.SX
    growth: ca.SX
    missed: ca.SX


def bend_of(robot: Robot, kin: Tracer, linkage: Linkage, limits: Array) -> Bend:
    """The accelerations of a linkage and their slopes; ``limits``: A, by its degrees of freedom."""
    dofs, rows, weights = list(linkage.dofs), list(linkage.rows), ca.DM(limits)
    error = robot.loops.error(kin)
    bias = kin.second(error, MotionExpressions(kin.kinematics))[1][rows]
    jacobian = ca.densify(kin.jacobian(error))[rows, dofs]
    seen = jacobian @ ca.diag(weights)
    forces = _solved(seen, bias)
    asked = -weights * (seen.T @ forces)
    y, tangent = ca.SX.sym("y", len(rows)), kin.kinematics.tangent_map
    work = ca.dot(y, bias)
    # One sweep backwards gives both; along q and v it would be one forwards besides
    sweep = ca.substitute(ca.densify(ca.gradient(work, ca.vertcat(kin.q, kin.v))), y, ca.densify(forces))
    slope, whole = sweep[kin.q.numel() :], ca.SX.zeros(robot.nv)
    whole[dofs] = asked
    # y' (dJ/dt) c along v is half of the slope along c, but for what motions along v and c do not commute
    growth = ca.dot(sweep[: kin.q.numel()], tangent @ kin.v) + 1.5 * ca.dot(slope[dofs], asked)
    growth -= 0.5 * ca.dot(asked / weights**2, _bracket(kin.q, tangent, kin.v, whole)[dofs])
    missed = ca.sumsqr(jacobian @ asked + bias) / (ca.sumsqr(bias) + LEAST**2)
    return Bend(asked, slope, growth, missed)


def _bracket(q: ca.SX, tangent: ca.SX, v: ca.SX, c: ca.SX) -> ca.SX:
    """[v, c], the velocity by which moving along v, then c, differs from the other order; of a ball joint v x c [nv].

    Args:
        tangent: dq/dt by velocities, whose columns are at right angles to each other.
    """
    first, second = ca.SX.sym("first", v.numel()), ca.SX.sym("second", v.numel())
    change = ca.jtimes(tangent @ second, q, tangent @ first) - ca.jtimes(tangent @ first, q, tangent @ second)
    out = (tangent.T @ change) / ca.sum1(tangent**2).T
    return ca.densify(ca.substitute(out, ca.vertcat(first, second), ca.vertcat(v, c)))


def _solved(seen: ca.SX, bias: ca.SX) -> ca.SX:
    """(J J')^-1 b, of rows that depend on each other bounded."""
    gram = seen @ seen.T
    gram += REGULAR**2 * ca.trace(gram) / gram.shape[0] * ca.SX.eye(gram.shape[0])
    upper = ca.chol(gram)
    return ca.solve(upper, ca.solve(upper.T, bias))
