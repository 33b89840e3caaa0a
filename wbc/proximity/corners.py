"""Rows for corners and ends of pairs that are close: what nearest points jump to.

A row for the nearest points of two bodies does not see the far end of an edge that lies along a face. Any point a of
body A and any point b of body B are at least as far apart as the bodies are,

    |b - a| >= distance,

so a row for |b - a| asks for nothing that the distance does not ask for: nothing that is allowed is forbidden. Here a
is a corner (the centre of a ball, for round ends) and b its nearest point of B, and the other way round. Of each pair
that is close the nearest of these have rows; for other pairs they are too far to matter.
"""

from __future__ import annotations

import numpy as np

from wbc.proximity.measured import Measured
from wbc.shapes import FAR, Box, Capsule, Convex, Cylinder, HalfSpace, Shape
from wbc.validation import Array

#: Pairs farther apart than the margin and this share of the robot's characteristic length have no such rows.
NEAR = 0.05
#: A hull has at most this many corners here, those farthest from each other.
HULL_CORNERS = 16
#: Points on each rim of a cylinder.
RIM = 8
#: A corner no farther than this from the core of the other body is inside, and has no row [m].
INSIDE = 1e-6


class CornerDistances:
    """Distances of the corners of each body of some pairs from the other one; in C ``native/corners.h``.

    Corners are those of boxes and hulls, the centres of the balls at a capsule's ends, and points on a cylinder's rims;
    spheres have none. Hulls and half-spaces are not the other body of a corner: that is a sphere, capsule, box or
    cylinder, whose nearest point has a closed form.

    Args:
        sensing: whose bodies are placed.
        count: how many corners a pair has rows for.
    """

    def __init__(self, sensing: Measured, count: int) -> None:
        self.sensing, self.count, self._scene = sensing, count, sensing.scene
        centers = self._scene.centers
        self._points = [corners_of(body.shape, centers[k]) for k, body in enumerate(self._scene.bodies)]
        self._closed = [not isinstance(body.shape, (Convex, HalfSpace)) for body in self._scene.bodies]

    def measure(self, pair: int) -> tuple[Array, Array]:
        """(distances [m], lines) of the nearest corners of a pair, ``count`` and ``count`` x 6, in a fixed order.

        A line is (n, p x n), as for the pair itself. Where there is no corner the distance is ``FAR``.
        """
        a, b = int(self._scene.first[pair]), int(self._scene.second[pair])
        found = [self._against(a, b, 1.0), self._against(b, a, -1.0)]
        gap, line = (np.concatenate(parts) for parts in zip(*found, strict=True))
        best = np.sort(np.argsort(gap, kind="stable")[: self.count])
        gaps, lines = np.full(self.count, FAR), np.zeros((self.count, 6))
        gaps[: len(best)], lines[: len(best)] = gap[best], line[best]
        return gaps, lines

    def _against(self, own: int, other: int, sign: float) -> tuple[Array, Array]:
        """(distances, lines) of all corners of one body from another that are not inside it."""
        turns, centers, supports = self.sensing.rotations, self.sensing.centers, self.sensing.supports
        points = self._points[own] if self._closed[other] else np.zeros((0, 3))
        points = points @ turns[own].T + centers[own]
        local = (points - centers[other]) @ turns[other]
        core = np.clip(local, -supports.box[other], supports.box[other])
        if supports.disc[other] > 0.0:
            width = np.hypot(local[:, 0], local[:, 1])
            core[:, :2] = local[:, :2] * np.minimum(1.0, supports.disc[other] / np.maximum(width, INSIDE))[:, None]
        offset = core - local
        length = np.linalg.norm(offset, axis=1)
        points, offset, length = (part[length > INSIDE] for part in (points, offset, length))
        ball = supports.ball[own] if self._closed[own] else 0.0
        normal = sign * offset @ turns[other].T / length[:, None]
        return length - ball - supports.ball[other], np.hstack([normal, np.cross(points, normal)])


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
