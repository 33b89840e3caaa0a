"""What keeps the direction of a scaled task follows the task's weight and switches."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from wbc.controller.tick import Buffers
from wbc.stack.layout import Layout
from wbc.tasks._direction import DIRECTION_PRICE, Direction

if TYPE_CHECKING:
    from wbc.controller.handle import Handle


class Directions:
    """The scaled tasks of one controller."""

    def __init__(self, layout: Layout, tick: Buffers, handles: Mapping[str, Handle]) -> None:
        self._layout, self._tick, self._handles = layout, tick, handles
        named = [(b.entry.name, b.entry.item.of) for b in layout.of_form("rows") if isinstance(b.entry.item, Direction)]
        #: name of the task, by its own name and by that of what keeps its direction
        self._tasks = dict(named) | {task: task for _, task in named}
        self._keepers = {task: kept for kept, task in named}

    def follow(self, name: str) -> None:
        """A task, or what keeps its direction, has another weight or other switches: rows that count, and the price."""
        task = self._tasks.get(name)
        if task is None:
            return
        kept = self._keepers[task]
        block, keeper = self._layout.blocks[task], self._layout.blocks[kept]
        counts = (self._tick.weight[block.span] > 0.0) & self._handles[kept].enabled
        on = np.append(counts, counts.any()) * self._handles[kept].mask
        self._tick.enabled[keeper.span] = on
        self._tick.p[keeper.slots["price"].span] = DIRECTION_PRICE * self._handles[task].weight
