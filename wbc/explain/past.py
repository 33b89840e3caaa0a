"""A tick that is over, set up again from a step's copy of its state."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from wbc.errors import SolverError
from wbc.qp.levels.hierarchy import Hierarchy, LevelsAnswer
from wbc.qp.levels.sensitivity import FrozenLevels
from wbc.qp.problem import QP
from wbc.qp.relax import Relaxed
from wbc.stack.declaration import Declaration
from wbc.stack.layout import Block, Layout
from wbc.stack.memory import Memory
from wbc.tasks._direction import Direction
from wbc.tasks.mechanism import Mechanism
from wbc.tick.context import Context
from wbc.tick.native import CompiledTick
from wbc.tick.solved import SolvedTick
from wbc.validation import Array


@dataclass(frozen=True, eq=False)
class Frozen:
    """Strict levels of a tick that can be differentiated.

    Attributes:
        qp, first: the first level's QP and its answer. answer: of all levels. optimum: as a function of numbers.
        numbers: (QP of the buffers, answer of its first level) -> the numbers of all levels, in units of ``sizes``.
        sizes: of v, then of general rows.
    """

    qp: QP
    first: Relaxed
    answer: LevelsAnswer
    optimum: FrozenLevels
    numbers: Callable[[QP, Array], Hierarchy]
    sizes: Array


class PastTick:
    """Buffers as the tick found them, the QP that it solved, and the same with items switched off.

    Attributes:
        qp: what the tick solved. report: what it reported. usable: the numbers of the QP are finite.
        owner_low, owner_high: bound block that sets each simple bound, -1 for none.
    """

    def __init__(self, data: bytes, stack: Declaration, layout: Layout, assembly: CompiledTick) -> None:
        self.stack, self.layout = stack, layout
        self.places = Memory(layout)
        self.tick = assembly.twin()
        self.tick.state[:] = np.frombuffer(data, count=self.tick.state.size)
        self.tick.v_last[:] = self.tick.v_in
        self.tick.use_v[0] = 0.0
        self.report = self.tick.report.copy()
        with np.errstate(all="ignore"):
            self.qp = self.tick.qp()
        self.usable = self.tick.usable
        low, high = (self.tick.report[self.places[name]].astype(int) for name in ("owner_low", "owner_high"))
        self.owner_low, self.owner_high = low, high
        self._solver = SolvedTick(self.tick, stack, layout, "daqp")

    def part(self, name: str) -> Array:
        """A part of the report."""
        return self.report[self.places[name]]

    @contextmanager
    def without(self, blocks: Iterable[Block]) -> Iterator[None]:
        """Items off, and on again."""
        tick, nv = self.tick, self.layout.variables
        before = tick.weight.copy(), tick.enabled.copy(), tick.bound_enabled.copy()
        for block in blocks:
            if block.form == "task":
                tick.weight[block.span] = 0.0
                for kept in self._kept_for(block):
                    tick.enabled[kept.span] = 0.0
            elif block.form == "bounds":
                tick.bound_enabled[block.start * nv : (block.start + 1) * nv] = 0.0
            else:
                tick.enabled[block.span] = 0.0
        yield
        tick.weight[:], tick.enabled[:], tick.bound_enabled[:] = before

    def _kept_for(self, task: Block) -> list[Block]:
        """What keeps the direction of a scaled task."""
        rows = self.layout.of_form("rows")
        return [b for b in rows if isinstance(b.entry.item, Direction) and b.entry.item.of == task.entry.name]

    def solve(self) -> tuple[Array, Relaxed | None]:
        """Command, and the answer to the QP with slacks, at the buffers' values; no answer for a tick that brakes."""
        qp = self.tick.qp()
        _, x, answer = self._solver.answer(qp.with_slacks())
        return self._solver.below(qp, x[: qp.n], answer)[0], answer

    def frozen(self) -> Frozen | None:
        """The strict levels of the buffers as they are, as a function of their numbers; None where a row gave way, a
        level was not solved, or there is one level only.
        """
        levels = self._solver.levels
        if levels is None or not self.usable:
            return None
        qp = self.tick.qp()
        _, v, first = self._solver.answer(qp.with_slacks())
        answer = self._solver.below(qp, v, first)[1]
        if first is None or first.flag != "solved" or answer is None or not all(x.solved for x in answer.levels):
            return None
        problem = levels.problem(qp, v, first.lower, first.upper)[0]
        optimum = FrozenLevels(levels.cascade, problem, answer)
        return Frozen(qp, first, answer, optimum, self._hierarchy, levels.sizes)

    def _hierarchy(self, qp: QP, v: Array) -> Hierarchy:
        assert self._solver.levels is not None
        return self._solver.levels.problem(qp, v, qp.lower, qp.upper)[0]

    def is_on(self, block: Block) -> bool:
        """Any of an item's rows counts."""
        if block.form == "task":
            return bool(self.tick.weight[block.span].any())
        if block.form == "bounds":
            nv = self.layout.variables
            return bool(self.tick.bound_enabled[block.start * nv : (block.start + 1) * nv].any())
        return bool(self.tick.enabled[block.span].any())

    def broken(self) -> tuple[str, ...]:
        """Items that are on and whose numbers make the QP unusable."""
        if self.usable:
            return ()
        blocks, found = [b for b in self.layout.blocks.values() if self.is_on(b)], []
        for block in blocks:
            with self.without(b for b in blocks if b is not block), np.errstate(all="ignore"):
                self.tick.qp()
                if not self.tick.usable:
                    found.append(block.entry.name)
        return tuple(found)

    def others(self, block: Block) -> list[Block]:
        """Every item but one and what the mechanism itself asks for."""
        return [b for b in self.layout.blocks.values() if b is not block and not isinstance(b.entry.item, Mechanism)]

    def task_rows(self, block: Block) -> tuple[Array, Array]:
        """(J, w) of a task's rows that count, J v - w being what each misses."""
        self.tick.qp()
        return rows_of(self.tick, block)


def rows_of(tick: CompiledTick, block: Block) -> tuple[Array, Array]:
    """:meth:`PastTick.task_rows` of the QP that any tick of the same code assembled last."""
    tasks, span = tick.task_rows(), block.span
    counts = (tick.weight[span] > 0.0) & (tasks.factor[span] > 0.0)
    return np.where(counts[:, None], tasks.J[span], 0.0), np.where(counts, tasks.desired[span], 0.0)


def past_of(data: bytes, context: Context) -> PastTick:
    """The tick of a step again, in memory of its own.

    Raises:
        SolverError: the step comes from a pickle, which holds no code to set its tick up with.
    """
    if context.assembly is None:
        raise SolverError("step", None, "comes from a pickle; ask in the process that made it")
    return PastTick(data, context.stack, context.layout, context.assembly)
