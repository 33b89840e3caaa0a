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


class Hull:
    """The convex hull of points.

    Attributes:
        vertices: its vertices [n x 3]; all distinct points where they are flat or too few for a hull.
        facets: rows (normal, offset) with normal . x + offset <= 0 inside [m x 4]; none where the points are flat.
    """

    def __init__(self, points: Array) -> None:
        # Imported here: most processes fit no shapes, and scipy takes longer to import than all the rest
        from scipy.spatial import ConvexHull, QhullError

        self.vertices = np.unique(points, axis=0)
        self.facets = np.zeros((0, 4))
        if len(self.vertices) < 4:
            return
        try:
            hull = ConvexHull(self.vertices)
        except QhullError:
            return
        self.vertices, self.facets = np.asarray(self.vertices[hull.vertices]), np.asarray(hull.equations)

    def beyond(self, points: Array) -> Array:
        """Per point (n x 3), the largest signed distance to a facet's plane [m]: negative inside. 0 for a flat hull."""
        if len(self.facets) == 0:
            return np.zeros(len(points))
        return np.asarray((points @ self.facets[:, :3].T + self.facets[:, 3]).max(axis=1))

    def excess(self, a: Array, b: Array, radius: float) -> float:
        """How far the capsule about the segment a b stands out of the hull [m].

        Exact to rounding for ends inside the hull; for ends outside, an upper bound within 1e-7 of the hull's size.
        """
        return max(0.0, *(float(radius + self._distance(end)) for end in (a, b)))

    def _distance(self, point: Array) -> float:
        """Distance of a point to the hull [m]; negative inside, where it is that to the nearest facet."""
        beyond = float(self.beyond(point[None])[0])
        if len(self.facets) and beyond <= 0.0:
            return beyond
        from scipy.optimize import nnls

        centred = self.vertices - point
        size = max(float(np.abs(centred).max()), 1e-300)
        matrix = np.vstack([centred.T / size, np.full(len(centred), _HEAVY)])
        weights, _ = nnls(matrix, np.array([0.0, 0.0, 0.0, _HEAVY]))
        return float(np.linalg.norm(weights @ centred) / weights.sum())


def excess(corners: Array, a: Array, b: Array, radius: float) -> float:
    """:meth:`Hull.excess` over the convex hull of ``corners``."""
    return Hull(np.asarray(corners)).excess(a, b, radius)
