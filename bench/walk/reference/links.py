"""Three hands on three holds at one pose: what connects the nodes of the search.

At a pose three hands hold together if every two of them do, so a link is three types: of arms 1 and 2, 2 and 3, 3
and 1. From the node of any two of these, the third arm can land, and then either of the two can lift.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bench.walk.reference.lattice import FAR, HEADINGS, PARTS, Ints
from bench.walk.reference.pairs import NEXT, Pairs, packed, unpacked


@dataclass(frozen=True, eq=False)
class Links:
    """Links by the type of their first two arms.

    Attributes:
        begin: links of a type are ``begin[type]`` to ``begin[type + 1]``; ``[types + 1]``.
        second: type of the second and third arm. third: type of the third and first arm.
        cell: a pose at which the three hold, relative to the hold of the first arm, packed.
    """

    begin: Ints
    second: Ints
    third: Ints
    cell: Ints

    def __len__(self) -> int:
        return len(self.second)


def find_links(pairs: Pairs) -> Links:
    """All links."""
    width = max(len(pairs), 1)
    keys, cells = [np.zeros(0, dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
    for (height, heading, x, y), first in pairs.types.items():
        if heading >= NEXT or not first.size:
            continue
        second = pairs.types[(height, heading + NEXT, x, y)]
        third = pairs.types[(height, heading + 2 * NEXT, x, y)]
        i, j, k = triples(first, second, third)
        key = (first[i, j] * width + second[j, k]) * width + third[k, i]
        found, at = np.unique(key, return_index=True)
        hold = pairs.blocks[(height, heading, x, y)].holds[i[at]]
        pose = np.column_stack([np.full((len(at), 2), (height, heading)), (x, y) - PARTS * hold])
        keys.append(found)
        cells.append(packed(pose))
    key, at = np.unique(np.concatenate(keys), return_index=True)
    cell = unpacked(np.concatenate(cells)[at])
    rest, third = np.divmod(key, width)
    first, second = np.divmod(rest, width)
    rows = [(first, second, third, packed(cell))]
    for _ in range(2):  # seen from the next arm
        cell = cell.copy()
        cell[:, 1] = (cell[:, 1] + NEXT) % HEADINGS
        cell[:, 2:] -= PARTS * pairs.offset[first]
        assert len(cell) == 0 or np.abs(cell[:, 2:]).max() <= FAR
        first, second, third = second, third, first
        rows.append((first, second, third, packed(cell)))
    first, second, third, packs = (np.concatenate(column) for column in zip(*rows, strict=True))
    order = np.lexsort((third, second, first))
    begin = np.searchsorted(first[order], np.arange(len(pairs) + 1))
    return Links(begin, second[order], third[order], packs[order])


def triples(first: Ints, second: Ints, third: Ints) -> tuple[Ints, Ints, Ints]:
    """Rows (i, j, k) of holds of three arms of which every two hold together: types ``first[i, j]``, ``second[j, k]``
    and ``third[k, i]``, -1 where they do not.
    """
    good = (first >= 0)[:, :, None] & (second >= 0)[None] & (third.T >= 0)[:, None, :]
    i, j, k = np.nonzero(good)
    return i, j, k
