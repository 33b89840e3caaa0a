"""What the tick of one pair writes, and where: positions in flat arrays and in the controller's buffer."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.api import Controller
from wbc.controller import core_of
from wbc.coordinates.control.integrals import RateIntegrals, Rows
from wbc.coordinates.control.pair_stack import PairStack, metric_of
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
        speeds: (input, rows) of every coordinate's rate.
        integral_rows: rows of coordinates with integrals that count. offsets, drifts: (input, rows) of those that are
            commanded and of those that are held.
    """

    items: frozenset[str]
    task_rows: Rows
    held_rows: Rows
    speeds: tuple[tuple[Slot, slice], ...]
    integral_rows: Rows
    offsets: tuple[tuple[Slot, slice], ...]
    drifts: tuple[tuple[Slot, slice], ...]

    def write(self, controller: Controller, rates: Array) -> None:
        """Rates of all coordinates into the inputs of this pair's."""
        core = core_of(controller)
        for slot, rows in self.speeds:
            core.write(slot, rates[rows])

    def write_integrals(self, controller: Controller, integrals: RateIntegrals) -> None:
        """What coordinates are ahead of their integrals by; what is commanded makes up for little of it."""
        core = core_of(controller)
        for slot, rows in self.offsets:
            integrals.cap(rows, LAG)
            core.write(slot, -integrals.off[rows])
        for slot, rows in self.drifts:
            core.write(slot, integrals.off[rows])


def served(
    controller: Controller, declared: PairStack, pair: CoordinatePair, rates: RateMatrices, masked: set[Coordinate]
) -> Served:
    """What the tick of a pair writes; ``masked``: coordinates that have integrals."""
    blocks = core_of(controller).layout.blocks
    slices = rates.row_slices
    follow = {one: declared.follow[one, metric_of(pair, one)] for one in pair.task}
    keep = {one: declared.keep[one] for one in pair.constraint}
    tall = sum(slices[one].stop - slices[one].start for one in pair.rows) > rates.robot.nv
    items = follow | keep
    offsets = [] if tall else [one for one in pair.task if one in masked]
    drifts = [one for one in pair.constraint if one in masked]
    counted = [one for one in pair.rows if one in masked]
    return Served(
        frozenset(items.values()),
        _rows(rates, pair.task),
        _rows(rates, pair.constraint),
        tuple((blocks[name].slots["speed"], slices[one]) for one, name in items.items()),
        _rows(rates, counted),
        tuple((blocks[follow[one]].slots["offset"], slices[one]) for one in offsets),
        tuple((blocks[keep[one]].slots[DRIFT], slices[one]) for one in drifts),
    )


def _rows(rates: RateMatrices, some: tuple[Coordinate, ...] | list[Coordinate]) -> Rows:
    """Numbers of the rows of some coordinates."""
    found = [np.arange(rates.row_slices[one].start, rates.row_slices[one].stop) for one in some]
    return np.concatenate([np.zeros(0, dtype=np.intp), *found])
