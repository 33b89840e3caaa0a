"""What a step tells about its strict levels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wbc.controller.report import INFINITE, LEVEL_NUMBERS
from wbc.stack.layout import Block, Layout
from wbc.validation import Array

#: Rows of which less than this part is free are dropped
GONE = 1e-6


@dataclass(frozen=True)
class Dropped:
    """A row that depends on others, so that it decides nothing: what it asks for and the others do not give, in
    ``unit``, is its ``inconsistency`` (0: it is redundant).
    """

    item: str
    row: str
    inconsistency: float
    unit: str

    def __str__(self) -> str:
        return f"{self.item}/{self.row} off by {self.inconsistency:.3g} {self.unit}"


@dataclass(frozen=True)
class LevelCertificate:
    """What became of one level; lengths in radians, metres over the characteristic length, per second.

    Attributes:
        level: its number; None for the least velocity that decides what no level does.
        rank: directions that the level takes. free: directions that it leaves to later ones.
        singular: a lower bound of the least singular value of the directions that it takes; inf if it takes none.
        damping: how far damping near rank loss moves the level's weighted rows from the undamped least squares, or a
            bound on it; 0 away from rank loss.
        disturbance: largest change of its rows by later levels.
        stationarity, complementarity: residuals of its optimality conditions.
        error_bound: bound on its |v - v*|, given the rows that bind and the rounding of the levels before.
        solved: its optimum was found; otherwise the tick goes on from the level before.
        dropped: rows that earlier levels, equalities or binding rows decide; of equality rows at the first level.
    """

    level: int | None
    rank: int
    free: int
    singular: float
    damping: float
    disturbance: float
    stationarity: float
    complementarity: float
    error_bound: float
    solved: bool
    dropped: tuple[Dropped, ...]


def certificates(layout: Layout, part: Callable[[str], Array]) -> tuple[LevelCertificate, ...]:
    """One for each level of a report, and one for what is left after them; nothing for a braked tick."""
    numbers = part("levels").reshape(len(layout.levels) + 1, len(LEVEL_NUMBERS))
    if not numbers[:, LEVEL_NUMBERS.index("solved")].any():
        return ()
    return tuple(_certificate(layout, part, place, row) for place, row in enumerate(numbers))


def _certificate(layout: Layout, part: Callable[[str], Array], place: int, numbers: Array) -> LevelCertificate:
    known = {name: np.inf if x >= INFINITE else float(x) for name, x in zip(LEVEL_NUMBERS, numbers, strict=True)}
    last = place == len(layout.levels)
    return LevelCertificate(
        level=None if last else layout.levels[place],
        rank=int(known["rank"]),
        free=int(known["free"]),
        singular=known["singular"],
        damping=known["damping"],
        disturbance=known["disturbance"],
        stationarity=known["stationarity"],
        complementarity=known["complementarity"],
        error_bound=known["error"],
        solved=known["solved"] > 0.0,
        dropped=() if last else _dropped(layout, part, place),
    )


def _dropped(layout: Layout, part: Callable[[str], Array], place: int) -> tuple[Dropped, ...]:
    out: list[Dropped] = []
    if place == 0:
        off = part("dropped")
        for block in layout.of_form("margins", "rows"):
            out += [_row(block, k, off[block.start + k]) for k in np.flatnonzero(off[block.span] >= 0.0).tolist()]
    share, missed = part("share"), part("missed")
    for block in layout.of_form("task"):
        if block.entry.level == layout.levels[place]:
            gone = np.flatnonzero(share[block.span] <= GONE).tolist()
            out += [_row(block, k, abs(missed[block.start + k])) for k in gone]
    return tuple(out)


def _row(block: Block, row: int, off: float) -> Dropped:
    unit = block.rows[row].unit
    per_second = unit if unit.endswith("/s") else f"{unit or '1'}/s"
    return Dropped(block.entry.name, block.rows[row].label, float(off), per_second)
