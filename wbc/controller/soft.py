"""What soft rows give up, and at which share of their command scaled tasks are followed."""

from __future__ import annotations

import numpy as np

from wbc.qp.problem import QP
from wbc.stack.declaration import Declaration
from wbc.stack.layout import Layout
from wbc.stack.places import slack_places, told_slacks
from wbc.tasks._direction import Direction
from wbc.validation import Array


class SoftRows:
    """Soft rows of one layout; ``of`` is the variable that is the slack of each general row, -1 for rows without."""

    def __init__(self, stack: Declaration, layout: Layout) -> None:
        self.of = np.array(slack_places(stack, layout), dtype=np.intp)
        self._rows = np.flatnonzero(self.of >= 0)
        self._told = np.array(told_slacks(stack, layout))[self._rows]

    def told(self, qp: QP, v: Array, sides: tuple[Array, Array], slack: Array) -> Array:
        """``slack`` of the general rows with the violations of those that are soft."""
        rows = self._rows
        if not rows.size:
            return slack
        at = qp.A[rows] @ v - qp.A[rows, self.of[rows]] * v[self.of[rows]]
        missed = np.maximum(sides[0][rows] - at, at - sides[1][rows])
        out = slack.copy()
        out[rows] = np.where(missed > self._told, missed, 0.0)
        return out


def scales(layout: Layout, variables: Array) -> dict[str, float]:
    """lambda of every scaled task by its name."""
    return {
        block.entry.item.of: float(np.clip(1.0 - variables[block.variables.stop - 1], 0.0, 1.0))
        for block in layout.of_form("rows")
        if isinstance(block.entry.item, Direction)
    }
