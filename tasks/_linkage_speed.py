"""How fast a linkage may move so that joints with limits of acceleration can follow it where it bends."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, ClassVar

import casadi as ca
import numpy as np

from wbc.quick_dataclasses import dataclass
from wbc.symbolic.tracer import Tracer
from wbc.tasks.base import Constraint, Row, Rows, SacrificeOrder, Values
from wbc.tasks.joint_limits import JointLimits

if TYPE_CHECKING:
    from wbc.robot import Robot
    from wbc.robot.loops import Linkage
    from wbc.validation import Array

#: Part of what joints can accelerate by that the bend of a linkage may take
SHARE = 0.5
#: The rest brakes it
BRAKE = 1.0 - SHARE
#: What it counts on before limits of position: bends grow on the way
STOP = 0.5 * BRAKE
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
#: Nor one whose bend takes so many times the limits: its loops branch
STEEP = 10.0
#: Most of :attr:`Bend.missed` where a linkage is slowed
MISSED = 1e-8
#: What joints can accelerate by but for what closes loops that a tick finds open by rounding, as a part of it
WITHOUT_ROUNDING = 1.0 - 1e-5
#: A linkage is at rest below this part of the speed that its joints reach in a tick
AT_REST = 1e-3


@dataclass(frozen=True)
class LinkageSpeed(Constraint):
    """Velocities from which a linkage can stop on its way within the limits of its joints, a row a linkage, one more
    where it has several motions, and one a joint of it with limits of position; made by the stack where they have
    limits A of acceleration.

        s' (v - v0 - c dt) <= s_max - s,    s = |v0 / A|_4,    s' = ds/dv,    r = d log|y| / dt / 2

        s_max = min(s sqrt(SHARE / |c / A|_4), w) >= s - D dt,    TICKS w dt + w^2 / (2 D) = s / r

        q_l <= q + v (dt + t) + c t^2 / 2 <= q_u,    t = s / (2 E),    E = D / 2,    D = 1 - SHARE

    |x|_4 = (sum x_i^4)^(1/4) over the joints that move the loops. At v0 these ask for accelerations, of which
    c = -A^2 J'y are the least: (J A^2 J') y = (dJ/dt) v0. At the first of both speeds the bend takes SHARE of the
    limits. At w the linkage can brake by the rest, TICKS later, until y is infinite, if it grows on as the inverse
    square of what is left of the way: before a dead point, whose weak rows count in y before they do in c. The row asks
    for less speed and not for another direction, in which the linkage would bend less here and come as near to its
    dead point. A linkage of several motions may turn to where it bends more, sooner than it can slow down: its second
    row is the same of |c / A|_4 / SHARE, whose root grows with the length of v,

        s b' (v - v0 - c dt) / (2 b) <= max(s sqrt(SHARE / b), s - D dt) - s,    b = |c / A|_4,    b' = db/dv

    The last line says that it stops within the limits of position. Its way x has dx/dl = v / s and d2x/dl2 = c / s^2 by
    the length l, of which braking by E A takes s t. A tick of it leads to v0 (1 - E dt / s) + c dt, and as

        (s - E dt) dt + (s - E dt)^2 / (2 E) = (s^2 - E^2 dt^2) / (2 E) < s t,

    the linkage stops no further on than it would have: what is within these rows stays so by braking, whatever the
    lengths of ticks, with accelerations of |c / A| + E < 1 at most. Joints that each brake in time on their own do not
    say so, as a slow one takes along others that cannot stop as soon. E leaves as much for bends that grow on the way.
    The row of a joint is the line over dt + t, with s and c t^2 to first order about the speed along v0 at which the
    joint comes to its limit but for c, of those that A lets it reach; no row asks for more than braking by D does, or
    by what of it bends leave within A. A linkage of one motion turns back no faster than it stops before the limit
    behind. One of several may turn: of its joints the limit is that next to which they stop, c counts only towards it,
    and what leaves it may come back within t at s. Where accelerations are commanded a tick moves by (v0 + v) dt / 2,
    and q + v0 dt / 2 is in place of q: what brakes then stays within the line as before.

    Attributes:
        limits: whose limits they are.
    """

    abstract: ClassVar[bool] = True
    stands_in_world: ClassVar[bool] = False
    order: ClassVar[SacrificeOrder] = SacrificeOrder.MARGIN

    limits: JointLimits

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        """One or two a linkage, named by its loops, then those of its joints with limits of position."""
        out = list[Row]()
        for linkage in self._limited(robot):
            out.append(Row(linkage.name, "rad/s"))
            if _turns(linkage):
                out.append(Row(f"{linkage.name} turning", "rad/s"))
            out += [Row(robot.dof_names[dof], f"{robot.dof_units[dof]}/s") for dof in self._ended(robot, linkage)]
        return tuple(out)

    def _limited(self, robot: Robot) -> list[Linkage]:
        limits = self.limits.limits(robot).acceleration
        return [linkage for linkage in robot.loops.linkages if np.isfinite(limits[list(linkage.dofs)]).any()]

    def _ended(self, robot: Robot, linkage: Linkage) -> list[int]:
        """Degrees of freedom of a linkage that have limits of position."""
        limits = self.limits.limits(robot)
        ends = np.isfinite(limits.position_lower) | np.isfinite(limits.position_upper)
        return [dof for dof in linkage.dofs if ends[dof] and robot.position_index[dof] >= 0]

    def velocity_rows(self, robot: Robot, kin: Tracer, inputs: Values, dt: ca.SX) -> Rows:
        """See the class."""
        return self._rows(robot, kin, dt, 0.0)

    def later_rows(self, robot: Robot, kin: Tracer, inputs: Values, dt: ca.SX) -> Rows:
        """The same, of joints that move at (v0 + v) / 2 until they have v."""
        return self._rows(robot, kin, dt, 0.5)

    def _rows(self, robot: Robot, kin: Tracer, dt: ca.SX, moved: float) -> Rows:
        parts = [self._rows_of(robot, kin, linkage, dt, moved) for linkage in self._limited(robot)]
        matrix, lower, upper = (ca.vertcat(*ends) for ends in zip(*parts, strict=True))
        return Rows(matrix, lower, upper)

    def _rows_of(
        self, robot: Robot, kin: Tracer, linkage: Linkage, dt: ca.SX, moved: float
    ) -> tuple[ca.SX, ca.SX, ca.SX]:
        """Rows of a linkage, their lower and upper sides; ``moved``: for which part of a tick joints go on at v0."""
        dofs, ended, kept = list(linkage.dofs), self._ended(robot, linkage), self.limits.limits(robot)
        known = kept.acceleration[dofs]
        limits = np.where(np.isfinite(known), known, UNLIMITED * known[np.isfinite(known)].max())
        weights, unit, bend = ca.DM(limits), float(limits.min()), bend_of(robot, kin, linkage, limits)
        v, rest, size = kin.v[dofs] / weights, AT_REST * dt, _norm(bend.asked / weights, LEAST)
        # Where loops branch their rows depend on each other, and no accelerations are what they ask for
        regular = ca.fmax(size / STEEP, bend.missed / MISSED) <= 1.0
        speed, asked = _norm(v, rest), ca.if_else(regular, bend.asked, 0.0)
        along = (v / speed) ** 3 / weights
        # Joints that bend against their velocity have less left to brake by
        braking = ca.mmin((WITHOUT_ROUNDING + asked / weights * ca.sign(v)) / (ca.fabs(v) / speed + LEAST))
        braking = ca.fmin(ca.fmax(braking, 0.0), BRAKE) * dt
        # 1 over what is left of the way, and s / s_max
        near, ticks = ca.fmax(bend.rate, 0.0) / speed, TICKS * dt
        slow = 0.5 * (ticks * near + ca.sqrt((ticks * near) ** 2 + 2.0 / BRAKE * near))
        slow = ca.fmax(ca.sqrt(size / SHARE), speed * slow)
        most = ca.dot(along, dt * asked) + ca.fmax(speed / slow, speed - braking) - (rest / speed) ** 3 * rest
        slowing = [(along, most)]
        if _turns(linkage):
            steeper = 0.5 * speed / size * bend.steeper(asked / weights / size)
            turned = ca.fmax(speed / ca.sqrt(size / SHARE), speed - braking)
            slowing.append((steeper, ca.dot(steeper, dt * asked) + turned))
        slowed, first = ca.logic_and(size > SLIGHT, regular), len(slowing)
        matrix = ca.SX(first + len(ended), robot.nv)
        matrix[:first, dofs] = unit * ca.horzcat(*[row for row, _ in slowing]).T
        lower, upper = [-ca.SX.inf(first)], [ca.if_else(slowed, unit * side, ca.inf) for _, side in slowing]
        braked = (1.0 - braking / ca.fmax(speed, braking)) * kin.v[dofs] + dt * asked
        reach = len(dofs) ** 0.25 * dt
        for k, dof in enumerate(ended, first):
            place, v_joint = dofs.index(dof), kin.v[dof]
            begins = kin.q[int(robot.position_index[dof])] + moved * dt * v_joint
            up, down = float(kept.position_upper[dof]) - begins, begins - float(kept.position_lower[dof])
            ahead_is_up = 2.0 * v_joint * (dt + 0.5 / STOP * speed) > up - down if _turns(linkage) else v_joint > 0.0
            toward = ca.if_else(ahead_is_up, ca.fmax(v_joint, 0.0), ca.fmin(v_joint, 0.0))
            share = ca.fabs(toward) / speed + LEAST
            about = _stopping(ca.if_else(ahead_is_up, up, down), share, dt)
            about = ca.fmax(ca.fmin(ca.fmax(about, speed - reach), speed + reach), 0.0)
            stops, bent = 0.5 / STOP * about, asked[place] * (about / speed) ** 2
            if _turns(linkage):
                bent = ca.if_else(ahead_is_up, ca.fmax(bent, 0.0), ca.fmin(bent, 0.0))
            row = (0.5 / STOP * toward / speed * about + bent * stops / STOP) * along
            ahead = about / speed * ca.dot(row, kin.v[dofs]) - 0.5 * bent * stops**2 - begins
            row[place] += dt + stops
            row, ahead = row / (dt + stops), ahead / (dt + stops)
            least, ends = ca.dot(row, braked), (kept.position_lower, kept.position_upper)
            sides = [ahead + float(end[dof]) / (dt + stops) for end in ends]
            if not _turns(linkage):
                # Its velocities are along v0: against it no faster than what stops before the limit behind
                pace = _norm(v, AT_REST * rest)
                share, room, forth = (
                    ca.fabs(v_joint) / pace + LEAST,
                    ca.if_else(ahead_is_up, down, up),
                    ca.dot(row, kin.v[dofs]),
                )
                forth = ca.if_else(pace > 2.0 * AT_REST * rest, forth, 0.0)
                back = ca.fmin(_stopping(room, share, dt), reach)
                room -= 0.5 * ca.fabs(asked[place]) * (0.5 / STOP * back**2 / speed) ** 2
                back = -ca.fmin(_stopping(room, share, dt), reach) / pace * forth
                sides[0] = ca.if_else(ca.logic_and(ahead_is_up, forth > 0.0), back, sides[0])
                sides[1] = ca.if_else(ca.logic_and(v_joint < 0.0, forth < 0.0), back, sides[1])
            matrix[k, dofs] = row.T
            lower.append(ca.fmin(sides[0], least))
            upper.append(ca.fmax(sides[1], least))
        return matrix, ca.vertcat(*lower), ca.vertcat(*upper)


@dataclass(frozen=True)
class Bend:
    """What a linkage asks of its joints at the velocity v: the accelerations c = -A^2 J'y with J c = -(dJ/dt) v.

    Attributes:
        asked: c, by its degrees of freedom.
        rate: r = d log|y| / dt / 2 at v and c [1/s].
        missed: of what is asked for, the part that c is not, |J c + (dJ/dt) v|^2 / |(dJ/dt) v|^2.
        steeper: x -> sum_i x_i^3 d(c_i / A_i)/dv, by its degrees of freedom.
    """

    asked: ca.SX
    rate: ca.SX
    missed: ca.SX
    steeper: Callable[[ca.SX], ca.SX]


def bend_of(robot: Robot, kin: Tracer, linkage: Linkage, limits: Array) -> Bend:
    """The accelerations of a linkage and their slopes; ``limits``: A, by its degrees of freedom."""
    dofs, rows, weights = list(linkage.dofs), list(linkage.rows), ca.DM(limits)
    error = robot.loops.error(kin)
    from wbc.symbolic.motion import MotionExpressions  # few robots have loops

    bias = kin.second(error, MotionExpressions(kin.kinematics))[1][rows]
    jacobian = ca.densify(kin.jacobian(error))[rows, dofs]
    seen = jacobian @ ca.diag(weights)
    solve = dependent_solver(seen)
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

    def steeper(parts: ca.SX) -> ca.SX:
        along = -solve(seen @ parts**3)
        return ca.substitute(ca.densify(ca.gradient(work, kin.v)), y, along)[dofs]

    missed = ca.sumsqr(jacobian @ asked + bias) / (ca.sumsqr(bias) + LEAST**2)
    return Bend(asked, rate, missed, steeper)


def _turns(linkage: Linkage) -> bool:
    """Whether it moves in more ways than one, and may turn to others."""
    return len(linkage.dofs) - linkage.held > 1


def _stopping(room: ca.SX, share: ca.SX, dt: ca.SX) -> ca.SX:
    """The speed s from which a joint with v = share * s stops after ``room``, but for the bend."""
    return STOP * (ca.sqrt(dt**2 + 2.0 / STOP * ca.fmax(room, 0.0) / share) - dt)


def _norm(x: ca.SX, least: ca.SX | float) -> ca.SX:
    """(sum x_i^4 + least^4)^(1/4)."""
    return ca.sqrt(ca.sqrt(ca.sumsqr(x**2) + least**4))


def _bracket(q: ca.SX, tangent: ca.SX, v: ca.SX, c: ca.SX) -> ca.SX:
    """[v, c], the velocity by which moving along v, then c, differs from the other order; of a ball joint v x c [nv].

    Args:
        tangent: dq/dt by velocities, whose columns are at right angles to each other.
    """
    first, second = ca.SX.sym("first", v.numel()), ca.SX.sym("second", v.numel())
    change = ca.jtimes(tangent @ second, q, tangent @ first) - ca.jtimes(tangent @ first, q, tangent @ second)
    out = (tangent.T @ change) / ca.sum1(tangent**2).T
    return ca.densify(ca.substitute(out, ca.vertcat(first, second), ca.vertcat(v, c)))


def dependent_solver(seen: ca.SX) -> Callable[[ca.SX], ca.SX]:
    """b -> (J J')^-1 b, of rows that depend on each other bounded."""
    gram = seen @ seen.T
    gram += REGULAR**2 * ca.trace(gram) / gram.shape[0] * ca.SX.eye(gram.shape[0])
    upper = ca.chol(gram)
    return lambda sides: ca.solve(upper, ca.solve(upper.T, sides))
