"""Lengths of ways over footholds, from which the search guesses what is left to go."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from wbc.validation import Array

#: Neighbours of a foothold in the graph
NEIGHBOURS = 12


def ways_over_footholds(positions: Array, seeds: Array, stride: float) -> Array:
    """Length of the shortest way from each foothold to a goal, in steps of at most ``stride`` between footholds.

        D = min over footholds f of  seeds_f + length of the way to f

    Where steps of that length lead nowhere, the straight distance to the nearest foothold that has a way is added three
    times.

    Args:
        positions: ``(n, 3)`` [m]. seeds: what is left from footholds at the goal, infinite at others ``(n)`` [m].

    Returns:
        ``(n)`` [m].
    """
    count = len(positions)
    tree = cKDTree(positions)
    lengths, to = tree.query(positions, k=min(NEIGHBOURS + 1, count), distance_upper_bound=stride)
    lengths, to = lengths.reshape(count, -1), to.reshape(count, -1)
    # Those at the far side of a gap are no nearest neighbours: a few of every ring of the stride count too
    rows, ends = np.nonzero(np.isfinite(lengths))
    start, end, size = rows, to[rows, ends], lengths[rows, ends]
    if len(pairs := _long_steps(tree, stride)):
        start, end = np.concatenate([start, pairs[:, 0]]), np.concatenate([end, pairs[:, 1]])
        size = np.concatenate([size, np.linalg.norm(positions[pairs[:, 0]] - positions[pairs[:, 1]], axis=1)])
    goal = np.flatnonzero(np.isfinite(seeds))
    start, end = np.concatenate([start, goal]), np.concatenate([end, np.full(len(goal), count)])
    size = np.concatenate([size, np.maximum(seeds[goal], 1e-9)])
    keep = start != end
    graph = coo_matrix((np.maximum(size[keep], 1e-9), (start[keep], end[keep])), shape=(count + 1, count + 1)).tocsr()
    out = np.asarray(dijkstra(graph, directed=False, indices=count))[:count]
    lost = ~np.isfinite(out)
    if lost.any():
        known = np.flatnonzero(~lost)
        away, nearest = cKDTree(positions[known]).query(positions[lost])
        out[lost] = out[known][nearest] + 3.0 * away
    return out


def within_spans(positions: Array, sources: Array, span: float) -> NDArray[np.bool_]:
    """Which footholds can be come to where those that are held at once are at most ``span`` apart [m].

    Args:
        positions: ``(n, 3)`` [m]. sources: rows that are held.

    Returns:
        ``(n)``, true at those.
    """
    reached = np.zeros(len(positions), dtype=bool)
    reached[sources] = True
    last = np.flatnonzero(reached)
    while len(last):
        waiting = np.flatnonzero(~reached)
        away, _ = cKDTree(positions[last]).query(positions[waiting], distance_upper_bound=span)
        last = waiting[np.isfinite(away)]
        reached[last] = True
    return reached


def _long_steps(tree: cKDTree, stride: float) -> Array:
    """All pairs within a stride, where these are few."""
    if tree.count_neighbors(tree, stride) > 60 * tree.n:
        return np.zeros((0, 2), dtype=int)
    return np.asarray(tree.query_pairs(stride, output_type="ndarray"))
