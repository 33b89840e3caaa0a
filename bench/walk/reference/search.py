"""The search over nodes: types of pairs at places of the grid."""

from __future__ import annotations

import heapq
from dataclasses import dataclass

import numpy as np

from bench.walk.reference.arm_table import Flags
from bench.walk.reference.grid import GridHolds
from bench.walk.reference.lattice import HEADINGS, PARTS, Ints
from bench.walk.reference.links import Links, triples
from bench.walk.reference.pairs import NEXT, Pairs, unpacked

#: Nodes that are expanded at a time, and estimates that count as equal [grid units]
BATCH, BIN = 256, 0.25


@dataclass(frozen=True)
class Stance:
    """Three hands on three holds at a pose.

    Attributes:
        cell: the pose (height, heading, x, y); see ``Lattice``.
        holds: (T, A) of each arm. branches: of the wrist of each arm, 0: theta5 >= 0, 1: theta5 < 0.
    """

    cell: tuple[int, int, int, int]
    holds: tuple[tuple[int, int], ...]
    branches: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class StanceSet:
    """Many stances: ``rows`` are a cell, three holds, three branches, types of arms 1 and 2, 2 and 3, 3 and 1."""

    rows: Ints

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def holds(self) -> Ints:
        """(T, A) of each arm's hold, ``[n, 3, 2]``."""
        return self.rows[:, 4:10].reshape(-1, 3, 2)

    @property
    def kinds(self) -> Ints:
        """Types of the three pairs, ``[n, 3]``."""
        return self.rows[:, 13:]

    def common(self, other: StanceSet) -> list[tuple[Stance, Stance, tuple[int, ...]]]:
        """Stances on the same holds with the same branches and types in both, and the types."""
        places = {tuple(row[4:]): k for k, row in enumerate(other.rows.tolist())}
        rows = [(k, places.get(tuple(row[4:]))) for k, row in enumerate(self.rows.tolist())]
        return [(self.one(k), other.one(at), tuple(self.kinds[k].tolist())) for k, at in rows if at is not None]

    def one(self, row: int) -> Stance:
        """One of them."""
        numbers = self.rows[row].tolist()
        holds = tuple((numbers[k], numbers[k + 1]) for k in (4, 6, 8))
        return Stance((numbers[0], numbers[1], numbers[2], numbers[3]), holds, tuple(numbers[10:13]))


@dataclass(frozen=True)
class Way:
    """Stances one after another, and the type of pair that carries the body from each to the next.

    Attributes:
        stances: at least two; neighbours may differ in one arm or in the pose alone.
        carriers: (first arm, type) of the two hands that stay, one fewer.
    """

    stances: tuple[Stance, ...]
    carriers: tuple[tuple[int, int], ...]


@dataclass(frozen=True)
class Outcome:
    """Of a search: the way, or None; nodes expanded; whether all that can be reached was."""

    way: Way | None
    expanded: int
    complete: bool


class Search:
    """Nodes over some holds, numbered ((type, arm), T, A): arm on the hold at (T, A), the next arm on the second.

    Args:
        pairs, links: of one set of rules. holds: that there are.
    """

    def __init__(self, pairs: Pairs, links: Links, holds: GridHolds) -> None:
        self.pairs, self.links, self.holds = pairs, links, holds
        self._size = holds.present.shape
        self._there = np.pad(holds.present, 32)

    def stances(self, cells: Ints, only: tuple[tuple[int, int], ...] | None = None) -> StanceSet:
        """All stances at some poses; with ``only`` those on these holds."""
        rows = [np.zeros((0, 16), dtype=np.int64)]
        for height, heading, x, y in cells.tolist():
            keys = [(height, (heading + NEXT * arm) % HEADINGS, x % PARTS, y % PARTS) for arm in range(3)]
            blocks = [self.pairs.blocks[key] for key in keys]
            at = [block.holds + [x // PARTS, y // PARTS] for block in blocks]
            here = []
            for arm in range(3):
                good = self._present(at[arm])
                if only is not None:
                    good &= (at[arm] == only[arm]).all(axis=1)
                here.append(np.nonzero(good)[0])
            tables = [self.pairs.types[keys[k]][np.ix_(here[k], here[(k + 1) % 3])] for k in range(3)]
            found = triples(tables[0], tables[1], tables[2])
            part = np.empty((len(found[0]), 16), dtype=np.int64)
            part[:, :4] = height, heading % HEADINGS, x, y
            for arm in range(3):
                row, after = found[arm], found[(arm + 1) % 3]
                part[:, 4 + 2 * arm : 6 + 2 * arm] = at[arm][here[arm]][row]
                part[:, 10 + arm] = blocks[arm].branch[here[arm]][row]
                part[:, 13 + arm] = tables[arm][row, after]
            rows.append(part)
        return StanceSet(np.concatenate(rows))

    def run(self, starts: StanceSet, goals: StanceSet, target: tuple[float, float] | None, limit: int) -> Outcome:
        """A way from one of some stances to one of others.

        Args:
            target: T and A of the goal, which nodes nearer to it come first for; None: the fewest re-grasps first.
            limit: nodes to expand at most.
        """
        goal_nodes, goal_of = self._all_nodes(goals)
        first, start_of = self._all_nodes(starts)
        seen = np.zeros(3 * len(self.pairs) * self._size[0] * self._size[1], dtype=bool)
        log = _Log()
        queue = _Queue()
        rows = log.add(first, np.full(len(first), -1), np.full(len(first), -1))
        seen[first] = True
        queue.push(self._estimates(first, target, 0), rows)
        expanded = 0
        goal_set = np.zeros(len(seen), dtype=bool)
        goal_set[goal_nodes] = True
        hit = rows[goal_set[first]]
        while not len(hit) and queue and expanded < limit:
            rows, level = queue.pop(BATCH if target is not None else None)
            expanded += len(rows)
            child, parent, link = self._expand(log.node[rows], rows)
            fresh = np.nonzero(~seen[child])[0]
            child, at = np.unique(child[fresh], return_index=True)
            parent, link = parent[fresh][at], link[fresh][at]
            seen[child] = True
            rows = log.add(child, parent, link)
            hit = rows[goal_set[child]]
            queue.push(self._estimates(child, target, level + 1), rows)
        if not len(hit):
            return Outcome(None, expanded, not queue)
        nodes, links = log.back(int(hit[0]))
        begin = starts.one(start_of[int(np.searchsorted(first, nodes[0]))])
        end = goals.one(goal_of[int(np.searchsorted(goal_nodes, nodes[-1]))])
        between = [self._stance(node, link) for node, link in zip(nodes, links, strict=False)]
        carriers = tuple((node // (self._size[0] * self._size[1]) % 3, self._kind(node)) for node in nodes)
        return Outcome(Way((begin, *between, end), carriers), expanded, True)

    def _all_nodes(self, stances: StanceSet) -> tuple[Ints, Ints]:
        """Nodes of stances, sorted, and which stance each is of."""
        nodes = np.concatenate(
            [self._numbers(stances.kinds[:, arm], np.array(arm), stances.holds[:, arm]) for arm in range(3)]
        )
        nodes, at = np.unique(nodes, return_index=True)
        return nodes, at % max(len(stances), 1)

    def _numbers(self, kind: Ints, arm: Ints, place: Ints) -> Ints:
        where = place - self.holds.first
        out: Ints = ((kind * 3 + arm) * self._size[0] + where[:, 0]) * self._size[1] + where[:, 1]
        return out

    def _split(self, nodes: Ints) -> tuple[Ints, Ints, Ints]:
        """(type, arm, place)."""
        rest, a = np.divmod(nodes, self._size[1])
        rest, t = np.divmod(rest, self._size[0])
        return rest // 3, rest % 3, np.stack([t, a], axis=-1) + np.array(self.holds.first)

    def _kind(self, node: int) -> int:
        return int(node // (3 * self._size[0] * self._size[1]))

    def _present(self, place: Ints) -> Flags:
        where = np.clip(place - self.holds.first, -32, np.array(self._size) + 31) + 32
        out: Flags = self._there[where[..., 0], where[..., 1]]
        return out

    def _expand(self, nodes: Ints, rows: Ints) -> tuple[Ints, Ints, Ints]:
        """Neighbours of nodes: (node, row of the parent, link)."""
        kind, arm, place = self._split(nodes)
        begin = self.links.begin[kind]
        count = self.links.begin[kind + 1] - begin
        source = np.repeat(np.arange(len(nodes)), count)
        link = np.arange(len(source)) - np.repeat(np.cumsum(count) - count, count) + begin[source]
        second = place[source] + self.pairs.offset[kind[source]]
        third = second + self.pairs.offset[self.links.second[link]]
        good = self._present(third)
        source, link, second, third = source[good], link[good], second[good], third[good]
        one = self._numbers(self.links.second[link], (arm[source] + 1) % 3, second)
        other = self._numbers(self.links.third[link], (arm[source] + 2) % 3, third)
        parents, links = np.tile(rows[source], 2), np.tile(link, 2)
        return np.concatenate([one, other]), parents, links

    def _estimates(self, nodes: Ints, target: tuple[float, float] | None, level: int) -> Ints:
        if target is None:
            return np.full(len(nodes), level)
        kind, _, place = self._split(nodes)
        wanted = PARTS * (np.array(target) - place)
        over = np.maximum(self.pairs.low[kind] - wanted, 0) + np.maximum(wanted - self.pairs.high[kind], 0)
        out: Ints = (np.linalg.norm(over, axis=1) / PARTS / BIN).astype(np.int64)
        return out

    def _stance(self, node: int, link: int) -> Stance:
        """What the three hands of a link hold."""
        (kind,), (arm,), (place,) = self._split(np.array([node]))
        pairs = self.pairs
        second = place + pairs.offset[kind]
        third = second + pairs.offset[self.links.second[link]]
        height, heading, x, y = unpacked(self.links.cell[link : link + 1])[0].tolist()
        cell = (height, (heading - NEXT * int(arm)) % HEADINGS, x + PARTS * int(place[0]), y + PARTS * int(place[1]))
        holds, branches = [(0, 0)] * 3, [0] * 3
        bent = (*pairs.branch[kind].tolist(), int(pairs.branch[self.links.second[link], 1]))
        for step, (where, branch) in enumerate(zip((place, second, third), bent, strict=True)):
            holds[(int(arm) + step) % 3] = (int(where[0]), int(where[1]))
            branches[(int(arm) + step) % 3] = branch
        return Stance(cell, tuple(holds), tuple(branches))


class _Log:
    """All nodes that were found: node, row of the parent, link from it."""

    def __init__(self) -> None:
        self._room = 1 << 14
        self._count = 0
        self._data = np.empty((3, self._room), dtype=np.int64)

    @property
    def node(self) -> Ints:
        return self._data[0, : self._count]

    def add(self, node: Ints, parent: Ints, link: Ints) -> Ints:
        """Rows of the new entries."""
        end = self._count + len(node)
        if end > self._data.shape[1]:
            grown = np.empty((3, 2 * end), dtype=np.int64)
            grown[:, : self._count] = self._data[:, : self._count]
            self._data = grown
        self._data[:, self._count : end] = node, parent, link
        rows = np.arange(self._count, end)
        self._count = end
        return rows

    def back(self, row: int) -> tuple[list[int], list[int]]:
        """Nodes from the beginning to a row, and the links between them."""
        nodes, links = [], []
        while row >= 0:
            nodes.append(int(self._data[0, row]))
            links.append(int(self._data[2, row]))
            row = int(self._data[1, row])
        return nodes[::-1], links[-2::-1]


class _Queue:
    """Rows by estimate, equal ones together, the latest first."""

    def __init__(self) -> None:
        self._order: list[int] = []
        self._bins: dict[int, list[Ints]] = {}

    def __bool__(self) -> bool:
        return bool(self._order)

    def push(self, estimate: Ints, rows: Ints) -> None:
        for value in np.unique(estimate).tolist():
            if value not in self._bins:
                self._bins[value] = []
                heapq.heappush(self._order, value)
            self._bins[value].append(rows[estimate == value])

    def pop(self, most: int | None) -> tuple[Ints, int]:
        """Rows of the least estimate, at most so many, and that estimate."""
        value = self._order[0]
        rows = np.concatenate(self._bins[value])
        if most is None or len(rows) <= most:
            heapq.heappop(self._order)
            del self._bins[value]
            return rows, value
        self._bins[value] = [rows[:-most]]
        return rows[-most:], value
