"""Ways as steps: which hand moves, and where the body goes while the others hold."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np

from bench.walk.reference.arm_table import ArmTable
from bench.walk.reference.grid import GridHolds
from bench.walk.reference.lattice import FAR, HEADINGS, PARTS, GridPose, Lattice
from bench.walk.reference.pairs import NEXT, Pairs
from bench.walk.reference.rules import Rules
from bench.walk.reference.search import Stance, Way
from bench.walk.reference.verdict import Step

Cell = tuple[int, int, int, int]


class Router:
    """Body poses from stance to stance, over the tables of one set of rules."""

    def __init__(self, lattice: Lattice, rules: Rules, table: ArmTable, pairs: Pairs) -> None:
        self.lattice, self.rules, self.table, self.pairs = lattice, rules, table, pairs

    def steps(self, way: Way, holds: GridHolds) -> tuple[Step, ...]:
        """The steps of a way."""
        out = []
        for k, stance in enumerate(way.stances):
            route: tuple[Cell, ...] | None = (stance.cell,)
            moves = -1
            if k < len(way.carriers):
                arm, _ = way.carriers[k]
                route, moves = self.route(stance, way.stances[k + 1].cell, [way.carriers[k]]), (arm + 2) % 3
            assert route is not None
            out.append(self.step(stance, moves, route, holds))
        return tuple(out)

    def step(self, stance: Stance, moves: int, route: Sequence[Cell], holds: GridHolds) -> Step:
        """A step, with ids and poses."""
        one, two, three = (holds.ids[place] for place in stance.holds)
        first, second, third = stance.branches
        poses: tuple[GridPose, ...] = tuple(self.lattice.pose(cell) for cell in route)
        return Step(self.lattice.pose(stance.cell), (one, two, three), (first, second, third), moves, poses)

    def route(self, begin: Stance, end: Cell, carriers: Sequence[tuple[int, int]]) -> tuple[Cell, ...] | None:
        """Shortest chain of neighbouring cells from a stance's to another at which some pairs hold, breadth first.

        Args:
            carriers: (first arm, type) of the pairs, at least one.
        """
        common: set[Cell] | None = None
        for arm, kind in carriers:
            hold = begin.holds[arm]
            cells = self.pairs.cells_of(kind) + np.array([0, -NEXT * arm, PARTS * hold[0], PARTS * hold[1]])
            cells[:, 1] %= HEADINGS
            mine = {(h, c, x, y) for h, c, x, y in cells.tolist()}
            common = mine if common is None else common & mine
        arms = sorted({number % 3 for arm, _ in carriers for number in (arm, arm + 1)})
        came: dict[Cell, Cell | None] = {begin.cell: None}
        queue = deque([begin.cell])
        while queue and end not in came:
            here = queue.popleft()
            for there in _neighbours(here):
                if common and there in common and there not in came and self._smooth(begin, arms, here, there):
                    came[there] = here
                    queue.append(there)
        if end not in came:
            return None
        chain: list[Cell] = []
        at: Cell | None = end
        while at is not None:
            chain.append(at)
            at = came[at]
        return tuple(reversed(chain))

    def _smooth(self, stance: Stance, arms: Sequence[int], here: Cell, there: Cell) -> bool:
        """Whether no joint of some arms goes too far from cell to cell."""
        for arm in arms:
            postures = []
            for h, c, x, y in (here, there):
                i, j = x - PARTS * stance.holds[arm][0] + FAR, y - PARTS * stance.holds[arm][1] + FAR
                postures.append(self.table.postures[stance.branches[arm], h, (c + NEXT * arm) % HEADINGS, i, j, :5])
            if np.abs(postures[1] - postures[0]).max() > self.rules.largest_step:
                return False
        return True


def _neighbours(cell: Cell) -> list[Cell]:
    h, c, x, y = cell
    near = [(h - 1, c, x, y), (h + 1, c, x, y), (h, (c - 1) % HEADINGS, x, y), (h, (c + 1) % HEADINGS, x, y)]
    return [*near, (h, c, x - 1, y), (h, c, x + 1, y), (h, c, x, y - 1), (h, c, x, y + 1)]
