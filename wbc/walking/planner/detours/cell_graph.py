"""Cells as a graph: the body goes from cell to cell as long as its arms keep their holds, and changes them at cells.

Where arms hold at a cell, each may go from any of its grips there to any other while the body stands. So a chain of
cells leads on if every arm has a grip that holds at one cell and the next, whichever it is. What the arms do to each
other, and how they swing, is left to the plan along the chain.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from wbc.validation import Array
from wbc.walking.planner.detours.cell_grips import CellGrips
from wbc.walking.planner.detours.cells import Cells, Ints

#: Steps to half of the neighbours of a cell, diagonal ones too; the others are the same steps back
_HALF = np.array([step for step in product((-1, 0, 1), repeat=4) if step > (0, 0, 0, 0)])
#: What a cell off the path costs for each m beside, m lower and rad turned; a step along the path costs 1
DEAR = np.array([0.1, 0.2, 0.1])
#: What each of the ways costs in which a cell differs from the next one
CHANGE = 0.1
#: A step costs 1 + FEW / n times as much where an arm has n grips at both cells, as if it had NONE where it has none
FEW, NONE = 2.0, 0.2
#: Cells about one that a chain keeps away from cost so much more; and arms that had no grip there count so many times
#: as much from then on
STUCK, MORE = 1.0, 1.5


class CellGraph:
    """The steps between cells of which all arms but one at most keep a hold.

    Args:
        cells: about a path. grips: at them. arms: of the body.
        seconds: how long the body takes for a change of its offsets ``[n, 4]`` [s].
    """

    def __init__(self, cells: Cells, grips: CellGrips, arms: int, seconds: Callable[[Array], Array]) -> None:
        self.cells, self._grips = cells, grips
        offsets, numbers = cells.offsets(np.arange(len(cells))), np.arange(len(cells)).reshape(cells.shape)
        usual = (float(cells.at[-1] - cells.at[0]) / max(len(cells.at) - 1, 1)) or 1.0
        sets = [grips.sets(arm) for arm in range(arms)]
        ends, common, prices = list[Ints](), list[NDArray[np.uint8]](), list[Array]()
        for step in _HALF:
            pairs = _pairs(numbers, step)
            shared = np.array([_common(one, *pairs) for one in sets])
            kept = (shared > 0).sum(axis=0) >= arms - 1
            pairs = pairs[:, kept]
            ends.append(pairs)
            common.append(shared[:, kept])
            change = seconds(offsets[pairs[1]] - offsets[pairs[0]]) / usual
            prices.append(change + CHANGE * np.abs(step).sum())
        self._ends, self._common = np.concatenate(ends, axis=1), np.concatenate(common, axis=1)
        self._price, self._few = np.concatenate(prices), np.full((arms, 1), FEW)
        self._off = np.abs(offsets[:, 1:]) @ DEAR
        self._open = np.ones(len(self._price), dtype=bool)
        self._found: tuple[Array, Ints] | None = None

    def shortest(self) -> list[int] | None:
        """The chain of cells from the first to the last that costs least; None: there is none."""
        start, goal = self.cells.start, self.cells.goal
        spent, before = self._reached()
        if not np.isfinite(spent[goal]):
            return None
        chain = [goal]
        while chain[-1] != start:
            chain.append(int(before[chain[-1]]))
        return chain[::-1]

    def close(self, steps: Iterable[tuple[int, int]]) -> None:
        """Steps between two cells each that are not made."""
        self._found = None
        for one, other in steps:
            self._open &= ~((self._ends == [[one], [other]]).all(axis=0) | (self._ends == [[other], [one]]).all(axis=0))

    def avoid(self, cells: Sequence[int], arms: Collection[int]) -> None:
        """Keep away from cells at which a plan ended, and from where some arms have few grips."""
        self._found = None
        there = np.unravel_index(np.arange(len(self.cells)), self.cells.shape)
        for cell in cells:
            here = np.unravel_index(cell, self.cells.shape)
            apart = np.array([np.abs(a - b) for a, b in zip(there, here, strict=True)])
            apart[3] = np.minimum(apart[3], self.cells.shape[3] - apart[3])
            self._off[(apart <= 1).all(axis=0)] += STUCK
        self._few[list(arms)] *= MORE

    def furthest(self) -> Ints:
        """Grips at the cells that lie furthest along the path of those that lead on from the first."""
        stations = np.unravel_index(np.flatnonzero(np.isfinite(self._reached()[0])), self.cells.shape)
        reached = np.flatnonzero(stations[0] == stations[0].max())
        ends = np.ravel_multi_index(tuple(axis[reached] for axis in stations), self.cells.shape)
        return self._grips.at_any(ends)

    def _reached(self) -> tuple[Array, Ints]:
        """What cells cost from the first on, and the cells before them; known until prices change."""
        if self._found is not None:
            return self._found
        one, other = self._ends[:, self._open]
        few = (self._few / np.maximum(self._common[:, self._open], NONE)).max(axis=0)
        price = self._price[self._open] * (1.0 + few) + 0.5 * (self._off[one] + self._off[other])
        graph = coo_array((price, (one, other)), shape=(len(self.cells),) * 2).tocsr()
        self._found = dijkstra(graph, directed=False, indices=self.cells.start, return_predecessors=True)
        return self._found


def _pairs(numbers: Ints, step: Ints) -> Ints:
    """Numbers of cells and of those that are a step from them ``[2, n]``; the last axis is round."""
    here, there = list[slice](), list[slice]()
    for size, by in zip(numbers.shape[:3], step[:3].tolist(), strict=True):
        first, last = max(-by, 0), size - max(by, 0)
        here.append(slice(first, last))
        there.append(slice(first + by, last + by))
    beside = np.roll(numbers, -int(step[3]), axis=3)
    return np.stack([numbers[tuple(here)].ravel(), beside[tuple(there)].ravel()])


def _common(sets: NDArray[np.uint64], here: Ints, there: Ints) -> NDArray[np.uint8]:
    """How many numbers are in both of two sets each, of sets of bits ``[cells, words]``; 255 is that many or more."""
    counts = np.bitwise_count(sets[here] & sets[there]).sum(axis=1, dtype=np.int64)
    out: NDArray[np.uint8] = np.minimum(counts, 255).astype(np.uint8)
    return out
