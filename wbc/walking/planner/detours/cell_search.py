"""The search for a detour: all hands but one hold while the body goes from cell to cell and that one changes its hold.

A node is the grips of the hands that hold, and a connected set of cells at which they hold together. Where another hand
can land at one of these cells, each of them can be the next to lift. Nodes
nearer to the goal, and with fewer re-grasps, come first.
"""

from __future__ import annotations

import heapq
import time
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking.holds.structure import Structure
from wbc.walking.planner.detours.cell_graph import distances, round_labels
from wbc.walking.planner.detours.cell_grips import CellGrips, Flags
from wbc.walking.planner.detours.cell_swings import CellSwings
from wbc.walking.planner.detours.cells import Cells, Ints
from wbc.walking.planner.grips.conflicts import LimbShapes
from wbc.walking.planner.stances.together import together

#: A re-grasp counts as so many stations; landings of three arms that are looked at before the search gives up: each
#: leads to two nodes, of more arms to more
STRIDE, LIMIT = 0.1, 2_000
#: Landings at fewer cells than WIDE come later, by so many stations
WIDE, NARROW = 4, 4.0
#: Grips of an arm that a start may have, nodes that the search begins with, and nodes that differ only in the hold that
#: the free hand left
START_GRIPS, START_NODES, LEFTS = 12, 1500, 2

Grips = tuple[int, ...]
#: Grips that hold and a number of a connected set -> grips that free hands left
Seen = dict[tuple[Grips, int], set[int]]


@dataclass(frozen=True, eq=False)
class CellNode:
    """Grips that hold, cells at which they do, where the last hand landed before, and what was before.

    Attributes:
        left: the grip that the free hand left.
        count: re-grasps so far.
    """

    held: Grips
    cells: Ints
    landed: Ints
    left: int
    before: CellNode | None
    count: int


@dataclass(frozen=True, eq=False)
class Outcome:
    """Of a search.

    Attributes:
        nodes: from start to goal, empty if there is none. final: cells at which the last hand lands.
        complete: all that can be reached was looked at, or the goal was.
        reached: grips of the nodes that come nearest to the goal.
        expanded: nodes that were looked at.
    """

    nodes: tuple[CellNode, ...]
    final: Ints
    complete: bool
    reached: tuple[int, ...]
    expanded: int


class CellSearch:
    """A search over the cells about one path; results are cached."""

    def __init__(self, walker: Walker, structure: Structure, cells: Cells, grips: CellGrips) -> None:
        self.cells, self.grips, self._structure = cells, grips, structure
        self._shapes, self._order = LimbShapes(walker), walker.margins.cell_order
        self._swings = CellSwings(walker, structure, cells, grips)
        self._arms, self._least = len(walker.arms), len(walker.arms) - 1
        self._by_arm = [grips.of_arm(arm) for arm in range(self._arms)]
        self._together: dict[tuple[int, int], Flags] = {}
        self._named: dict[int, Array] = {}
        self._parts: dict[Grips, NDArray[np.int32]] = {}
        self._counts = np.zeros((self._arms, len(cells)), dtype=np.int64)
        counts = grips.arms_at()
        self._counts[: len(counts)] = counts
        self._far = self._distances(cells.goal)
        # The least that is left when a grip holds, a little less where it holds at many cells
        least = np.minimum.reduceat(self._far[grips.cells], grips.begin[:-1]) if len(grips) else np.zeros(0)
        self._many = np.diff(grips.begin)
        self._left = least - 0.3 * np.log1p(self._many)

    def _distances(self, goal: int) -> Array:
        """As of :func:`distances`."""
        return distances(self.cells, self._counts, self._least, goal)

    def run(self, start: Mapping[int, int] | None = None, deadline: float | None = None) -> Outcome:
        """From the first cell to the last.

        Args:
            start: arm -> hold (row) of hands that hold at the beginning. deadline: of ``time.perf_counter``.
        """
        apart = self._apart()
        if apart is not None:
            return apart
        seen: Seen = {}
        queue: list[tuple[float, int, CellNode, int, bool]] = []
        near: tuple[float, tuple[int, ...]] = np.inf, ()
        fresh, pushed, expanded = self._first(start or {}, seen), 0, 0
        goal, limit = self.cells.goal, 2 * LIMIT // max(self._least, 2)
        while True:
            for node in fresh:
                near = min(near, (float(self._far[node.cells].min()), node.held))
                for estimate, grip in self._next(node):
                    heapq.heappush(queue, (estimate, pushed, node, grip, False))
                    pushed += 1
            if not queue or expanded >= limit or (deadline is not None and time.perf_counter() > deadline):
                return Outcome((), np.zeros(0, dtype=np.int64), not queue, near[1], expanded)
            estimate, _, node, grip, narrow = heapq.heappop(queue)
            expanded += 1
            landed, fresh = self._landings(node, grip), []
            if goal in landed:
                return Outcome(_back(node), np.array([goal]), True, (*node.held, grip), expanded)
            if narrow or len(landed) >= WIDE:
                fresh = self._children(node, grip, landed, seen)
            elif len(landed):
                heapq.heappush(queue, (estimate + NARROW, pushed, node, grip, True))
                pushed += 1

    def _apart(self) -> Outcome | None:
        """That no chain of cells at which enough arms have a hold leads to the goal; None if one does."""
        cells, start = self.cells, self.cells.start
        if np.isfinite(self._far[start]):
            return None
        ours = np.isfinite(self._distances(start))
        ours[start] = True
        stations = np.nonzero(ours.reshape(cells.shape[0], -1).any(axis=1))[0]
        # Where it comes furthest along the path
        ours.reshape(cells.shape)[: stations[-1]] = False
        ends = np.nonzero(ours)[0]
        some = np.zeros(len(cells), dtype=bool)
        some[ends] = True
        grips = np.nonzero((self.grips.fits & np.packbits(some)).any(axis=1))[0]
        return Outcome((), np.zeros(0, dtype=np.int64), True, tuple(grips.tolist()), 0)

    def _first(self, start: Mapping[int, int], seen: Seen) -> list[CellNode]:
        """Nodes of the stances at the first cell."""
        cell, grips = self.cells.start, self.grips
        choices = []
        for arm in range(self._arms):
            mine = self._by_arm[arm]
            mine = mine[grips.fits_at(mine, cell)]
            if arm in start:
                mine = mine[grips.hold[mine] == start[arm]]
            # Grips that hold at many cells first
            choices.append(mine[np.argsort(-self._many[mine], kind="stable")][:START_GRIPS].tolist())
        out: list[CellNode] = []
        met: set[tuple[Grips, int]] = set()  # many stances share their grips
        for stance in together(choices, lambda one, other: bool(self.together(one, other)[cell])):
            if len(out) >= START_NODES:
                break
            for left in stance:
                held = tuple(g for g in stance if g != left)
                if (held, left) not in met:
                    met.add((held, left))
                    out += self._node(held, np.array([cell]), left, None, seen)
        return out

    def _children(self, node: CellNode, grip: int, landed: Ints, seen: Seen) -> list[CellNode]:
        out = []
        for left in reversed(node.held):
            rest = tuple(g for g in node.held if g != left)
            out += self._node(tuple(sorted((*rest, grip))), landed, left, node, seen)
        return out

    def _node(self, held: Grips, landed: Ints, left: int, before: CellNode | None, seen: Seen) -> list[CellNode]:
        """New nodes of some grips: one for each connected set that has some of the cells."""
        parts = self._part(held)
        out, count = [], 0 if before is None else before.count + 1
        for number in np.unique(parts[landed]).tolist():
            known = seen.setdefault((held, number), set())
            if number and left not in known and len(known) < LEFTS:
                known.add(left)
                cells = np.nonzero(parts == number)[0]
                out.append(CellNode(held, cells, landed[parts[landed] == number], left, before, count))
        return out

    def _next(self, node: CellNode) -> list[tuple[float, int]]:
        """Grips of the other arms that can land at a node's cells, and an estimate of how far the goal is then."""
        grips = self.grips
        used = {int(grips.arm[g]) for g in node.held}
        here = np.zeros(len(self.cells), dtype=bool)
        here[node.cells] = True
        here = np.packbits(here)
        # Most of the cells are elsewhere
        some = np.nonzero(here)[0]
        here, out = here[some], []
        for arm in set(range(self._arms)) - used:
            mine = self._by_arm[arm]
            for g in node.held:
                mine = mine[grips.hold[mine] != grips.hold[g]]
            mine = mine[(grips.landing[np.ix_(mine, some)] & here).any(axis=1)]
            estimate = 0.5 * (self._left[mine] + self._far[node.cells].min()) + STRIDE * node.count
            out += list(zip(estimate.tolist(), mine.tolist(), strict=True))
        return out

    def _landings(self, node: CellNode, grip: int) -> Ints:
        """Cells of a node at which a hand can land; how it swings there is known of the hand that was lifted last."""
        cells: Ints = node.cells[self.grips.flags(self.grips.landing[grip])[node.cells]]
        for g in node.held:
            cells = cells[self.together(g, grip)[cells]]
        cells = cells[self._in_order((*node.held, grip), cells)]
        if not len(cells) or self.grips.arm[node.left] != self.grips.arm[grip]:
            return cells
        return cells[self._swings.possible(cells, node.left, grip)]

    def _in_order(self, stance: tuple[int, ...], cells: Ints) -> Flags:
        """Cells at which hands lie about the body's z axis in the order of their arms, far enough apart."""
        grips, frames = self.grips, self.cells.frames[cells]
        arms = sorted(stance, key=lambda g: int(grips.arm[g]))
        places = self._structure.positions[grips.hold[arms]]
        x, y = (np.einsum("nj,nmj->mn", frames[:, :3, k], places - frames[:, None, :3, 3]) for k in (0, 1))
        angles = np.arctan2(y, x)
        gaps = (np.roll(angles, -1, axis=0) - angles) % (2.0 * np.pi)
        return np.asarray((gaps.min(axis=0) > self._order) & (gaps.sum(axis=0) < 3.0 * np.pi))

    def _part(self, held: Grips) -> NDArray[np.int32]:
        """Numbers of the connected sets of cells of some grips, 0 where they do not hold together."""
        if held not in self._parts:
            out = np.zeros(self.cells.shape, dtype=np.int32)
            pairs = [self.together(*pair) for pair in combinations(held, 2)]
            alone = self.grips.flags(self.grips.fits[held[0]])
            together = np.logical_and.reduce([alone, *pairs]).reshape(self.cells.shape)
            places = np.nonzero(together)
            if len(places[0]):
                box = tuple(slice(int(place.min()), int(place.max()) + 1) for place in places[:3])
                out[box] = round_labels(together[box])
            self._parts[held] = out.reshape(-1)
        return self._parts[held]

    def together(self, one: int, other: int) -> Flags:
        """Cells at which two grips hold, clear of each other."""
        pair = (one, other) if one < other else (other, one)
        if pair not in self._together:
            out = self.grips.flags(self.grips.fits[one] & self.grips.fits[other])
            cells = np.nonzero(out)[0]
            out[cells] = self._shapes.between(self._points(one, cells), self._points(other, cells)) >= 0.0
            self._together[pair] = out
        return self._together[pair]

    def _points(self, grip: int, cells: Ints) -> Array:
        """Named points of an arm at some cells of a grip ``[n, points, 3]``."""
        grips, rows = self.grips, self.grips.rows(grip)
        if grip not in self._named:
            postures = grips.postures[grips.at[rows]]
            self._named[grip] = self._shapes.points(int(grips.arm[grip]), postures)
        out: Array = self._named[grip][np.searchsorted(grips.cells[rows], cells)]
        return out


def _back(node: CellNode) -> tuple[CellNode, ...]:
    out = [node]
    while out[-1].before is not None:
        out.append(out[-1].before)
    return tuple(reversed(out))
