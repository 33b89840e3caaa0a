"""What a step reports of its tick: how it ended, which rows push or gave way, errors of tasks, certificates."""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum

import numpy as np

from wbc.quick_dataclasses import dataclass
from wbc.stack.layout import Block, Layout, rate_unit
from wbc.stack.memory import LEVEL_NUMBERS
from wbc.tasks._direction import Direction
from wbc.tick.buffers import CHAIN, INFINITE
from wbc.validation import Array


class Status(StrEnum):
    """How a tick ended."""

    #: Every constraint row holds, v is the optimum
    SOLVED = "solved"
    #: Rows could not all hold: some gave way in the declared order, see :attr:`Step.relaxed`
    RELAXED = "relaxed"
    #: No optimum was found: v brings every joint to rest as fast as its bounds allow
    BRAKED = "braked"
    #: :attr:`wbc.Controller.iteration_cap` ended the search: v is as near to what it had found as the rows allow, seen
    #: from braking
    CAPPED = "capped"
    #: The first answer had no certificate; another way led to one that has, see :attr:`Step.answered_by`. Rows may have
    #: given way, see :attr:`Step.relaxed`
    RECOVERED = "recovered"
    #: Of pairs, see :class:`wbc.coordinates.PairStep`: solved, within 0.02 rad of where the active pair loses a rank:
    #: task and constraint depend on each other there, the task's own rows do, or those of the constraint
    ALGORITHMIC = "algorithmic"
    TASK = "task"
    CONSTRAINT = "constraint"


#: By the tick's flag
STATUSES: tuple[Status, ...] = (Status.SOLVED, Status.RELAXED, Status.BRAKED, Status.CAPPED)
STATUSES += (*[Status.RECOVERED] * len(CHAIN), Status.BRAKED, Status.BRAKED, Status.SOLVED)
#: What gave the command, by the tick's flag
ANSWERED = ("", "", "", "", *CHAIN, "braking", "policy", "escape")


@dataclass(frozen=True)
class Binding:
    """A row that pushes: ``item`` and ``row`` names, ``bound`` (lower, upper, equal), its multiplier.

    ``level``: the first level whose optimum it pushes against, None for the least velocity after all levels.
    """

    item: str
    row: str
    bound: str
    multiplier: float
    level: int | None = 0

    def __str__(self) -> str:
        return f"{self.item}/{self.row} {self.bound}"


@dataclass(frozen=True)
class Slack:
    """A row that gave way: by how much, in its unit per second (rows) or 1/s times its unit (margins)."""

    item: str
    row: str
    amount: float
    unit: str

    def __str__(self) -> str:
        return f"{self.item}/{self.row} by {self.amount:.3g} {self.unit}"


@dataclass(frozen=True, eq=False)
class Residual:
    """Error of a task: ``values`` row by row, with ``units`` and ``labels``, and the task's ``level``."""

    values: Array
    units: tuple[str, ...]
    labels: tuple[str, ...]
    level: int = 0

    def norm(self, unit: str) -> float:
        """Euclidean norm of the rows in ``unit``."""
        return float(np.linalg.norm([v for v, u in zip(self.values, self.units, strict=True) if u == unit]))

    def __str__(self) -> str:
        return ", ".join(f"{self.norm(u):.3g} {u}".rstrip() for u in dict.fromkeys(self.units))


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
            gone = np.flatnonzero(off[block.span] >= 0.0).tolist()
            out += [_row(block, k, off[block.start + k], layout.command) for k in gone]
    share, missed = part("share"), part("missed")
    for block in layout.of_form("task"):
        if block.entry.level == layout.levels[place]:
            gone = np.flatnonzero(share[block.span] <= GONE).tolist()
            out += [_row(block, k, abs(missed[block.start + k]), layout.command) for k in gone]
    return tuple(out)


def _row(block: Block, row: int, off: float, command: str) -> Dropped:
    unit = rate_unit(block.rows[row].unit, command)
    return Dropped(block.entry.name, block.rows[row].label, float(off), unit)


#: A task that asks for less than this is followed, whatever it does [rad/s, lengths per second]
ASKED = 1e-9


def scales(layout: Layout, variables: Array, errors: Array) -> dict[str, float]:
    """lambda of every scaled task by its name; ``errors`` of all task rows have the speeds that are asked for."""
    named = [b.entry.item.of for b in layout.of_form("rows") if isinstance(b.entry.item, Direction)]
    return {
        name: float(np.clip(variables[variable] / errors[row], 0.0, 1.0)) if errors[row] > ASKED else 1.0
        for name, (row, variable) in zip(named, layout.share_rows.items(), strict=True)
    }
