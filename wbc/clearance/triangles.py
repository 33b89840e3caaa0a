"""Distances of many points and segments from the triangles of one surface, in closed form."""

from __future__ import annotations

from collections.abc import Callable
from math import pi

import numpy as np
from numpy.typing import NDArray

from wbc.robot.geometry.segments import segment_distances
from wbc.validation import Array

#: Points times triangles that are measured at once
AT_ONCE = 200_000


def point_distances(corners: Array, points: Array) -> Array:
    """Distance [m] of points ``[n, 3]`` from triangles ``[t, 3, 3]``, ``[n]``."""
    return _by_parts(corners, points, points, _point_distances)


def least_distances(corners: Array, a: Array, b: Array) -> Array:
    """Distance [m] of the segments from ``a`` to ``b``, ``[n, 3]`` each, from triangles ``[t, 3, 3]``, ``[n]``.

    Where a segment goes through no triangle, the nearest point of the two is an end of the segment or on an edge.
    """
    return _by_parts(corners, a, b, _least_distances)


def within(corners: Array, points: Array) -> NDArray[np.bool_]:
    """Whether points ``[n, 3]`` are within a closed surface of triangles ``[t, 3, 3]``: by the solid angle it fills.

    Source: Van Oosterom and Strackee, The solid angle of a plane triangle, 1983.
    """
    return np.asarray(_by_parts(corners, points, points, _fullness) > 0.5)


def _by_parts(corners: Array, a: Array, b: Array, measure: Callable[[Array, Array, Array], Array]) -> Array:
    size = max(1, AT_ONCE // len(corners))
    parts = [measure(corners, a[k : k + size], b[k : k + size]) for k in range(0, len(a), size)]
    return np.concatenate(parts) if parts else np.zeros(0)


def _fullness(corners: Array, points: Array, _: Array) -> Array:
    """Solid angle of the surface as seen from the points, in parts of the whole."""
    a, b, c = np.moveaxis(corners[None] - points[:, None, None], 2, 0)
    la, lb, lc = (np.linalg.norm(x, axis=-1) for x in (a, b, c))
    under = la * lb * lc + _dot(a, b) * lc + _dot(b, c) * la + _dot(c, a) * lb
    angle = 2.0 * np.arctan2(_dot(a, np.cross(b, c)), under).sum(axis=1)
    return np.asarray(np.abs(angle) / (4.0 * pi))


def _point_distances(corners: Array, points: Array, _: Array) -> Array:
    normal, edges = _frames(corners)
    height, over = _above(corners, normal, edges, points[:, None])
    at = np.broadcast_to(points.T[:, :, None], (3, len(points), len(corners)))
    rim = [segment_distances(at, at, *_edge(corners, k)) for k in range(3)]
    return np.asarray(np.minimum(np.where(over, np.abs(height), np.inf), np.min(rim, axis=0)).min(axis=1))


def _least_distances(corners: Array, a: Array, b: Array) -> Array:
    normal, edges = _frames(corners)
    low, over_low = _above(corners, normal, edges, a[:, None])
    high, over_high = _above(corners, normal, edges, b[:, None])
    ends = [np.where(over, np.abs(height), np.inf) for height, over in ((low, over_low), (high, over_high))]
    shape = (3, len(a), len(corners))
    first, last = (np.broadcast_to(x.T[:, :, None], shape) for x in (a, b))
    rim = [segment_distances(first, last, *_edge(corners, k)) for k in range(3)]
    out = np.minimum(np.minimum(*ends), np.min(rim, axis=0))
    part = low / np.where(low == high, 1.0, low - high)
    meeting = a[:, None] + part[..., None] * (b - a)[:, None]
    through = (low * high < 0.0) & _above(corners, normal, edges, meeting)[1]
    return np.asarray(np.where(through, 0.0, out).min(axis=1))


def _frames(corners: Array) -> tuple[Array, Array]:
    """Unit normals [t, 3] (none: 0) and edges [t, 3, 3]."""
    edges = np.roll(corners, -1, axis=1) - corners
    normal = np.cross(edges[:, 0], edges[:, 1])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    return normal / np.where(length > 0.0, length, 1.0), edges


def _above(corners: Array, normal: Array, edges: Array, points: Array) -> tuple[Array, NDArray[np.bool_]]:
    """(height over the planes, whether it is over the triangles) of points [n, 1 or t, 3], [n, t] each."""
    height = _dot(points - corners[:, 0], normal)
    inner = [_dot(np.cross(edges[:, k], points - corners[:, k]), normal) >= 0.0 for k in range(3)]
    # A triangle without area has no inside; its edges are all of it
    flat = ~np.any(normal, axis=1)
    return height, np.asarray(np.all(inner, axis=0) & ~flat)


def _edge(corners: Array, k: int) -> tuple[Array, Array]:
    return corners[:, k].T[:, None], corners[:, (k + 1) % 3].T[:, None]


def _dot(x: Array, y: Array) -> Array:
    return np.asarray((x * y).sum(axis=-1))
