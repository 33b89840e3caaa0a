"""Distance rows that C computes in loops: of balls and segments of links (``native/balls.h``), and of sensed pairs
(``native/sensed.h``). Here are the segments as expressions, and the tables that the loops need.
"""

from __future__ import annotations

from functools import cached_property

import casadi as ca
import numpy as np

from wbc.quick_dataclasses import dataclass
from wbc.stack.declaration import Declaration
from wbc.stack.layout import Block, Layout
from wbc.symbolic.kinematics import Kinematics, frame_index
from wbc.symbolic.tracer import Tracer
from wbc.tasks._ball import BallRow
from wbc.tasks.base import Constraint


@dataclass(frozen=True, eq=False)
class BallBlock:
    """The block of one ball; for each of its rows what it is and which velocities move it."""

    block: Block
    rows: tuple[BallRow, ...]
    columns: tuple[tuple[int, ...], ...]


@dataclass(frozen=True, eq=False)
class Balls:
    """All rows of a stack that are left to the loop, item by item."""

    items: tuple[BallBlock, ...] = ()

    @classmethod
    def of(cls, stack: Declaration, layout: Layout) -> Balls:
        """Those of a stack."""
        model, out = stack.robot.tree, []
        for block in layout.of_form("margins"):
            assert isinstance(block.entry.item, Constraint)
            rows = block.entry.item.ball_rows(stack.robot)
            # the loop knows balls in the world only
            if not rows or block.entry.frame or not _same_author(type(block.entry.item)):
                continue
            joints = [int(model.frames[frame_index(model, row.link)].parentJoint) for row in rows]
            moved = [[j for j in model.supports[joint] if j] for joint in joints]
            columns = [
                tuple(k for j in chain for k in range(model.idx_vs[j], model.idx_vs[j] + model.nvs[j]))
                for chain in moved
            ]
            out.append(BallBlock(block, rows, tuple(columns)))
        return cls(tuple(out))

    def __bool__(self) -> bool:
        return bool(self.items)

    def __contains__(self, name: object) -> bool:
        return any(item.block.entry.name == name for item in self.items)

    @cached_property
    def _rows(self) -> list[tuple[int, BallRow, tuple[int, ...]]]:
        """(general row, what it is, its columns)."""
        return [
            (item.block.start + k, row, columns)
            for item in self.items
            for k, (row, columns) in enumerate(zip(item.rows, item.columns, strict=True))
        ]

    @cached_property
    def _segments(self) -> dict[tuple[str, int, float], int]:
        """Number of each segment."""
        return {key: k for k, key in enumerate(dict.fromkeys(row.segment_key for _, row, _ in self._rows))}

    @cached_property
    def _first(self) -> list[tuple[int, BallRow]]:
        """(general row, what it is) of the first row of each segment."""
        first: dict[tuple[str, int, float], tuple[int, BallRow]] = {}
        for general, row, _ in self._rows:
            first.setdefault(row.segment_key, (general, row))
        return [first[key] for key in self._segments]

    @property
    def segment_rows(self) -> list[int]:
        """A general row of each segment."""
        return [general for general, _ in self._first]

    @property
    def halves(self) -> list[float]:
        """Half the length of each segment [m]."""
        return [row.length / 2 for _, row in self._first]

    @property
    def reaches(self) -> list[float]:
        """Distance at contact of each row's segment to its ball's centre [m]."""
        return [row.reach for _, row, _ in self._rows]

    def segments(self, kinematics: Kinematics) -> ca.SX:
        """(middle; axis) of each segment, segments x 6."""
        tracer = Tracer(kinematics)
        columns = [row.segment(tracer) for _, row in self._first]
        return ca.densify(tracer.expand(ca.horzcat(ca.SX(6, 0), *columns).T))

    def entries(self, start: np.ndarray, column: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(start, end, column) of the entries of all general rows, from those of the expressions' rows, which keep
        their places.
        """
        begin, end, count = start[:-1].copy(), start[1:].copy(), len(column)
        more: list[int] = []
        for general, _, columns in self._rows:
            begin[general], end[general] = count, count + len(columns)
            count += len(columns)
            more += columns
        return begin, end, np.concatenate([column, np.array(more, dtype=column.dtype)])

    def places(self) -> dict[str, list[int]]:
        """The integer tables of ``native/tick.h`` by name."""
        slots = [item.block.slots for item in self.items]
        return {
            "ball_pose": [s["pose"].start for s in slots],
            "ball_velocity": [s["velocity"].start for s in slots],
            "ball_margin": [s["margin"].start for s in slots],
            "ball_rate": [s["rate"].start for s in slots],
            "ball_row": [item.block.start for item in self.items],
            "ball_first": np.cumsum([0, *(len(item.rows) for item in self.items)]).tolist(),
            "row_segment": [self._segments[row.segment_key] for _, row, _ in self._rows],
            "segment_row": self.segment_rows,
        }


def _same_author(kind: type) -> bool:
    """Whether ``ball_rows`` is not older than ``margins``; else the class has changed the margins of another."""
    order = [base for base in kind.__mro__ if {"margins", "ball_rows"} & vars(base).keys()]
    return "ball_rows" in vars(order[0])


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
