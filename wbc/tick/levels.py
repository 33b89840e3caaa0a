"""Strict levels of a tick: from the optimum of the first level's QP to the command, see docs/levels.md."""

from __future__ import annotations

import numpy as np

from wbc.qp.certificate import Certificate
from wbc.qp.levels.cascade import NOISE, PUSHING, Cascade
from wbc.qp.levels.hierarchy import Hierarchy, Level, LevelsAnswer
from wbc.qp.problem import QP
from wbc.qp.relax import Relaxed
from wbc.stack.codegen import row_units
from wbc.stack.declaration import Declaration
from wbc.stack.layout import Layout
from wbc.stack.memory import LEVEL_NUMBERS, Memory
from wbc.stack.tables import left_free
from wbc.tick.buffers import INFINITE
from wbc.tick.native import CompiledTick
from wbc.validation import Array


class Levels:
    """The cascade of one layout, in the units of :mod:`wbc.qp.levels.cascade`: v / dof scales, rows / their scales.

    Attributes:
        cascade: what solves them. sizes: these scales, of v and of general rows.
    """

    def __init__(self, assembly: CompiledTick, stack: Declaration, layout: Layout) -> None:
        self._assembly, self._layout = assembly, layout
        self._dofs, self._scales = layout.dof_scales(stack), layout.row_scales(stack)
        self._units = np.array(row_units(stack, layout), dtype=np.float64)
        self._row_levels = np.array(layout.row_levels, dtype=np.int_)
        self._price_at = np.array(layout.price_at, dtype=np.intp)
        self._damping = stack.damping
        self.cascade = Cascade(layout.variables, layout.general_rows, left_free(stack), stack.damping)
        self.sizes = np.concatenate((self._dofs, self._units))
        self._memory = Memory(layout)

    def reset(self) -> None:
        """Forget the active sets of the last tick."""
        self.cascade.reset()

    def below(self, qp: QP, v: Array, first: Relaxed | None, report: Array) -> tuple[Array, LevelsAnswer | None]:
        """The command and the answer of all levels, which is written to the report; v where the tick brakes.

        Args:
            qp: the first level's. v: its answer. first: the same with its bounds and multipliers, None for none.
        """
        if first is None:
            self._write(None, v, report)
            return v, None
        problem, scales = self.problem(qp, v, first.lower, first.upper)
        nv, answer = self._layout.variables, self.cascade.solve(problem)
        answer.multipliers *= np.append(scales, 1.0)[answer.pushes] / self.sizes
        if first.flag == "solved":
            self._held_by_equalities(problem, qp, first, answer)
        command = np.clip(answer.x * self._dofs, first.lower[:nv], first.upper[:nv])
        self._write(answer, command, report)
        return command, answer

    def _held_by_equalities(self, problem: Hierarchy, qp: QP, first: Relaxed, answer: LevelsAnswer) -> None:
        """Multipliers of the equality rows that push against the first level: those of its QP, which has them all."""
        push = np.abs(first.multipliers) * self.sizes
        drive = max(float(np.abs(qp.g * self._dofs).max(initial=0.0)), float(push.max(initial=0.0)))
        push[qp.n :] *= np.linalg.norm(problem.A, axis=1)
        held = (qp.lower == qp.upper) & (push > max(PUSHING * drive, NOISE))
        answer.multipliers[held], answer.pushes[held] = first.multipliers[held], 0

    def problem(self, qp: QP, v: Array, lower: Array, upper: Array) -> tuple[Hierarchy, list[float]]:
        """(all levels, from a command v of the first and bounds of its rows; the heaviest weight of each level)."""
        nv, soft = self._layout.variables, self._row_levels >= 0
        low, high = (
            np.concatenate((ends[:nv], np.where(soft, own, ends[nv:]))) / self.sizes
            for ends, own in zip((lower, upper), self._assembly.row_bounds(), strict=True)
        )
        levels, scales = self._levels(qp)
        A = qp.A * self._dofs / self._units[:, None]
        return Hierarchy(v / self._dofs, low, high, A, levels), scales

    def with_soft(self, qp: QP, v: Array, slack: Array) -> Array:
        """Slack of general rows with that of the rows that are minimised at a level."""
        low, high = self._assembly.row_bounds()
        at = qp.A @ v
        return np.where(self._row_levels >= 0, np.maximum(0.0, np.maximum(low - at, at - high)), slack)

    @staticmethod
    def certified(answer: LevelsAnswer, violation: float) -> Certificate:
        """The certificate of all levels together."""
        return Certificate(
            max(level.stationarity for level in answer.levels),
            violation,
            max(level.complementarity for level in answer.levels),
            answer.levels[-1].error,
        )

    def _levels(self, qp: QP) -> tuple[list[Level], list[float]]:
        """The levels, and the weight of the heaviest row of each."""
        layout, tasks, dofs = self._layout, self._assembly.task_rows(), self._dofs
        weight = self._assembly.weight * self._scales**2
        counts = (weight > 0.0) & (tasks.factor > 0.0)
        fading = np.sqrt(np.where(counts, tasks.factor, 0.0)) / self._scales
        rows, desired = fading[:, None] * tasks.J * dofs, fading * tasks.desired
        out, scales = [], []
        for place in range(len(layout.levels)):
            span = layout.level_rows(place)
            soft = np.flatnonzero(self._row_levels == place)
            prices = np.where(self._price_at[soft] >= 0, self._assembly.p[self._price_at[soft]], 1.0)
            soft, prices = soft[prices > 0.0], prices[prices > 0.0]
            scale = max(float(weight[span][counts[span]].max(initial=0.0)), float(prices.max(initial=0.0))) or 1.0
            relative = np.where(counts[span], weight[span] / scale, 0.0)
            wanted = rows[span].T @ (relative * desired[span])
            second = None
            if place == 0 and layout.leading:
                wanted = -qp.g * dofs / scale
                change = qp.H * np.outer(dofs, dofs) / scale - rows[span].T @ (relative[:, None] * rows[span])
                curvature = self._assembly.curvature()
                if curvature is not None:
                    second = change, curvature * np.outer(dofs, dofs) / scale
            out.append(Level(rows[span], relative, wanted, soft, prices / scale, second))
            scales.append(scale)
        return out, scales

    def _write(self, answer: LevelsAnswer | None, v: Array, report: Array) -> None:
        memory, tasks = self._memory, self._assembly.task_rows()
        share = np.zeros(self._layout.task_rows)
        report[memory["missed"]] = tasks.J @ v - tasks.desired
        report[memory["share"]] = share
        report[memory["dropped"]] = report[memory["pushes"]] = -1.0
        report[memory["levels"]] = 0.0
        if answer is None:
            return
        for place, level in enumerate(answer.levels[:-1]):
            share[self._layout.level_rows(place)] = level.share
        report[memory["share"]] = share
        report[memory["dropped"]] = np.where(answer.dropped >= 0.0, answer.dropped * self._units, -1.0)
        report[memory["pushes"]] = answer.pushes
        numbers = [[min(float(getattr(level, name)), INFINITE) for name in LEVEL_NUMBERS] for level in answer.levels]
        report[memory["levels"]] = np.ravel(numbers)
