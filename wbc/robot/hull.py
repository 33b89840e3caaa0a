"""Convex hulls of points, and how far spheres and capsules stand out of them.

The *excess* of a shape A over a convex body B is how far A's farthest point is from B,

    max over unit u of  h_A(u) - h_B(u),  or 0,       h the support function            [m]

(Schneider, Convex Bodies, theorem 1.8.11). Where A contains B this is the Hausdorff distance of the two. For a ball
about c the maximum is radius + distance of c to B outside of B, and radius - least distance of c to a facet of B
inside; a capsule is the hull of two balls, so its excess is the larger of theirs.
"""

from __future__ import annotations

import numpy as np

from wbc.validation import Array

#: Weight of "the weights sum to one" against lengths in units of the hull's size, in the distance from outside
_HEAVY = 1e5


def hull_vertices(points: Array) -> Array:
    """The vertices of the convex hull; all distinct points where they are flat or too few for a hull."""
    return _hull(points)[0]


def excess(corners: Array, a: Array, b: Array, radius: float) -> float:
    """How far the capsule about the segment a b stands out of the convex hull of ``corners`` [m].

    Exact to rounding for ends inside the hull; for ends outside, an upper bound within 1e-7 of the hull's size.
    """
    vertices, facets = _hull(np.asarray(corners))
    return max(0.0, *(radius + _signed_distance(vertices, facets, end) for end in (a, b)))


def _hull(points: Array) -> tuple[Array, Array | None]:
    """(vertices, facets [n x 4] with normal . x + offset <= 0 inside, or None where the points are flat or few)."""
    # Imported here: most processes fit no shapes, and scipy takes longer to import than all the rest
    from scipy.spatial import ConvexHull, QhullError

    distinct = np.unique(points, axis=0)
    if len(distinct) < 5:
        return distinct, None
    try:
        hull = ConvexHull(distinct)
    except QhullError:
        return distinct, None
    return np.asarray(distinct[hull.vertices]), np.asarray(hull.equations)


def _signed_distance(vertices: Array, facets: Array | None, point: Array) -> float:
    """Distance of a point to the hull [m]; negative inside, where it is that to the nearest facet."""
    if facets is not None:
        beyond = float((facets[:, :3] @ point + facets[:, 3]).max())
        if beyond <= 0.0:
            return beyond
    from scipy.optimize import nnls

    centred = vertices - point
    size = max(float(np.abs(centred).max()), 1e-300)
    weights, _ = nnls(np.vstack([centred.T / size, np.full(len(vertices), _HEAVY)]), np.array([0, 0, 0, _HEAVY]))
    return float(np.linalg.norm(weights @ centred) / weights.sum())
