"""What a tick returns: the command, and on demand everything that is known about it."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from wbc.errors import CommandError
from wbc.qp.certificate import Certificate
from wbc.stack.declaration import bends
from wbc.stack.layout import CLOSED, rate_unit
from wbc.tick.buffers import INFINITE
from wbc.tick.context import Context
from wbc.tick.outcome import (
    ANSWERED,
    STATUSES,
    Binding,
    LevelCertificate,
    Residual,
    Slack,
    Status,
    certificates,
    scales,
)
from wbc.validation import Array, Entries

if TYPE_CHECKING:
    from wbc.explain import Explanation
    from wbc.robot import DeadPoint

_FLOAT = np.dtype(np.float64)
_DOUBLE = struct.Struct("d").unpack_from


class Step:
    """Result of one tick. Immutable; everything but ``v`` and ``status`` is worked out when asked for."""

    __slots__ = ("_context", "_data")

    def __init__(self, data: bytes, context: Context) -> None:
        self._data = data
        self._context = context

    def _part(self, name: str) -> Array:
        where = self._context.memory[name]
        return np.frombuffer(self._data, _FLOAT, where.stop - where.start, 8 * where.start)

    def _number(self, name: str) -> float:
        return float(_DOUBLE(self._data, 8 * self._context.memory[name].start)[0])

    @property
    def v(self) -> Array:
        """Velocities [rad/s, m/s], nv, read-only: the command, or where the command is an acceleration the velocity
        that it leads to until the next tick; of a robot with loops the nearest that keeps them closed at
        :attr:`q_next`.
        """
        return self._context.v_of(self._data)

    @property
    def q_next(self) -> Array:
        """Configuration that the command leads to until the next tick [nq], read-only: q (+) v dt, or
        q (+) (v dt + a dt^2 / 2) of accelerations a, see :meth:`wbc.robot.Robot.integrate`; of accelerations of a robot
        with loops the nearest that closes them.
        """
        context = self._context
        if len(self._data) > context.size:
            return context.q_next_of(self._data)
        robot = context.stack.robot
        if context.command != "velocity" and robot.loops:
            return self._part("next_q")
        mean = self.v if context.command == "velocity" else 0.5 * (self._part("v_in")[: context.nv] + self.v)
        later = robot.integrate(self._part("q"), mean, self._number("dt"))
        later.flags.writeable = False
        return later

    @property
    def command(self) -> Array:
        """What the tick decided about the joints, nv, read-only: their velocities, or accelerations."""
        return np.frombuffer(self._data, _FLOAT, self._context.nv)

    @property
    def a(self) -> Array:
        """Accelerations of the joints [rad/s^2, m/s^2], nv, read-only, to be held until the next tick.

        Raises:
            CommandError: the stack commands velocities.
        """
        self._require("a", "acceleration", "torque")
        return self.command

    @property
    def torque(self) -> Array:
        """Torques of the joints [N m, N], nv, read-only; 0 where no motor is: floating base, passive joints, followers.

        Raises:
            CommandError: the stack does not command torques.
        """
        self._require("torque", "torque")
        return self._part("torque")

    @property
    def forces(self) -> Mapping[str, Array]:
        """Wrench of every contact on the robot by the contact's name, in the axes of its frame and about its origin
        [N, N m]; 0 for a contact that is not enabled.

        Raises:
            CommandError: the stack does not command torques.
        """
        self._require("forces", "torque")
        layout, variables, p = self._context.layout, self._part("v"), self._part("p")
        closed = {name: p[layout.blocks[name].slots[CLOSED].span] for name in layout.forces}
        return Entries("forces", {name: variables[span] * closed[name] for name, span in layout.forces.items()})

    @property
    def loop_forces(self) -> Mapping[str, Array]:
        """Force, or force and moment, that keep each closed loop closed, by the loop's name: on its second frame from
        its first, in the axes of the first [N, N m]; of a joint on a curve, on that joint.

        Raises:
            CommandError: the stack does not command torques.
        """
        self._require("loop_forces", "torque")
        return self._context.loop_forces(self._part("v"))

    @property
    def dead_points(self) -> tuple[DeadPoint, ...]:
        """Linkages within 0.1 rad of a dead point, see :meth:`wbc.robot.Robot.dead_points`."""
        return self._context.stack.robot.dead_points(self._part("q"))

    def _require(self, field: str, *commands: str) -> None:
        command = self._context.command
        if command not in commands:
            reason = f"this stack commands {command}; compile it with command={commands[-1]!r}"
            raise CommandError(field, command, reason)

    @property
    def status(self) -> Status:
        """How the tick ended."""
        return STATUSES[int(_DOUBLE(self._data, self._context.flag_offset)[0])]

    @property
    def iterations(self) -> int:
        """Iterations of the QP solver; 0 where no row binds."""
        return int(self._number("iterations"))

    @property
    def certificate(self) -> Certificate:
        """How good v is; all inf for a braked or capped tick. ``stationarity`` in cost per rad/s."""
        names = ("stationarity", "violation", "complementarity", "error_bound")
        values = [self._number(n) for n in names]
        return Certificate(*(np.inf if value >= INFINITE else value for value in values))

    @property
    def levels(self) -> tuple[LevelCertificate, ...]:
        """What became of each strict level, and of the least velocity after them; empty where there is one level, and
        for a braked or capped tick.
        """
        layout = self._context.layout
        return certificates(layout, self._part) if layout.cascade else ()

    @property
    def residuals(self) -> Mapping[str, Residual]:
        """Error of every task before the step, by name, with units."""
        error = self._part("error")
        found = {
            b.entry.name: Residual(
                error[b.span], tuple(r.unit for r in b.rows), tuple(r.label for r in b.rows), b.entry.level
            )
            for b in self._context.layout.of_form("task")
        }
        return Entries("residuals", found)

    @property
    def faded(self) -> tuple[str, ...]:
        """Items of which a row is faded because its error or margin is near singular."""
        layout, task, margin = self._context.layout, self._part("factor"), self._part("margin_factor")
        parts = [(b, task[b.span]) for b in layout.of_form("task")]
        parts += [(b, margin[b.margins]) for b in layout.of_form("margins")]
        return tuple(b.entry.name for b, factor in parts if (factor < 1.0).any())

    @property
    def margins(self) -> Mapping[str, Array]:
        """Margins h of every margin constraint before the step, by name."""
        return self._by_margin("margins", "margin")

    @property
    def margins_ahead(self) -> Mapping[str, Array]:
        """Margins h(q (+) v dt) after the step, with moving obstacles moved on: part of the certificate."""
        return self._by_margin("margins_ahead", "ahead")

    @property
    def lost(self) -> Mapping[str, Array]:
        """What equality rows lose at q (+) v dt, by item: how much further from its target than J v = -gain e says the
        item is then [m, rad]. Beyond 1e-3 of ``stack.length`` per second, or rad/s, rows are in ``relaxed`` with it.
        docs/reach.md. Of accelerations what loops are open by at :attr:`q_next`.
        """
        values = self._part("lost")
        blocks = self._context.layout.of_form("rows")
        return Entries("lost", {b.entry.name: values[b.span] for b in blocks if bends(b.entry)})

    def _by_margin(self, field: str, part: str) -> Mapping[str, Array]:
        values = self._part(part)
        return Entries(field, {b.entry.name: values[b.margins] for b in self._context.layout.of_form("margins")})

    @property
    def binding(self) -> tuple[Binding, ...]:
        """Rows and bounds that push against the optimum."""
        context, nv = self._context, self._context.layout.variables
        multipliers = self._part("multipliers")
        low, high = self._part("owner_low"), self._part("owner_high")
        levels = self._pushes(multipliers.size)
        out = []
        for i in np.flatnonzero(multipliers).tolist():
            value = float(multipliers[i])
            bound = "upper" if value > 0 else "lower"
            if i < nv:
                if (high if value > 0 else low)[i] < 0.0:
                    bound = "lower" if value > 0 else "upper"  # held by a relaxation, see the order of sacrifice
                owner = int((high if bound == "upper" else low)[i])
                name = context.bounds[owner].entry.name if owner >= 0 else "bounds"
                out.append(Binding(name, context.variable(i), bound, value, levels[i]))
            else:
                block, row = context.general[i - nv]
                bound = "lower" if block.form == "margins" else bound
                bound = "equal" if getattr(block.entry.item, "equality", False) else bound
                out.append(Binding(block.entry.name, block.rows[row].label, bound, value, levels[i]))
        return tuple(out)

    def _pushes(self, count: int) -> list[int | None]:
        """The level that each row pushes against first."""
        layout = self._context.layout
        if not layout.cascade:
            return [layout.levels[0]] * count
        numbers = [*layout.levels, None]
        return [numbers[int(place)] for place in self._part("pushes")]

    @property
    def relaxed(self) -> tuple[Slack, ...]:
        """Rows that gave way because not all could hold; limits of joints where closed loops left them no way."""
        slack, beyond, context = self._part("slack"), self._part("beyond"), self._context
        out = []
        for i in np.flatnonzero(beyond).tolist():
            label, unit = context.variable(i), rate_unit(context.stack.robot.dof_units[i], context.command)
            owners = [int(self._part(name)[i]) for name in ("owner_low", "owner_high")]
            name = context.bounds[max(owners)].entry.name if max(owners) >= 0 else "bounds"
            out.append(Slack(name, label, float(beyond[i]), unit))
        for i in np.flatnonzero(slack).tolist():
            block, row = self._context.general[i]
            unit = rate_unit(block.rows[row].unit, self._context.command)
            out.append(Slack(block.entry.name, block.rows[row].label, float(slack[i]), unit))
        return tuple(out)

    @property
    def scales(self) -> Mapping[str, float]:
        """lambda of every scaled task by name, in [0, 1]: it is followed at this share of the rates that it asks for;
        0 where the tick brakes. docs/soft.md.
        """
        found = scales(self._context.layout, self._part("v"), self._part("error"))
        return Entries("scales", dict.fromkeys(found, 0.0) if self.status is Status.BRAKED else found)

    @property
    def answered_by(self) -> str:
        """What gave the command in place of the first answer: a link of :attr:`wbc.Policy.chain`; ``braking``, where
        none had a certified answer; ``policy``, where that brakes in conflicts; ``escape``, where it leaves a singular
        configuration. Empty for a first answer.
        """
        return ANSWERED[int(self._number("flag"))]

    def explain(self) -> Explanation:
        """Why the command is what it is, worked out now: conflicts by name, what binds, what each task lost to whom.

        The tick is set up again from this step's copy of its inputs, so it may be long past. Costs some milliseconds
        for an arm and tenths of a second for a humanoid. docs/explanations.md.

        Raises:
            SolverError: the step comes from a pickle, which holds no code to set its tick up with.
        """
        from wbc import explain

        return explain.explain(self._data, self._context, str(self.status), self.answered_by)

    def derivative(self, name: str, value: str | None = None) -> Array:
        """dv/dx [nv, k], how the command moves with what the tick was given, as long as the same rows bind.

            step.derivative("q")                  # tangent of the configuration [1/s, ...]
            step.derivative("v")                  # the velocity that accelerations count from
            step.derivative("hand", "target")     # a pose: six columns, (linear; angular) in the axes it is given in
            step.derivative("hand", "weight")     # by the logarithm of the weight

        Where a row is about to bind or to let go, the derivative is that of one side. docs/explanations.md.

        Raises:
            UnknownNameError: no such item or value.
            SolverError: the step comes from a pickle, rows gave way, or there is no optimum.
        """
        from wbc import explain

        return explain.derivative(self._data, self._context, name, value)

    def __repr__(self) -> str:
        text = f"Step({self.status}, |v| = {np.linalg.norm(self.v):.4g}"
        for name, residual in self.residuals.items():
            text += f", {name} {residual}"
        if self.binding:
            text += ", binding: " + ", ".join(str(b) for b in self.binding)
        if self.relaxed:
            text += ", relaxed: " + ", ".join(str(s) for s in self.relaxed)
            text += "".join(f"; {point}" for point in self.dead_points)
        return text + ")"


def state_of(step: Step) -> bytes:
    """A step's copy of its tick: report and inputs, laid out as :class:`wbc.stack.memory.Memory` says. With the
    controller's :class:`Context` it is the step again, also in another process.
    """
    return step._data[: step._context.size]
