"""Rows for corners and ends of pairs that are close: what nearest points jump to.

A row for the nearest points of two bodies does not see the far end of an edge that lies along a face. Any point a of
body A and any point b of body B are at least as far apart as the bodies are,

    |b - a| >= distance,

so a row for |b - a| asks for nothing that the distance does not ask for: nothing that is allowed is forbidden. Here a
is a corner (the centre of a ball, for round ends) and b its nearest point of B, and the other way round. Of each pair
that is close the nearest of these have rows; for other pairs they are too far to matter (``native/corners.h``).

Corners are those of boxes and hulls, the centres of the balls at a capsule's ends, and points on a cylinder's rims;
spheres have none. Hulls and half-spaces are not the other body of a corner: that is a sphere, capsule, box or cylinder,
whose nearest point has a closed form.
"""

from __future__ import annotations

import numpy as np

from wbc.shapes import Box, Capsule, Convex, Cylinder, Shape
from wbc.validation import Array

#: Pairs farther apart than the margin and this share of the robot's characteristic length have no such rows.
NEAR = 0.05
#: A hull has at most this many corners here, those farthest from each other.
HULL_CORNERS = 16
#: Points on each rim of a cylinder.
RIM = 8


def corners_of(shape: Shape, center: Array) -> Array:
    """Corners of a shape about ``center`` in its frame, n x 3."""
    signs = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
    if isinstance(shape, Box):
        return np.asarray(signs * np.array(shape.size) / 2)
    if isinstance(shape, Capsule):
        return np.array([[0.0, 0.0, -0.5], [0.0, 0.0, 0.5]]) * shape.length
    if isinstance(shape, Cylinder):
        turn = 2 * np.pi * np.arange(RIM) / RIM
        rim = np.stack([np.cos(turn), np.sin(turn)], axis=1) * shape.radius
        return np.vstack([np.column_stack([rim, np.full(RIM, z)]) for z in (-shape.length / 2, shape.length / 2)])
    if isinstance(shape, Convex):
        return spread(shape.points - center, HULL_CORNERS)
    return np.zeros((0, 3))


def spread(points: Array, count: int) -> Array:
    """At most ``count`` of some points: the farthest from the origin, then the farthest from those chosen so far."""
    chosen = [int(np.argmax(np.linalg.norm(points, axis=1)))]
    away = np.full(len(points), np.inf)
    while len(chosen) < min(count, len(points)):
        away = np.minimum(away, np.linalg.norm(points - points[chosen[-1]], axis=1))
        chosen.append(int(np.argmax(away)))
    return points[sorted(chosen)]
