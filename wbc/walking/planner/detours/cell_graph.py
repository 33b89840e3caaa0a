"""The graph of cells: connected sets, and how far it is from cell to cell where hands have holds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from wbc.validation import Array
from wbc.walking.planner.detours.cell_grips import Flags
from wbc.walking.planner.detours.cells import Cells, Ints

#: What a step counts along the path, beside it, lower, and by 15 degrees of heading [stations]
STEPS = (1.0, 1.0, 0.25, 0.25)
#: A cell counts more where no arm with a hold is to spare, or one of the arms has no more than one
NONE_SPARE, POOR = 4.0, 2.0


def round_labels(flags: Flags) -> NDArray[np.int32]:
    """Numbers of connected sets of an array whose last axis is round, from 1 on; 0 where it is false."""
    out: NDArray[np.int32] = label(flags)[0]
    first, last = out[..., 0], out[..., -1]
    across = (first > 0) & (last > 0) & (first != last)
    if not across.any():
        return out
    # Of sets that go on beyond the end of the axis the first one gives the number
    same = np.arange(out.max() + 1, dtype=np.int32)
    for a, b in set(zip(first[across].tolist(), last[across].tolist(), strict=True)):
        low, high = sorted((int(same[a]), int(same[b])))
        same[same == high] = low
    return np.unique(same, return_inverse=True)[1].astype(np.int32)[out]


def distances(cells: Cells, counts: Ints, least: int, goal: int) -> Array:
    """How far cells are from the goal through cells at which enough arms have holds [stations]; inf where none lead.

    Args:
        counts: of the grips of each arm ``[arms, cells]``. least: so many arms must hold.
    """
    arms = (counts > 0).sum(axis=0)
    flags = (arms >= least).reshape(cells.shape)
    out = np.full(len(cells), np.inf)
    if not flags.reshape(-1)[goal]:
        return out
    dear = np.where(arms == least, NONE_SPARE, np.where(counts.min(axis=0) < 2, POOR, 1.0))[flags.reshape(-1)]
    number, count = _numbered(flags)
    steps = (*STEPS[:3], STEPS[3] * 24.0 / cells.shape[3])
    edges = [(*_along(number, axis), step) for axis, step in enumerate(steps)]
    i, j = (np.concatenate([edge[side] for edge in edges]) for side in (0, 1))
    price = np.concatenate([np.full(len(edge[0]), edge[2]) for edge in edges]) * 0.5 * (dear[i] + dear[j])
    graph = coo_array((price, (i, j)), shape=(count, count)).tocsr()
    found = dijkstra(graph, directed=False, indices=int(number.reshape(-1)[goal]))
    out[flags.reshape(-1)] = found
    return out


def _numbered(flags: Flags) -> tuple[Ints, int]:
    count = int(flags.sum())
    number = np.full(flags.shape, -1, dtype=np.int64)
    number[flags] = np.arange(count)
    return number, count


def _along(number: Ints, axis: int) -> tuple[Ints, Ints]:
    """Neighbours along an axis; the last one is round."""
    here, there = number, np.roll(number, -1, axis=axis)
    if axis < number.ndim - 1:
        inner = np.arange(number.shape[axis] - 1)
        here, there = here.take(inner, axis=axis), there.take(inner, axis=axis)
    both = (here >= 0) & (there >= 0)
    return here[both], there[both]
