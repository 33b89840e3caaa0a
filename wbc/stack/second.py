"""Rows of a stack that commands accelerations or torques, on x = (a; w) with the wrenches w of its contacts.

    tasks       J a + (dJ/dt) v + ... = -damping de/dt - stiffness e         derivatives of the item's e(q, inputs)
    margins     d2h/dt2 >= -rate (2 dh/dt + rate h) / (1 + rate dt / 2)
    rows        with r = A v - lower:  dr/dt >= -rate r, and the same for upper; equalities with both
    contacts    their motion as rows above; cone w within its limits; w = target as a task
    loops       J a + (dJ/dt) v = -2 w de/dt - w^2 e with w = 0.2 / dt, and their forces f as variables
    dynamics    M a + h - J'w - J_l' f = tau on the degrees of freedom whose tau is limited, or known to be 0

Why margins stay positive: with psi = dh/dt + rate h the row says psi(t + dt) >= (1 - rate dt) psi(t) where the second
derivative of h does not change within the tick, and then h(t + dt) (1 + rate dt / 2) >= h(t) (1 - rate dt / 2) by the
trapezoidal rule, which is exact there; for every rate dt in (0, 1], however dt varies. docs/torque.md.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import casadi as ca
import numpy as np

from wbc.stack.declaration import Declaration
from wbc.stack.layout import CLOSED, Block, Layout, Slot
from wbc.stack.motors import decelerations
from wbc.symbolic.kinematics import Kinematics, Pose
from wbc.symbolic.motion import MotionExpressions
from wbc.symbolic.tracer import Tracer, along
from wbc.tasks._contact import Contact, ContactForce, ContactWrench, LoopForces, Unactuated
from wbc.tasks.base import Constraint, Rows, Task
from wbc.tasks.braking import clip
from wbc.tasks.torque_limits import TorqueLimits
from wbc.tasks.wrench_sum import WrenchSum

if TYPE_CHECKING:
    from collections.abc import Sequence


#: How fast loops that are open close, critically damped [1 per tick]
LOOP_RATE = 0.2
#: and at most [characteristic lengths or rad per second]
LOOP_SPEED = 0.1
#: Torque of a motor without a limit [N m]; a number, as zero times infinity is none
NO_LIMIT = 1e300


class Builder(Protocol):
    """What is needed of the builder of a program."""

    @property
    def stack(self) -> Declaration: ...
    @property
    def layout(self) -> Layout: ...
    @property
    def kinematics(self) -> Kinematics: ...
    @property
    def p(self) -> ca.SX: ...
    @property
    def dt(self) -> ca.SX: ...

    def tracer(self, block: Block) -> Tracer:
        """What an item sees of the robot."""

    def moving(self, block: Block) -> list[tuple[Block, Slot]]:
        """Inputs that have a rate, with their blocks: the item's, and those of the frame that it is stated in."""

    def values(self, block: Block) -> dict[str, ca.SX | Pose]:
        """Inputs of an item as its expressions receive them."""

    def rate(self, block: Block, slot: Slot) -> ca.SX:
        """Time derivative of the numbers of an input that has a rate."""

    def column(self, block: Block, what: str, expression: ca.SX) -> ca.SX:
        """A column of the declared number of rows."""


class SecondOrder:
    """Rows of one stack.

    Attributes:
        x: symbols of all variables, of which the torques are a function.
    """

    def __init__(self, builder: Builder) -> None:
        self._b, self._layout, self._robot = builder, builder.layout, builder.stack.robot
        self._kinematics = builder.kinematics
        self._motion = MotionExpressions(builder.kinematics)
        self.x = ca.SX.sym("x", builder.layout.variables)
        self._forces: ca.SX | None = None

    def task(self, block: Block) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
        """error, desired acceleration, factor and rows over all variables of a task."""
        item = block.entry.item
        assert isinstance(item, Task)
        b, robot, count = self._b, self._robot, len(block.rows)
        if isinstance(item, LoopForces):
            rows = ca.SX(count, self._layout.variables)
            rows[:, self._layout.loop_forces] = ca.SX.eye(count)
            return ca.SX.zeros(count), ca.SX.zeros(count), ca.SX.ones(count), rows
        if isinstance(item, ContactForce):
            target, measured, feedback = (b.p[block.slots[name].span] for name in ("target", "measured", "feedback"))
            wanted = target + feedback * (target - measured)
            rows = ca.SX(count, self._layout.variables)
            rows[:, self._layout.forces[item.of]] = ca.SX.eye(count)
            return -wanted, wanted, ca.SX.ones(count), rows
        tracer, inputs = b.tracer(block), b.values(block)
        error = b.column(block, "error", item.error(robot, tracer, inputs))
        own = item.jacobian(robot, tracer, inputs)
        rate, bias = tracer.second(error, self._motion, own, self._moving(block))
        jacobian = tracer.slope(error) if own is None else ca.SX(own)[:, : robot.nv]
        fade = item.row_factor(robot, tracer, inputs)
        factor = ca.SX.ones(count) if fade is None else b.column(block, "row_factor", fade)
        value, jacobian, factor = tracer.expanded(error, jacobian, factor)
        asked = item.acceleration(inputs, value, rate)
        if asked is None:
            stiffness, damping = (b.p[block.slots[name].span] for name in ("stiffness", "damping"))
            asked = -stiffness * value - damping * rate
        return value, asked - bias, factor, self._wide(jacobian)

    def constraint(self, block: Block) -> tuple[Rows, ca.SX | None, ca.SX | None]:
        """Rows over all variables of a constraint, its margins and their factors."""
        item = block.entry.item
        assert isinstance(item, Constraint)
        robot, tracer, inputs = self._robot, self._b.tracer(block), self._b.values(block)
        if isinstance(item, ContactWrench):
            cone = item.contact.cone(self._b.values(self._layout.blocks[item.of]))
            wide = ca.SX(len(block.rows), self._layout.variables)
            wide[:, self._layout.forces[item.of]] = cone.matrix
            return Rows(wide, cone.lower, cone.upper), None, None
        torques = item.torque_rows(robot, inputs, self._b.dt)
        if torques is not None:
            still, moving = (part[list(torques.dofs), :] for part in (self._still, self._dynamics))
            if torques.drives is not None:
                drives = ca.SX(ca.DM(torques.drives))
                still, moving = drives @ still, drives @ moving
            return Rows(moving, torques.lower - still, torques.upper - still), None, None
        if isinstance(item, WrenchSum):
            target = self._b.p[block.slots["target"].span]
            return Rows(self._sum(item, block), target, target), None, None
        if not block.rows:
            return Rows(ca.SX(0, self._layout.variables), ca.SX(0, 1), ca.SX(0, 1)), None, None
        if block.entry.yielding:
            return self._limits(block, item), None, None
        if (declared := item.later_rows(self._robot, tracer, inputs, self._b.dt)) is not None:
            return self._later(block, declared, tracer), None, None
        if block.form == "rows":
            return self._rates(block, item, tracer), None, None
        margins = item.margins(robot, tracer, inputs)
        assert margins is not None
        margin = self._b.column(block, "margins", margins)
        first, bias = tracer.second(margin, self._motion, None, self._moving(block))
        fade = item.row_factor(robot, tracer, inputs)
        factor = ca.SX.ones(len(block.rows)) if fade is None else self._b.column(block, "row_factor", fade)
        value, jacobian, factor = tracer.expanded(margin, tracer.slope(margin), factor)
        rate = self._b.p[block.slots["rate"].span]
        low = -bias - rate * (2.0 * first + rate * value) / (1.0 + 0.5 * rate * self._b.dt)
        return Rows(self._wide(jacobian), low, ca.SX.inf(len(block.rows))), value, factor

    def _limits(self, block: Block, item: Constraint) -> Rows:
        """Bounds on accelerations as rows. Of a joint beyond its limit of velocity by more than limits of acceleration
        take back within the tick the sides cross. Before a limit of position a joint counts on no more than its motor
        has.
        """
        b, v = self._b, self._kinematics.v
        longest = b.stack.dt_range[1]
        bounds = item.acceleration_bounds(
            self._robot, Tracer(self._kinematics), b.values(block), b.dt, longest, self._motors_of(item)
        )
        assert bounds is not None
        ends = [b.column(block, "lower", bounds.lower), b.column(block, "upper", bounds.upper)]
        for i in np.flatnonzero(np.isfinite(most := item.velocity_limits(self._robot))).tolist():
            back = (clip(v[i], -most[i], most[i]) - v[i]) / b.dt
            ends[0][i] = ca.if_else(v[i] < -most[i], ca.fmax(ends[0][i], back), ends[0][i])
            ends[1][i] = ca.if_else(v[i] > most[i], ca.fmin(ends[1][i], back), ends[1][i])
        return Rows(self._wide(ca.SX.eye(self._layout.nv)), *ends)

    def _motors_of(self, item: Constraint) -> dict[int, ca.SX]:
        """What the motors of joints have, but of linkages with limits of acceleration: these have rows of their own."""
        limits, linkages = item.acceleration_limits(self._robot), self._robot.loops.linkages
        slowed = {dof for part in linkages if np.isfinite(limits[list(part.dofs)]).any() for dof in part.dofs}
        return {dof: motor for dof, motor in self._motors.items() if dof not in slowed}

    @cached_property
    def _motors(self) -> dict[int, ca.SX]:
        """Decelerations that motors with limits have, by degree of freedom."""
        limits: dict[int, ca.SX] = {}
        for block in self._layout.of_form("rows"):
            item = block.entry.item
            for i in item.dofs(self._robot) if isinstance(item, TorqueLimits) else ():
                scale = self._b.values(block)["scale"]
                assert isinstance(scale, ca.SX)
                limits[i] = scale * float(self._robot.limits.effort[i])
        mass = self._driven @ self._motion.dynamics.mass_matrix @ self._driven.T
        return decelerations(self._robot, self._kinematics, mass, self._still, limits)

    def _later(self, block: Block, declared: Rows, tracer: Tracer) -> Rows:
        """Rows on the velocity at the end of the tick, v + a dt."""
        b = self._b
        matrix = tracer.expand(ca.SX(declared.matrix))
        now = ca.densify(matrix @ self._kinematics.v)
        ends = (tracer.expand(b.column(block, "side", end)) for end in (declared.lower, declared.upper))
        return Rows(self._wide(matrix), *((end - now) / b.dt for end in ends))

    def _rates(self, block: Block, item: Constraint, tracer: Tracer) -> Rows:
        """Rows on velocities: what they are off decays at ``rate``."""
        b = self._b
        declared = item.velocity_rows(self._robot, tracer, b.values(block), b.dt)
        assert declared is not None
        matrix, (low, high) = (
            tracer.expand(ca.SX(declared.matrix)),
            (
                tracer.expand(b.column(block, name, ends))
                for name, ends in (("lower", declared.lower), ("upper", declared.upper))
            ),
        )
        rate = b.p[block.slots["rate"].span]
        speed = drift = None
        if isinstance(item, Contact) and not block.entry.frame:
            turn, inputs = self._kinematics.pose(item.frame).rotation, b.values(block)
            speed, drift = (item.still(inputs, turn, part) for part in self._motion.frame(item.frame))
        if speed is None or drift is None:
            speed = ca.densify(along(matrix, self._kinematics.v))
            drift = self._along(speed, block)
        ends = []
        for end in (low, high):
            ends.append(self._along(end, block) - drift - rate * (speed - end))
        kept = item.residual(self._robot, tracer, b.values(block)) if item.exact else None
        if kept is not None:
            ends[0] = self._closing(block, tracer, kept, ends[0])
        if item.equality:
            ends[1] = ends[0]
        return Rows(self._wide(matrix[:, : self._layout.nv]), ends[0], ends[1])

    def _closing(self, block: Block, tracer: Tracer, kept: ca.SX, others: ca.SX) -> ca.SX:
        """Sides of rows that keep e at 0, and of those that keep nothing: ``others``."""
        rate, bias = tracer.second(kept, self._motion)
        value, fast = tracer.expand(ca.densify(kept)), LOOP_RATE / self._b.dt
        most = ca.SX([LOOP_SPEED * row.scale(self._b.stack.length) for row in block.rows])
        sides = -bias - 2.0 * fast * (rate + clip(0.5 * fast * value, -most, most))
        keeps = [not kept[k].is_zero() for k in range(kept.numel())]
        return ca.vertcat(*[sides[k] if keeps[k] else others[k] for k in range(kept.numel())])

    def _along(self, expression: ca.SX, block: Block) -> ca.SX:
        """Time derivative of an expression in q, v and inputs where v does not change."""
        kin = self._kinematics
        total = ca.jtimes(expression, kin.q, kin.tangent_map @ kin.v)
        for symbols, rates in self._moving(block):
            total += ca.jtimes(expression, symbols, rates)
        return ca.densify(total)

    def _moving(self, block: Block) -> Sequence[tuple[ca.SX, ca.SX]]:
        """(symbols, rates) of an item's inputs that move, their rates included."""
        out = []
        for owner, slot in self._b.moving(block):
            rate, name = self._b.rate(owner, slot), slot.input.name
            for other in owner.slots.values():
                if other.input.direction and other.input.rate == name:
                    # a direction stays at unit length
                    rate -= ca.sumsqr(self._b.p[slot.span]) * self._b.p[other.span]
            out.append((self._b.p[slot.span], ca.densify(rate)))
        return out

    def _wide(self, matrix: ca.SX) -> ca.SX:
        """Columns of accelerations, with none for wrenches."""
        return ca.horzcat(matrix, ca.SX(matrix.shape[0], self._layout.variables - self._layout.nv))

    @property
    def _driven(self) -> ca.SX:
        """nv x nv: what motors have to give for generalised forces; the leader of a mimic joint has its follower's."""
        matrix = np.eye(self._layout.nv)
        for coupling in self._robot.couplings:
            matrix[coupling.leader] += coupling.ratio * matrix[coupling.follower]
            matrix[coupling.follower] = 0.0
        return ca.SX(ca.sparsify(ca.DM(matrix)))

    @property
    def _still(self) -> ca.SX:
        """Torques of the motors without acceleration and wrenches."""
        return ca.densify(self._driven @ (self._motion.dynamics.nonlinear_effects - self._loads))

    @property
    def _loads(self) -> ca.SX:
        """Generalised forces of all loads, as far as they are enabled."""
        total = ca.SX(self._layout.nv, 1)
        for block in self._layout.blocks.values():
            item = block.entry.item
            if isinstance(item, Constraint) and item.is_load:
                load = item.load(self._robot, self._kinematics, self._b.values(block))
                assert load is not None
                total += self._b.p[block.slots[CLOSED].span] * load
        return total

    @property
    def _dynamics(self) -> ca.SX:
        """nv x variables: torques of the motors by accelerations and wrenches."""
        if self._forces is None:
            parts = [self._motion.dynamics.mass_matrix, *(-jacobian.T for jacobian in self._contacts()), -self._loops.T]
            self._forces = ca.sparsify(self._driven @ ca.horzcat(*parts))
        return self._forces

    @cached_property
    def _loops(self) -> ca.SX:
        """Rows of the loops whose forces are variables, rows x nv."""
        if not self._layout.loop_rows:
            return ca.SX(0, self._layout.nv)
        tracer = Tracer(self._kinematics)
        loops = self._robot.loops
        return loops.moving(tracer.jacobian(loops.error(tracer)))

    def _contacts(self) -> list[ca.SX]:
        """What the transposed of takes each contact's wrench to generalised forces, components x nv, as far as it is
        closed.
        """
        out = []
        for name in self._layout.forces:
            block = self._layout.blocks[name]
            item = block.entry.item
            assert isinstance(item, Contact)
            closed = self._b.p[block.slots[CLOSED].span]
            units = item.unit_wrenches(self._b.values(block), *self._seen(block, item.frame))
            out.append(closed * (ca.sparsify(units) @ self._kinematics.jacobian(item.frame, "local")))
        return out

    def _sum(self, item: WrenchSum, block: Block) -> ca.SX:
        """6 x variables: what the wrenches of some contacts add up to, in the world's axes about a point."""
        out, point = ca.SX(6, self._layout.variables), self._b.p[block.slots["point"].span]
        for name in item.contacts:
            contact = self._layout.blocks[name]
            own = contact.entry.item
            assert isinstance(own, Contact)
            units = own.unit_wrenches(self._b.values(contact), *self._seen(contact, own.frame)).T
            pose = self._kinematics.pose(own.frame)
            force, moment = pose.rotation @ units[:3, :], pose.rotation @ units[3:, :]
            moment += ca.skew(pose.position - point) @ force
            out[:, self._layout.forces[name]] = self._b.p[contact.slots[CLOSED].span] * ca.vertcat(force, moment)
        return ca.sparsify(out)

    def _seen(self, block: Block, frame: str) -> tuple[ca.SX, ca.SX]:
        """Rotation and twist of a frame as the item sees them, from the world or from the frame it is stated in."""
        tracer = self._b.tracer(block)
        rotation = tracer.expand(ca.SX(tracer.rotation(frame)))
        if tracer.carrier is None:
            return rotation, self._motion.frame(frame)[0]
        return rotation, tracer.expand(along(tracer.frame_jacobian(frame), self._kinematics.v))

    def torque(self, enabled: ca.SX) -> ca.SX:
        """Torques of the motors at the variables :attr:`x`, by one recursion: M a + h - J'w - J_l' f, 0 where none is;
        within their limits also where a tick has no answer, and not beyond them by rounding.

        Args:
            enabled: 1 or 0 for each general row.
        """
        nv = self._layout.nv
        dynamics = self._motion.dynamics
        tau = ca.substitute(dynamics.inverse_dynamics, dynamics.a, self.x[:nv])
        for jacobian, span in zip(self._contacts(), self._layout.forces.values(), strict=True):
            tau -= jacobian.T @ self.x[span]
        if self._layout.loop_rows:  # of a single variable none are not a column
            tau -= self._loops.T @ self.x[self._layout.loop_forces]
        tau = self._driven @ (tau - self._loads)
        for block in self._layout.of_form("margins", "rows"):
            item = block.entry.item
            limits = (
                item.torque_rows(self._robot, self._b.values(block), self._b.dt)
                if isinstance(item, Constraint)
                else None
            )
            if limits is None or not limits.dofs or isinstance(item, Unactuated):
                continue
            dofs, on = list(limits.dofs), enabled[block.span]
            low, high = (ca.if_else(on, end, s * NO_LIMIT) for end, s in ((limits.lower, -1.0), (limits.upper, 1.0)))
            if limits.drives is None:
                tau[dofs] = ca.fmin(ca.fmax(tau[dofs], low), high)
            else:
                own = ca.SX(ca.DM(limits.drives)) @ tau[dofs]
                tau[dofs] = ca.SX(ca.DM(np.linalg.inv(limits.drives))) @ ca.fmin(ca.fmax(own, low), high)
        tau[list(self._robot.unactuated)] = 0.0
        return tau
