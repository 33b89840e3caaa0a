"""Polygons in the plane of a planar arm: their convex parts, and how far a link is from one."""

from __future__ import annotations

from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import RangeError
from wbc.validation import Array

#: Corners nearer to an edge than this share of the polygon's extent touch it
TOUCH = 1e-9
#: An axis on which bodies are apart by this share of their distance is its direction
ALONG = 1.0 - 1e-4


def from_polygon(ends: Array, corners: Array) -> tuple[Array, Array, Array]:
    """(unit normal out of a convex polygon, sizes of gaps along it, points of a line between two ends that have them).

    The least size is the distance. Both ends have one, as a line whose ends stay beyond the polygon along a direction
    stays clear of it. Where line and polygon overlap: minus the shortest way out, of the point that is deepest.
    """
    edges, (a, b) = np.roll(corners, -1, axis=0) - corners, ends
    way = b - a
    axes = np.stack((edges[:, 1], -edges[:, 0]), axis=1)
    if way.any():
        axes = np.vstack((axes, [-way[1], way[0]], [way[1], -way[0]]))
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    apart = (ends @ axes.T).min(axis=0) - (corners @ axes.T).max(axis=0)
    k = int(np.argmax(apart))
    if apart[k] <= 0.0:
        across = k >= len(corners)
        point = nearest(corners[np.argmax(corners @ axes[k])], a, way) if across else ends[np.argmin(ends @ axes[k])]
        return axes[k], apart[k : k + 1], point[None]
    own = np.vstack((np.repeat(ends, len(corners), axis=0), nearest(corners, a, way)))
    other = np.vstack((nearest(ends[:, None], corners, edges).reshape(-1, 2), corners))
    sizes = np.hypot(*(own - other).T)
    j = int(np.argmin(sizes))
    # The axis, where that is the nearest way: the difference of two points that nearly touch has no direction
    normal = axes[k] if apart[k] > ALONG * sizes[j] else (own[j] - other[j]) / sizes[j]
    return normal, (ends - other[j]) @ normal, ends


def nearest(point: Array, start: Array, way: Array) -> Array:
    """Points of lines, ``way`` from ``start``, that are nearest to others [..., 2]."""
    share = ((point - start) * way).sum(axis=-1) / np.maximum((way * way).sum(axis=-1), 1e-300)
    return np.asarray(start + np.clip(share, 0.0, 1.0)[..., None] * way)


def convex_parts(polygon: Any) -> tuple[Array, ...]:
    """A polygon [k, 2] as convex ones, corners to the left around: itself, or triangles.

    Raises:
        RangeError: fewer than three corners, no area, or edges that touch or cross. ShapeError, NotFiniteError: no
            corners.
    """
    corners = validation.ordinary_array("polygon", polygon)
    corners = validation.ordinary_array("polygon", corners, (len(corners), 2) if corners.ndim else (0, 2))
    x, y = corners.T
    if float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) < 0.0:
        corners = corners[::-1]
    least, out = TOUCH * float(np.ptp(corners, axis=0).max(initial=0.0)) ** 2, list[Array]()
    # Corners on a line are none
    left = [p for k, p in enumerate(corners) if abs(_turn(*_ear(list(corners), k))) > least]
    if len(left) < 3 or _touches(corners):
        raise RangeError("polygon", polygon, "expected three corners or more, and edges that do not touch or cross")
    while min(bends := [_turn(*_ear(left, k)) for k in range(len(left))]) < 0.0:
        for k, bend in enumerate(bends):
            ear = _ear(left, k)
            others = (p for p in left if not any(p is corner for corner in ear))
            if bend > 0.0 and not any(_within(p, ear) for p in others):
                out.append(np.array(ear))
                del left[k]
                break
        else:
            raise RangeError("polygon", polygon, "expected corners that are farther from edges")
    return (*out, np.array(left))


def _ear(left: list[Array], k: int) -> tuple[Array, Array, Array]:
    return left[k - 1], left[k], left[(k + 1) % len(left)]


def _turn(a: Array, b: Array, c: Array) -> float:
    """Twice the area to the left around."""
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


def _within(p: Array, ear: tuple[Array, Array, Array]) -> bool:
    a, b, c = ear
    return _turn(a, b, p) >= 0.0 and _turn(b, c, p) >= 0.0 and _turn(c, a, p) >= 0.0


def _touches(corners: Array) -> bool:
    """Whether a corner is on an edge that it does not end, or two edges cross."""
    count, size = len(corners), float(np.ptp(corners, axis=0).max())
    ends = np.roll(corners, -1, axis=0)
    for j, (a, b) in enumerate(zip(corners, ends, strict=True)):
        others = [k for k in range(count) if k not in (j, (j + 1) % count)]
        if np.hypot(*(corners[others] - nearest(corners[others], a, b - a)).T).min() <= TOUCH * size:
            return True
        for c, d in zip(corners[:j], ends[:j], strict=True):
            if _turn(a, b, c) * _turn(a, b, d) < 0.0 and _turn(c, d, a) * _turn(c, d, b) < 0.0:
                return True
    return False
