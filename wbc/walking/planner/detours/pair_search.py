"""The search for a way: two hands hold while the body goes from cell to cell and the third hand changes its hold.

A node is two grips and a connected set of cells at which they hold together. Where the third hand can land at one of
these cells, each of the two can be the next to lift. Nodes nearer to the goal, and with fewer re-grasps, come first.
"""

from __future__ import annotations

import heapq
import time
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations, product
from math import radians

import numpy as np
from numpy.typing import NDArray

from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking.holds.structure import Structure
from wbc.walking.planner.detours.cell_graph import distances, round_labels
from wbc.walking.planner.detours.cell_grips import CellGrips, Flags
from wbc.walking.planner.detours.cell_swings import CellSwings
from wbc.walking.planner.detours.cells import Cells, Ints
from wbc.walking.planner.grips.conflicts import ArmClearance
from wbc.walking.planner.grips.table import Grips

#: A re-grasp counts as so many stations; nodes that are looked at before the search gives up
STRIDE, LIMIT = 0.1, 2_000
#: Landings at fewer cells than WIDE come later, by so many stations
WIDE, NARROW = 4, 4.0
#: Hands that land this near to another, as the body sees them, could not be lifted past each other again [rad]
APART = radians(10.0)
#: Grips of an arm that a start may have; nodes that differ only in the hold that the free hand left
START_GRIPS, LEFTS = 6, 2

#: Two grips and a number of a connected set -> grips that free hands left
Seen = dict[tuple[int, int, int], set[int]]


@dataclass(frozen=True, eq=False)
class Node:
    """Two grips, cells at which they hold, where the third hand landed before, and what was before.

    Attributes:
        left: the grip that the free hand left.
        count: re-grasps so far.
    """

    pair: tuple[int, int]
    cells: Ints
    landed: Ints
    left: int
    before: Node | None
    count: int


@dataclass(frozen=True, eq=False)
class Outcome:
    """Of a search.

    Attributes:
        nodes: from start to goal, empty if there is no way. final: cells at which the last hand lands.
        complete: all that can be reached was looked at, or the goal was.
        reached: grips of the nodes that come nearest to the goal.
        expanded: nodes that were looked at.
    """

    nodes: tuple[Node, ...]
    final: Ints
    complete: bool
    reached: tuple[int, ...]
    expanded: int


class PairSearch:
    """A search over the cells about one path; what was computed is kept."""

    def __init__(self, walker: Walker, structure: Structure, cells: Cells, grips: CellGrips) -> None:
        self.cells, self.grips, self._structure = cells, grips, structure
        nothing = np.zeros(0, dtype=np.int64)
        self._clearance = ArmClearance(walker, Grips(*(nothing,) * 6, np.zeros((0, 6)), nothing, nothing))
        self._swings = CellSwings(walker, structure, cells, grips)
        self._arms = len(walker.arms)
        self._by_arm = [grips.of_arm(arm) for arm in range(self._arms)]
        self._together: dict[tuple[int, int], Flags] = {}
        self._named: dict[int, Array] = {}
        self._rank: dict[int, Ints] = {}
        self._parts: dict[tuple[int, int], NDArray[np.int32]] = {}
        self._far = distances(cells, [grips.fits[mine] for mine in self._by_arm], cells.goal)
        self._bits, self._landing = np.packbits(grips.fits, axis=1), np.packbits(grips.lands, axis=1)
        # The least that is left when a grip holds, a little less where it holds at many cells
        least = np.array([self._far[fits].min() for fits in grips.fits])
        self._left = least - 0.3 * np.log1p(grips.fits.sum(axis=1))

    def run(self, start: Mapping[int, int] | None = None, deadline: float | None = None) -> Outcome:
        """A way from the first cell to the last.

        Args:
            start: arm -> hold (row) of hands that hold at the beginning. deadline: of ``time.perf_counter``.
        """
        apart = self._apart()
        if apart is not None:
            return apart
        seen: Seen = {}
        queue: list[tuple[float, int, Node, int, bool]] = []
        near: tuple[float, tuple[int, ...]] = np.inf, ()
        fresh, pushed, expanded = self._first(start or {}, seen), 0, 0
        goal = self.cells.goal
        while True:
            for node in fresh:
                near = min(near, (float(self._far[node.cells].min()), node.pair))
                for estimate, grip in self._thirds(node):
                    heapq.heappush(queue, (estimate, pushed, node, grip, False))
                    pushed += 1
            if not queue or expanded >= LIMIT or (deadline is not None and time.perf_counter() > deadline):
                return Outcome((), np.zeros(0, dtype=np.int64), not queue, near[1], expanded)
            estimate, _, node, grip, narrow = heapq.heappop(queue)
            expanded += 1
            landed, fresh = self._landings(node, grip), []
            if goal in landed:
                return Outcome(_back(node), np.array([goal]), True, (*node.pair, grip), expanded)
            if narrow or len(landed) >= WIDE:
                fresh = self._children(node, grip, landed, seen)
            elif len(landed):
                heapq.heappush(queue, (estimate + NARROW, pushed, node, grip, True))
                pushed += 1

    def _apart(self) -> Outcome | None:
        """That no chain of cells at which two arms have a hold leads to the goal; None if one does."""
        cells, start = self.cells, self.cells.start
        if np.isfinite(self._far[start]):
            return None
        ours = np.isfinite(distances(cells, [self.grips.fits[mine] for mine in self._by_arm], start))
        ours[start] = True
        stations = np.nonzero(ours.reshape(cells.shape[0], -1).any(axis=1))[0]
        # Where it comes furthest along the path
        ours.reshape(cells.shape)[: stations[-1]] = False
        ends = np.nonzero(ours)[0]
        grips = np.nonzero(self.grips.fits[:, ends].any(axis=1))[0]
        return Outcome((), np.zeros(0, dtype=np.int64), True, tuple(grips.tolist()), 0)

    def _first(self, start: Mapping[int, int], seen: Seen) -> list[Node]:
        """Nodes of the stances at the first cell."""
        cell, grips = self.cells.start, self.grips
        choices = []
        for arm in range(self._arms):
            mine = self._by_arm[arm]
            mine = mine[grips.fits[mine, cell]]
            if arm in start:
                mine = mine[grips.hold[mine] == start[arm]]
            # Grips that hold at many cells first
            choices.append(mine[np.argsort(-grips.fits[mine].sum(axis=1), kind="stable")][:START_GRIPS].tolist())
        out = []
        for stance in product(*choices):
            if all(self.together(*pair)[cell] for pair in combinations(stance, 2)):
                for arm, pair in zip((2, 1, 0), combinations(stance, 2), strict=True):
                    out += self._node(pair, np.array([cell]), stance[arm], None, seen)
        return out

    def _children(self, node: Node, grip: int, landed: Ints, seen: Seen) -> list[Node]:
        one, other = node.pair
        out = self._node((min(one, grip), max(one, grip)), landed, other, node, seen)
        return out + self._node((min(other, grip), max(other, grip)), landed, one, node, seen)

    def _node(self, pair: tuple[int, int], landed: Ints, left: int, before: Node | None, seen: Seen) -> list[Node]:
        """New nodes of a pair: one for each connected set that has some of the cells."""
        parts = self._part(pair)
        out, count = [], 0 if before is None else before.count + 1
        for number in np.unique(parts[landed]).tolist():
            known = seen.setdefault((*pair, number), set())
            if number and left not in known and len(known) < LEFTS:
                known.add(left)
                cells = np.nonzero(parts == number)[0]
                out.append(Node(pair, cells, landed[parts[landed] == number], left, before, count))
        return out

    def _thirds(self, node: Node) -> list[tuple[float, int]]:
        """Grips of the third arm that can land at a node's cells, and an estimate of how far the goal is then."""
        grips = self.grips
        used = {int(grips.arm[g]) for g in node.pair}
        here = np.zeros(len(self.cells), dtype=bool)
        here[node.cells] = True
        here = np.packbits(here)
        out = []
        for arm in set(range(self._arms)) - used:
            mine = self._by_arm[arm]
            for g in node.pair:
                mine = mine[grips.hold[mine] != grips.hold[g]]
            mine = mine[(self._landing[mine] & here).any(axis=1)]
            estimate = 0.5 * (self._left[mine] + self._far[node.cells].min()) + STRIDE * node.count
            out += list(zip(estimate.tolist(), mine.tolist(), strict=True))
        return out

    def _landings(self, node: Node, grip: int) -> Ints:
        """Cells of a node at which the third hand can land."""
        cells: Ints = node.cells[self.grips.lands[grip, node.cells]]
        for g in node.pair:
            cells = cells[self.together(g, grip)[cells]]
        cells = cells[self._in_order((*node.pair, grip), cells)]
        return cells[self._swings.possible(cells, node.left, grip)] if len(cells) else cells

    def _in_order(self, stance: tuple[int, ...], cells: Ints) -> Flags:
        """Cells at which hands lie about the body's z axis in the order of their arms, at least APART."""
        grips, frames = self.grips, self.cells.frames[cells]
        arms = sorted(stance, key=lambda g: int(grips.arm[g]))
        places = self._structure.positions[grips.hold[arms]]
        x, y = (np.einsum("nj,nmj->mn", frames[:, :3, k], places - frames[:, None, :3, 3]) for k in (0, 1))
        angles = np.arctan2(y, x)
        gaps = (np.roll(angles, -1, axis=0) - angles) % (2.0 * np.pi)
        return np.asarray((gaps.min(axis=0) > APART) & (gaps.sum(axis=0) < 3.0 * np.pi))

    def _part(self, pair: tuple[int, int]) -> NDArray[np.int32]:
        """Numbers of the connected sets of cells of two grips, 0 where they do not hold together."""
        if pair not in self._parts:
            out = np.zeros(self.cells.shape, dtype=np.int32)
            together = self.together(*pair).reshape(self.cells.shape)
            places = np.nonzero(together)
            if len(places[0]):
                box = tuple(slice(int(place.min()), int(place.max()) + 1) for place in places[:3])
                out[box] = round_labels(together[box])
            self._parts[pair] = out.reshape(-1)
        return self._parts[pair]

    def together(self, one: int, other: int) -> Flags:
        """Cells at which two grips hold, clear of each other."""
        pair = (one, other) if one < other else (other, one)
        if pair not in self._together:
            bits = self._bits[one] & self._bits[other]
            out = np.unpackbits(bits, count=len(self.cells)).view(bool)
            cells = np.nonzero(out)[0]
            out[cells] = self._clearance.between(self._points(one, cells), self._points(other, cells)) >= 0.0
            self._together[pair] = out
        return self._together[pair]

    def _points(self, grip: int, cells: Ints) -> Array:
        """Named points of an arm at some cells of a grip ``[n, 6, 3]``."""
        if grip not in self._named:
            rows = self.grips.row[grip]
            rows = rows[rows >= 0]
            self._named[grip] = self._clearance.points(int(self.grips.arm[grip]), self.grips.postures[rows])
            self._rank[grip] = np.cumsum(self.grips.fits[grip]) - 1
        out: Array = self._named[grip][self._rank[grip][cells]]
        return out


def _back(node: Node) -> tuple[Node, ...]:
    out = [node]
    while out[-1].before is not None:
        out.append(out[-1].before)
    return tuple(reversed(out))
