"""Two arms on two holds, and the connected poses at which they hold together: the nodes of the search.

Arms k and k + 1 on two holds are the arms 1 and 2 at another heading, so all nodes are shifts of some types. A type is
an offset of the second hold from the first, two wrist branches, and a connected set of poses relative to the first hold
(face neighbours: one cell along T, A, heading or height).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from bench.walk.reference.arm_table import ArmTable
from bench.walk.reference.lattice import FAR, HEADINGS, PARTS, SIDE, Ints, Lattice
from bench.walk.reference.room import clear_between
from bench.walk.reference.rules import Rules
from wbc.robots import Walker

#: Height, heading, and what is left of x and y on division by PARTS
Class = tuple[int, int, int, int]

#: Headings from one arm to the next
NEXT = HEADINGS // 3
#: Offsets between holds of two arms lie within this [grid units]
SPAN = 2 * FAR // PARTS
#: What a number of a packed cell may be: offsets + FAR
_PACK = (HEADINGS, SIDE, SIDE)


@dataclass(frozen=True, eq=False)
class Block:
    """What can be held at the poses of one class: height, heading, and the parts of T and A behind the point.

    Attributes:
        holds: offsets of holds that arm 1 can hold from the pose's whole T and A, ``[n, 2]``. branch: ``[n]``.
    """

    holds: Ints
    branch: Ints


@dataclass(frozen=True, eq=False)
class Pairs:
    """Types of nodes.

    Attributes:
        offset: second hold from first ``[types, 2]``. branch: of both arms ``[types, 2]``.
        cells: packed cells relative to the first hold, those of a type together. begin: ``[types + 1]``.
        low, high: extremes of the relative x and y of a type's cells ``[types, 2]``.
        blocks: (height, heading, x mod 4, y mod 4) -> what arm 1 can hold.
        types: (height, heading, x mod 4, y mod 4) -> type of arm 1 and the next on two holds of theirs, -1: none.
    """

    offset: Ints
    branch: Ints
    cells: Ints
    begin: Ints
    low: Ints
    high: Ints
    blocks: dict[Class, Block]
    types: dict[Class, Ints]

    def __len__(self) -> int:
        return len(self.offset)

    def cells_of(self, kind: int) -> Ints:
        """Cells (height, heading, x, y) of a type relative to the first hold, ``[n, 4]``."""
        return unpacked(self.cells[self.begin[kind] : self.begin[kind + 1]])


def packed(cells: Ints) -> Ints:
    """One number for each relative cell ``[..., 4]``."""
    height, heading, x, y = (cells[..., k] for k in range(4))
    out: Ints = ((height * _PACK[0] + heading) * _PACK[1] + x + FAR) * _PACK[2] + y + FAR
    return out


def unpacked(numbers: Ints) -> Ints:
    """Relative cells ``[..., 4]`` of :func:`packed`."""
    rest, y = np.divmod(numbers, _PACK[2])
    rest, x = np.divmod(rest, _PACK[1])
    height, heading = np.divmod(rest, _PACK[0])
    return np.stack([height, heading, x - FAR, y - FAR], axis=-1)


def find_pairs(walker: Walker, lattice: Lattice, rules: Rules, table: ArmTable) -> Pairs:
    """All types."""
    grips = np.argwhere(table.fits)  # branch, height, heading, x, y
    grips[:, 3:] -= FAR
    blocks, rows = _blocks(grips, table.fits.shape[1])
    one, other, shapes = _products(rows)
    good = (grips[one, 3] != grips[other, 3]) | (grips[one, 4] != grips[other, 4])  # not on one hold
    if rules.collisions:
        points = table.points[tuple((grips + [0, 0, 0, FAR, FAR]).T)]
        good[good] = clear_between(walker, points, one[good], other[good])
    one, other = one[good], other[good]
    offset = (grips[one, 3:] - grips[other, 3:]) // PARTS
    side = 2 * SPAN + 1
    kind = ((offset[:, 0] + SPAN) * side + offset[:, 1] + SPAN) * 4 + grips[one, 0] * 2 + grips[other, 0]
    cell = packed(grips[:, 1:])[one]
    key = kind * (table.fits[0].size) + cell
    order = np.argsort(key, kind="stable")
    label = np.empty(len(key), dtype=np.int64)
    label[order] = _components(rules, table, grips, key[order], one[order], other[order])
    sort = np.lexsort((cell, label))
    begin = np.searchsorted(label[sort], np.arange(label.max(initial=-1) + 2))
    first = sort[begin[:-1]]
    place = grips[one[sort], 3:]
    low, high = (extreme.reduceat(place, begin[:-1]) if len(first) else place for extreme in (np.minimum, np.maximum))
    whole = np.full(len(good), -1, dtype=np.int64)
    whole[good] = label
    parts = np.split(whole, np.cumsum([n * m for n, m in shapes.values()])[:-1])
    types = {where: part.reshape(shape) for (where, shape), part in zip(shapes.items(), parts, strict=True)}
    branch = np.stack([grips[one[first], 0], grips[other[first], 0]], axis=-1)
    return Pairs(offset[first], branch, cell[sort], begin, low, high, blocks, types)


def _blocks(grips: Ints, heights: int) -> tuple[dict[Class, Block], dict[Class, Ints]]:
    """Blocks, and the rows of their grips."""
    branch, height, heading, x, y = grips.T
    place = ((height * HEADINGS + heading) * PARTS + x % PARTS) * PARTS + y % PARTS
    order = np.lexsort((branch, y, x, place))
    bounds = np.searchsorted(place[order], np.arange(heights * HEADINGS * PARTS * PARTS + 1))
    blocks, rows = {}, {}
    for k in range(len(bounds) - 1):
        mine = order[bounds[k] : bounds[k + 1]]
        rest, part_y = divmod(k, PARTS)
        rest, part_x = divmod(rest, PARTS)
        holds = np.stack([(part_x - x[mine]) // PARTS, (part_y - y[mine]) // PARTS], axis=-1)
        where = rest // HEADINGS, rest % HEADINGS, part_x, part_y
        blocks[where], rows[where] = Block(holds, branch[mine]), mine
    return blocks, rows


def _products(rows: dict[Class, Ints]) -> tuple[Ints, Ints, dict[Class, tuple[int, int]]]:
    """Grips of arm 1 and of the next, of all pairs at all classes, and how many there are of each."""
    one, other, shapes = [], [], {}
    for (height, heading, x, y), mine in rows.items():
        second = rows[(height, (heading + NEXT) % HEADINGS, x, y)]
        one.append(np.repeat(mine, len(second)))
        other.append(np.tile(second, len(mine)))
        shapes[(height, heading, x, y)] = len(mine), len(second)
    return np.concatenate(one), np.concatenate(other), shapes


def _components(rules: Rules, table: ArmTable, grips: Ints, key: Ints, one: Ints, other: Ints) -> Ints:
    """Labels of connected cells; ``key`` is sorted, ``one`` and ``other`` are the grips of its entries."""
    plane = SIDE * SIDE
    _, height, heading, x, y = grips[one].T
    steps = (
        np.where(y < FAR, 1, 0),
        np.where(x < FAR, SIDE, 0),
        np.where(heading < HEADINGS - 1, plane, -(HEADINGS - 1) * plane),
        np.where(height < table.fits.shape[1] - 1, HEADINGS * plane, 0),
    )
    postures = table.postures[tuple((grips + [0, 0, 0, FAR, FAR]).T)][:, :5] if rules.branches else np.zeros((0, 5))
    begins, ends = [], []
    for step in steps:
        wanted = key + step
        found = np.minimum(np.searchsorted(key, wanted), len(key) - 1)
        here = np.nonzero((key[found] == wanted) & (step != 0))[0]
        there = found[here]
        if rules.branches:
            smooth = np.ones(len(here), dtype=bool)
            for rows in (one, other):
                before, after = rows[here], rows[there]
                for joint in range(5):
                    angle = postures[:, joint]
                    smooth &= np.abs(angle[after] - angle[before]) <= rules.largest_step
            here, there = here[smooth], there[smooth]
        begins.append(here)
        ends.append(there)
    i, j = np.concatenate(begins), np.concatenate(ends)
    graph = coo_array((np.ones(len(i), dtype=np.int8), (i, j)), shape=(len(key), len(key)))
    labels = connected_components(graph, directed=False)[1]
    return np.asarray(labels, dtype=np.int64)
