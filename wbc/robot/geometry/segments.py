"""Distances of many segments at once, and capsules that bound shapes."""

from __future__ import annotations

import numpy as np

from wbc.robot.geometry.fitting import around_cylinder, quick_capsule
from wbc.shapes import Box, Capsule, Convex, Cylinder, PlacedShape
from wbc.validation import Array


def bounding_capsule(placed: PlacedShape) -> tuple[Array, Array, float]:
    """(end a, end b, radius) of a capsule in the link's frame that contains the shape; exact for spheres, capsules."""
    shape, place = placed.shape, placed.placement
    if isinstance(shape, Convex):
        a, b, radius = quick_capsule(shape.points)
    elif isinstance(shape, (Box, Cylinder)):
        if isinstance(shape, Box):
            half = np.array(shape.size) / 2
            axis = int(np.argmax(half))
            radius, reach, _ = around_cylinder(float(np.hypot(*np.delete(half, axis))), float(half[axis]))
        else:
            axis = 2
            radius, reach, _ = around_cylinder(shape.radius, shape.length / 2)
        b = reach * np.eye(3)[axis]
        a = -b
    else:
        reach = shape.length / 2 if isinstance(shape, Capsule) else 0.0
        a, b, radius = np.array([0.0, 0.0, -reach]), np.array([0.0, 0.0, reach]), shape.radius
    return place * a, place * b, radius


def segment_distances(a: Array, b: Array, c: Array, d: Array) -> Array:
    """Distance [m] of the segments a b and c d, column by column (3 x n each).

    The least of the distances of the four ends to the other segment and, where both feet lie within the segments,
    of the two lines: a closest pair of points has an end, or is the common perpendicular's.
    """
    u, v, w = b - a, d - c, a - c
    uu, uv, vv = _dot(u, u), _dot(u, v), _dot(v, v)
    uw, vw, ww = _dot(u, w), _dot(v, w), _dot(w, w)
    # Squared distances of the ends, from the scalar products alone: |w + s u - t v|^2
    over_v, over_u = np.where(vv > 0.0, vv, 1.0), np.where(uu > 0.0, uu, 1.0)

    def square(s: Array | float, t: Array | float) -> Array:
        return np.asarray(ww + s * (s * uu + 2 * uw) + t * (t * vv - 2 * vw) - 2 * (s * t) * uv)

    def clipped(x: Array) -> Array:
        return np.minimum(np.maximum(x, 0.0), 1.0)

    least = np.minimum(
        np.minimum(square(0.0, clipped(vw / over_v)), square(1.0, clipped((vw + uv) / over_v))),
        np.minimum(square(clipped(-uw / over_u), 0.0), square(clipped((uv - uw) / over_u), 1.0)),
    )
    # Nearly parallel lines have their closest points at an end, too
    determinant = uu * vv - uv * uv
    crossing = determinant > 1e-12 * uu * vv
    safe = np.where(crossing, determinant, 1.0)
    s, t = (uv * vw - vv * uw) / safe, (uu * vw - uv * uw) / safe
    within = crossing & (s >= 0.0) & (s <= 1.0) & (t >= 0.0) & (t <= 1.0)
    gap = w + s * u - t * v
    return np.asarray(np.sqrt(np.maximum(np.where(within, np.minimum(least, _dot(gap, gap)), least), 0.0)))


def _dot(x: Array, y: Array) -> Array:
    return np.asarray(x[0] * y[0] + x[1] * y[1] + x[2] * y[2])
