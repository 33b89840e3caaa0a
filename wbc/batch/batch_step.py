"""What a tick of a batch returns: everything by arrays with an axis of robots first."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np

from wbc import validation
from wbc.batch import numbers
from wbc.batch.derivatives import Derivatives
from wbc.batch.pullback import Pullback
from wbc.controller.step import Step
from wbc.errors import CommandError, SolverError
from wbc.stack.layout import CLOSED
from wbc.tick.context import Context
from wbc.tick.outcome import STATUSES, Status
from wbc.validation import Array, Entries

#: Place of each status in ``list(Status)``, by the tick's flag
_CODES = np.array([list(Status).index(status) for status in STATUSES], np.int8)


class StepOwner(Protocol):
    """What a step needs of its batch."""

    inputs: Array
    changes: int

    @property
    def derivatives(self) -> Derivatives | None:
        """What differentiates all ticks at once; None where each is done alone."""

    @property
    def held_back(self) -> bool:
        """Whether bounds on velocities or margins hold a robot back, as docs/reach.md says."""

    @property
    def pullback(self) -> Pullback:
        """What differentiates backwards.

        Raises:
            SolverError: the stack's ticks are not all in its CasADi functions.
        """


class Pulled:
    """Gradients of :meth:`BatchStep.pull`."""

    def __init__(self, parts: Mapping[str, Array], context: Context) -> None:
        self._parts, self._context = parts, context

    def by(self, name: str, value: str | None = None) -> Array:
        """By ``"q"``, by ``"v"``, the velocity that accelerations count from, or by an item's value [n, k].

        Raises:
            UnknownNameError: no such item or value.
        """
        if value is None:
            return self._parts[{"q": "q", "v": "v_last"}[validation.one_of("by", name, ("q", "v"))]]
        block = self._context.layout.blocks[validation.one_of("by", name, self._context.layout.blocks)]
        slots = block.slots
        return self._parts["p"][:, slots[validation.one_of(f"by.{name}", value, slots)].span]


class BatchStep:
    """Result of one tick of n robots; arrays are read-only.

    Attributes:
        command: what the ticks decided about the joints [n, nv]: velocities, or accelerations.
        v: velocities [n, nv], as of :attr:`wbc.Step.v`.
    """

    def __init__(self, reports: Array, owner: StepOwner, context: Context) -> None:
        reports.flags.writeable = False
        self._reports, self._context, self._owner, self._changes = reports, context, owner, owner.changes
        self._kept: Array | None = None
        self.command: Array = reports[:, : context.nv]
        self.v: Array = self.command
        if context.command != "velocity":
            self.v = self._part("next_v")

    def __len__(self) -> int:
        return len(self._reports)

    def _part(self, name: str) -> Array:
        return self._reports[:, self._context.memory[name]]

    def _given(self, name: str) -> Array:
        """What the caller wrote, while it is that of this tick."""
        if self._changes != self._owner.changes:
            raise SolverError(name, None, "the batch has gone on since this tick; ask before the next one")
        where, start = self._context.memory[name], self._context.memory.report
        return self._owner.inputs[:, where.start - start : where.stop - start]

    @property
    def status_codes(self) -> np.ndarray:
        """How each tick ended, as its place in ``list(wbc.Status)`` [n], int8."""
        found: np.ndarray = _CODES[self._part("flag")[:, 0].astype(np.intp)]
        return found

    @property
    def statuses(self) -> list[Status]:
        """How each tick ended."""
        names = list(Status)
        return [names[code] for code in self.status_codes.tolist()]

    @property
    def solved(self) -> np.ndarray:
        """Whether every row of a robot holds and its command is the optimum [n], bool."""
        found: np.ndarray = self.status_codes == list(Status).index(Status.SOLVED)
        return found

    @property
    def torque(self) -> Array:
        """Torques of the joints [n, nv], as of :attr:`wbc.Step.torque`.

        Raises:
            CommandError: the stack does not command torques.
        """
        self._require_torque("torque")
        return self._part("torque")

    @property
    def forces(self) -> Mapping[str, Array]:
        """Wrench of every contact by its name [n, k], as of :attr:`wbc.Step.forces`.

        Raises:
            CommandError: the stack does not command torques. SolverError: the batch has gone on since.
        """
        self._require_torque("forces")
        layout, variables, p = self._context.layout, self._part("v"), self._given("p")
        closed = {name: p[:, layout.blocks[name].slots[CLOSED].span] for name in layout.forces}
        return Entries("forces", {name: variables[:, span] * closed[name] for name, span in layout.forces.items()})

    @property
    def loop_forces(self) -> Mapping[str, Array]:
        """What keeps each closed loop closed by its name [n, k], as of :attr:`wbc.Step.loop_forces`.

        Raises:
            CommandError: the stack does not command torques.
        """
        self._require_torque("loop_forces")
        return self._context.loop_forces(self._part("v"))

    def _require_torque(self, field: str) -> None:
        if self._context.command != "torque":
            reason = f"this stack commands {self._context.command}; compile it with command='torque'"
            raise CommandError(field, self._context.command, reason)

    @property
    def residuals(self) -> Mapping[str, Array]:
        """Errors of every task before the step by its name [n, rows], in the rows' units."""
        error = self._part("error")
        return Entries("residuals", {b.entry.name: error[:, b.span] for b in self._context.layout.of_form("task")})

    @property
    def margins(self) -> Mapping[str, Array]:
        """Margins of every margin constraint before the step by its name [n, rows]."""
        margin = self._part("margin")
        return Entries("margins", {b.entry.name: margin[:, b.margins] for b in self._context.layout.of_form("margins")})

    @property
    def slacks(self) -> Array:
        """By how much each general row gave way [n, rows], in the order of :meth:`wbc.Controller.qp`."""
        return self._part("slack")

    @property
    def error_bounds(self) -> Array:
        """Bound on the largest |v - v*| of each tick [n]; 1e30 where none is known."""
        return self._part("error_bound")[:, 0]

    def __getitem__(self, robot: int) -> Step:
        """The step of one robot, with its explanation and derivatives; before the batch goes on.

        Raises:
            RangeError: no such robot. SolverError: the batch has gone on since.
        """
        number = int(validation.scalar("robot", robot, low=-len(self), high=len(self) - 1))
        self._given("q")
        return Step(self._reports[number].tobytes() + self._owner.inputs[number].tobytes(), self._context)

    def derivative(self, name: str, value: str | None = None) -> Array:
        """dv/dx [n, nv, k] of every robot, as of :meth:`wbc.Step.derivative`.

            step.derivative("q")                  # [n, nv, nv]
            step.derivative("hand", "target")     # [n, nv, 6]

        All at once where the stack has one level without soft rows, is compiled and no robot is held back by bounds on
        velocities or margins, see docs/reach.md; else one after the other.

        Raises:
            UnknownNameError: no such item or value.
            SolverError: the batch has gone on since, or a robot's rows do not all hold; see :attr:`solved`.
        """
        self._given("q")
        if not self.solved.all():
            number = int(np.flatnonzero(~self.solved)[0])
            reason = f"robot {number} is {self.statuses[number]}: only a command for which every row holds has one"
            raise SolverError("derivative", name, reason)
        if (together := self._owner.derivatives) is not None and not self._owner.held_back:
            return together.find(name, value, self._reports, self._owner.inputs)
        return np.stack([self[k].derivative(name, value) for k in range(len(self))])

    def keep(self) -> None:
        """Keep a copy of what the ticks were given, so that :meth:`pull` works when the batch has gone on.

        Raises:
            SolverError: it has gone on already.
        """
        self._given("q")
        self._kept = self._owner.inputs.copy()

    def pull(self, weights: Any) -> Pulled:
        """The gradient of ``sum(weights * v)`` by all that the ticks were given, backwards in one pass.

            step.pull(w).by("q"), step.pull(w).by("hand", "target")         # [n, nq], [n, 12]

        It is by the numbers as they are: of a pose by those of its rotation, column by column, and its position, of a
        quaternion by its four; along what these may not do it means nothing. Robots whose rows do not all hold have
        zeros, see :attr:`solved`.

        Args:
            weights: [n, nv].

        Raises:
            ShapeError, NotFiniteError: bad weights. SolverError: the batch has gone on since; strict levels, soft rows,
                spheres and capsules to keep clear of, calm stacks, or accelerations. CompileError: no compiler.
        """
        inputs = self._kept
        if inputs is None:
            self._given("q")
            inputs = self._owner.inputs
        w = numbers.rows("weights", weights, len(self), self._context.nv)
        good = self.solved
        if good.all():
            return Pulled(self._owner.pullback.find(w, self._reports, inputs), self._context)
        found = self._owner.pullback.find(w[good], self._reports[good], inputs[good])
        whole = {name: np.zeros((len(self), part.shape[1])) for name, part in found.items()}
        for name, part in found.items():
            whole[name][good] = part
        return Pulled(whole, self._context)

    def __repr__(self) -> str:
        codes, names = self.status_codes, list(Status)
        counts = {names[code]: int((codes == code).sum()) for code in np.unique(codes).tolist()}
        return f"BatchStep({', '.join(f'{count} {status}' for status, count in counts.items())})"
