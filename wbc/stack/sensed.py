"""Rows of sensed pairs for the loop in ``native/sensed.h``: where their numbers are in the parameters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.stack.declaration import Declaration
from wbc.stack.layout import Block, Layout
from wbc.tasks.base import Constraint


@dataclass(frozen=True, eq=False)
class Sensed:
    """Blocks with sensed rows, which are their last ones, and how many they are."""

    blocks: tuple[tuple[Block, int], ...] = ()
    nv: int = 0

    @classmethod
    def of(cls, stack: Declaration, layout: Layout) -> Sensed:
        """Those of a stack."""
        out = []
        for block in layout.of_form("margins"):
            assert isinstance(block.entry.item, Constraint)
            count = block.entry.item.sensed_rows(stack.robot)
            if count:
                out.append((block, count))
        return cls(tuple(out), layout.nv)

    def __bool__(self) -> bool:
        return bool(self.blocks)

    def entries(
        self, begin: np.ndarray, end: np.ndarray, column: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(start, end, column) of the entries of all general rows: those of a sensed one are in all columns, after
        those that are there.
        """
        begin, end, count = begin.copy(), end.copy(), len(column)
        rows = np.concatenate([np.zeros(0, dtype=np.int64), *(self._rows(block, k) for block, k in self.blocks)])
        begin[rows] = count + self.nv * np.arange(len(rows))
        end[rows] = begin[rows] + self.nv
        return begin, end, np.concatenate([column, np.tile(np.arange(self.nv, dtype=column.dtype), len(rows))])

    def places(self) -> dict[str, list[int]]:
        """The integer tables of ``native/tick.h`` by name."""
        starts = {name: [b.slots[name].start for b, _ in self.blocks] for name in ("distance", "line", "side")}
        return {
            "sensed_row": [block.span.stop - count for block, count in self.blocks],
            "sensed_count": [count for _, count in self.blocks],
            **{f"sensed_{name}": places for name, places in starts.items()},
        }

    @staticmethod
    def _rows(block: Block, count: int) -> np.ndarray:
        return np.arange(block.span.stop - count, block.span.stop)
