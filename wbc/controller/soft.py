"""What soft rows give up, and at which share of their command scaled tasks are followed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wbc.qp.polish import polish
from wbc.qp.problem import QP, Solution
from wbc.qp.relax import Relaxed
from wbc.stack.declaration import Declaration
from wbc.stack.layout import Layout
from wbc.stack.places import told_slacks
from wbc.tasks._direction import Direction
from wbc.validation import Array

#: A task that asks for less than this is followed, whatever it does [rad/s, lengths per second]
ASKED = 1e-9


class SoftRows:
    """Soft rows of one layout."""

    def __init__(self, stack: Declaration, layout: Layout) -> None:
        self._rows = np.flatnonzero(np.array(layout.price_at, dtype=np.intp) >= 0)
        self._told = np.array(told_slacks(stack, layout))[self._rows]

    def told(self, qp: QP, v: Array, sides: tuple[Array, Array], slack: Array) -> Array:
        """``slack`` of the general rows with the violations of those that are soft."""
        rows = self._rows
        if not rows.size:
            return slack
        at = qp.A[rows] @ v
        missed = np.maximum(sides[0][rows] - at, at - sides[1][rows])
        out = slack.copy()
        out[rows] = np.where(missed > self._told, missed, 0.0)
        return out

    def polished(self, qp: QP, answer: Relaxed) -> Relaxed:
        """The answer at rounding level, where there are soft rows: nearly dependent ones leave solvers less."""
        if not self._rows.size:
            return answer
        sides = QP(qp.H, qp.g, answer.lower, answer.upper, qp.A)
        found = polish(sides, Solution(answer.x, answer.multipliers, "solved"))
        if not found.exact:
            return answer
        n = qp.n
        x = np.clip(found.solution.x, answer.lower[:n], answer.upper[:n])
        return replace(answer, x=x, multipliers=found.solution.multipliers)


def scales(layout: Layout, variables: Array, errors: Array) -> dict[str, float]:
    """lambda of every scaled task by its name; ``errors`` of all task rows have the speeds that are asked for."""
    named = [b.entry.item.of for b in layout.of_form("rows") if isinstance(b.entry.item, Direction)]
    return {
        name: float(np.clip(variables[variable] / errors[row], 0.0, 1.0)) if errors[row] > ASKED else 1.0
        for name, (row, variable) in zip(named, layout.share_rows.items(), strict=True)
    }
