"""What the tick of one pair writes, and where: positions in flat arrays and in the controller's buffer."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.api import Controller
from wbc.controller import core_of
from wbc.coordinates.control.integrals import RateIntegrals, Rows
from wbc.coordinates.control.pair_stack import PairStack
from wbc.coordinates.expressions import DRIFT
from wbc.coordinates.pair import CoordinatePair
from wbc.coordinates.rate_matrices import RateMatrices
from wbc.coordinates.rows import Coordinate
from wbc.stack.layout import Slot
from wbc.validation import Array

#: Commanded rows that are rates only lag their integral by this at most [m, rad]; what limits take is not made up for
LAG = 5e-4


@dataclass(frozen=True, eq=False)
class Served:
    """A pair in a controller.

    Attributes:
        items: names of its items. task_rows, held_rows: its rows among those of all coordinates.
        speeds: (input, rows) of every item's rates.
        integral_rows: rows of coordinates with integrals that count. offset: (input, rows) of the task, where some of
            it counts. drifts: of what is held.
    """

    items: frozenset[str]
    task_rows: Rows
    held_rows: Rows
    speeds: tuple[tuple[Slot, slice | Rows], ...]
    integral_rows: Rows
    offset: tuple[Slot, Rows] | None
    drifts: tuple[tuple[Slot, slice], ...]

    def write(self, controller: Controller, rates: Array) -> None:
        """Rates of all coordinates into the inputs of this pair's."""
        core = core_of(controller)
        for slot, rows in self.speeds:
            core.write(slot, rates[rows])

    def write_integrals(self, controller: Controller, integrals: RateIntegrals) -> None:
        """What coordinates are ahead of their integrals by; what is commanded makes up for little of it."""
        core = core_of(controller)
        if self.offset is not None:
            slot, rows = self.offset
            integrals.cap(rows, LAG)
            core.write(slot, -integrals.off[rows])
        for slot, held in self.drifts:
            core.write(slot, integrals.off[held])


def served(
    controller: Controller, declared: PairStack, pair: CoordinatePair, rates: RateMatrices, masked: set[Coordinate]
) -> Served:
    """What the tick of a pair writes; ``masked``: coordinates that have integrals."""
    blocks = core_of(controller).layout.blocks
    slices = rates.row_slices
    follow, task_rows = declared.follow[pair.name], _rows(rates, pair.task)
    keep = {one: declared.keep[one] for one in pair.constraint}
    tall = sum(slices[one].stop - slices[one].start for one in pair.rows) > rates.robot.nv
    offset = None if tall or masked.isdisjoint(pair.task) else (blocks[follow].slots["offset"], task_rows)
    drifts = [one for one in pair.constraint if one in masked]
    counted = [one for one in pair.rows if one in masked]
    return Served(
        frozenset({follow, *keep.values()}),
        task_rows,
        _rows(rates, pair.constraint),
        (
            (blocks[follow].slots["speed"], task_rows),
            *((blocks[name].slots["speed"], slices[one]) for one, name in keep.items()),
        ),
        _rows(rates, counted),
        offset,
        tuple((blocks[keep[one]].slots[DRIFT], slices[one]) for one in drifts),
    )


def _rows(rates: RateMatrices, some: tuple[Coordinate, ...] | list[Coordinate]) -> Rows:
    """Numbers of the rows of some coordinates."""
    found = [np.arange(rates.row_slices[one].start, rates.row_slices[one].stop) for one in some]
    return np.concatenate([np.zeros(0, dtype=np.intp), *found])
