"""Rows for corners and ends of pairs that are close: what nearest points jump to.

A row for the nearest points of two bodies does not see the far end of an edge that lies along a face. Any point a of
body A and any point b of body B are at least as far apart as the bodies are,

    |b - a| >= distance,

so a row for |b - a| asks for nothing that the distance does not ask for: nothing that is allowed is forbidden. Here a
is a corner (the centre of a ball, for round ends) and b its nearest point of B, and the other way round. Of each pair
that is close the nearest of these have rows; for other pairs they are too far to matter.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from wbc.proximity.memory import Index
from wbc.shapes import FAR, Box, Capsule, Convex, Cylinder, HalfSpace, Shape
from wbc.validation import Array

if TYPE_CHECKING:
    from wbc.proximity.scene import Scene

#: Pairs farther apart than the margin and this share of the robot's characteristic length have no such rows.
NEAR = 0.05
#: A hull has at most this many corners here, those farthest from each other.
HULL_CORNERS = 16
#: Points on each rim of a cylinder.
RIM = 8
#: A corner no farther than this from the core of the other body is inside, and has no row [m].
INSIDE = 1e-6

ONES, AFTER, BEFORE = np.ones(3), np.array([1, 2, 0]), np.array([2, 0, 1])


class Corners:
    """Distances of the corners of each body of some pairs from the other one.

    Corners are those of boxes and hulls, the centres of the balls at a capsule's ends, and points on a cylinder's rims;
    spheres have none. Hulls and half-spaces are not the other body of a corner: that is a sphere, capsule, box or
    cylinder, whose nearest point has a closed form.

    Args:
        scene: whose bodies are placed.
        count: how many corners a pair has rows for.
    """

    def __init__(self, scene: Scene, count: int) -> None:
        self.scene, self.count = scene, count
        found = [corners_of(body.shape, scene.shifts[k]) for k, body in enumerate(scene.bodies)]
        # A pair has places for as many as it has rows even if its bodies have fewer
        width = max(count, *(len(points) for points in found))
        self._points = np.zeros((len(found), width, 3))
        self._void = np.full((len(found), width), FAR)
        for k, points in enumerate(found):
            self._points[k, : len(points)], self._void[k, : len(points)] = points, 0.0
        self._width = width
        self._closed = np.array([not isinstance(body.shape, (Convex, HalfSpace)) for body in scene.bodies])
        self._pairs: Index = np.zeros(0, dtype=np.intp)

    def measure(self, pairs: Index) -> tuple[Array, Array]:
        """(distances [m], lines) of the nearest corners of n pairs, n x count and n x count x 6, in a fixed order.

        A line is (n, p x n), as for the pair itself. Where there is no corner the distance is ``FAR``.
        """
        if not np.array_equal(pairs, self._pairs):
            self._arrange(pairs)
        n, width = 2 * len(pairs), self._width
        poses = self.scene.poses.take(self._bodies, axis=0)
        turned = poses[:, :9].reshape(2 * n, 3, 3)
        # Rows of what is turned are axes: these are transposed rotations
        own, other = turned[:n], turned[n:]
        local = self._corners @ (own @ other.transpose(0, 2, 1))
        shift = poses[:n, 9:] - poses[n:, 9:]
        local += shift[:, None, :] @ other.transpose(0, 2, 1)
        offset = self._core(local)
        offset -= local
        length = np.sqrt((offset * offset).dot(ONES))
        gaps = length + self._bias
        gaps[length <= INSIDE] = FAR
        gaps = gaps.reshape(len(pairs), 2 * width)
        best = gaps.argsort(axis=1, kind="stable")[:, : self.count]
        best.sort(axis=1)
        best += self._offset
        gap, which = gaps.take(best), best.ravel()
        back = other.take(which // width, axis=0)
        # Distances from inside are not used, but must be numbers
        scale = self._sign.take(which) / np.maximum(length.take(which), INSIDE)
        normal = (offset.reshape(-1, 3).take(which, axis=0)[:, None, :] @ back)[:, 0] * scale[:, None]
        point = (local.reshape(-1, 3).take(which, axis=0)[:, None, :] @ back)[:, 0]
        point += poses[n:, 9:].take(which // width, axis=0)
        line = np.empty((len(which), 6))
        line[:, :3] = normal
        moment = point.take(AFTER, axis=1) * normal.take(BEFORE, axis=1)
        np.subtract(moment, point.take(BEFORE, axis=1) * normal.take(AFTER, axis=1), out=line[:, 3:])
        lines: Array = line.reshape(len(pairs), self.count, 6)
        none = gap > FAR / 2
        if np.count_nonzero(none):
            gap[none], lines[none] = FAR, 0.0
        return gap, lines

    def _arrange(self, pairs: Index) -> None:
        """What stays as long as the pairs are the same: corners of A against B, then of B against A, pair by pair."""
        scene, width = self.scene, self._width
        own = np.stack([scene.first[pairs], scene.second[pairs]], axis=1).ravel()
        other = np.stack([scene.second[pairs], scene.first[pairs]], axis=1).ravel()
        self._pairs, self._bodies = pairs.copy(), np.concatenate([own, other])
        self._corners = self._points[own]
        ball = np.where(self._closed, scene.supports.ball, 0.0)
        self._bias = self._void[own] - (ball[own] + ball[other])[:, None]
        self._bias += np.where(self._closed[other], 0.0, FAR)[:, None]
        self._box, self._disc = scene.supports.box[other][:, None, :], scene.supports.disc[other][:, None]
        self._less = -self._box
        self._sign = np.tile(np.repeat([1.0, -1.0], width), len(pairs))
        self._offset = 2 * width * np.arange(len(pairs))[:, None]

    def _core(self, local: Array) -> Array:
        """Nearest points of what is left of sphere, capsule, box and cylinder without the ball around it."""
        out: Array = np.minimum(local, self._box)
        np.maximum(out, self._less, out=out)
        if np.count_nonzero(self._disc):
            width = np.hypot(local[:, :, 0], local[:, :, 1])
            share = np.minimum(1.0, self._disc / np.maximum(width, INSIDE))
            out[:, :, :2] += local[:, :, :2] * (share * (self._disc > 0.0))[:, :, None]
        return out


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
