"""Distances of many segments from segments, obstacles and surfaces; written for the checker alone."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from wbc.clearance import TriangleMesh
from wbc.errors import UnknownNameError
from wbc.shapes import Box, Capsule, Cylinder, Sphere
from wbc.validation import Array
from wbc.walking.holds.obstacle import Obstacle
from wbc.walking.holds.surface import CylinderSurface, PlaneSurface, Surface

#: Thirds taken of an interval in which a convex function is least: (2/3)^60 = 3e-11
THIRDS = 60
#: Parts of a segment that a bound looks at
PARTS = 4
#: A box is this much larger than what it holds [m]
EDGE = 1e-6


def between_segments(a: Array, b: Array, c: Array, d: Array) -> Array:
    """Distance [s] of the segments a b and c d, [s, 3] each.

    Minimises |a + s u - c - t v|^2 over the unit square: s of the lines' closest points, clipped; t for that s,
    clipped; s again for that t. (Ericson, Real-Time Collision Detection, 5.1.9.)
    """
    u, v, w = b - a, d - c, a - c
    uu, vv, uv = _dot(u, u), _dot(v, v), _dot(u, v)
    uw, vw = _dot(u, w), _dot(v, w)
    determinant = uu * vv - uv * uv
    crossing = determinant > 1e-12 * uu * vv
    s = np.where(crossing, _clip((uv * vw - vv * uw) / np.where(crossing, determinant, 1.0)), 0.0)
    t = _clip(np.where(vv > 0.0, (uv * s + vw) / np.where(vv > 0.0, vv, 1.0), 0.0))
    s = np.where(uu > 0.0, _clip((uv * t - uw) / np.where(uu > 0.0, uu, 1.0)), 0.0)
    return np.asarray(np.linalg.norm(w + s[:, None] * u - t[:, None] * v, axis=1))


def from_obstacle(obstacle: Obstacle, a: Array, b: Array) -> Array:
    """Signed distance [s] of the segments a b from an obstacle, [s, 3] each."""
    place, shape = obstacle.placement, obstacle.shape
    if isinstance(shape, TriangleMesh):
        return shape.segment_distance(
            (a - place.translation) @ place.rotation, (b - place.translation) @ place.rotation
        )
    if isinstance(shape, (Capsule, Sphere)):
        half = (shape.length / 2 if isinstance(shape, Capsule) else 0.0) * place.rotation[:, 2]
        ends = (np.broadcast_to(place.translation + side * half, a.shape) for side in (-1.0, 1.0))
        return np.asarray(between_segments(a, b, *ends) - shape.radius)
    local = [(x - place.translation) @ place.rotation for x in (a, b)]
    size = np.array([shape.radius, shape.length / 2] if isinstance(shape, Cylinder) else np.array(shape.size) / 2)

    def distance(x: Array) -> Array:
        if isinstance(shape, Cylinder):
            x = np.stack([np.hypot(x[:, 0], x[:, 1]), x[:, 2]], axis=1)
        return _from_box(x, size)

    return _least_on(distance, *local)


def at_least(obstacle: Obstacle, a: Array, b: Array) -> Array:
    """No more than :func:`from_obstacle` [s]: from the middles of parts of a segment to the box about the obstacle."""
    place, shape = obstacle.placement, obstacle.shape
    middle, half = np.zeros(3), np.zeros(3)
    if isinstance(shape, TriangleMesh):
        low, high = shape.corners.min(axis=(0, 1)), shape.corners.max(axis=(0, 1))
        middle, half = (low + high) / 2.0, (high - low) / 2.0
    elif isinstance(shape, Box):
        half = np.array(shape.size) / 2.0
    else:
        high = 0.0 if isinstance(shape, Sphere) else shape.length / 2.0
        round_ends = 0.0 if isinstance(shape, Cylinder) else shape.radius
        half = np.array([shape.radius, shape.radius, high + round_ends])
    first, last = ((end - place.translation) @ place.rotation - middle for end in (a, b))
    parts = ((k + 0.5) / PARTS for k in range(PARTS))
    near = np.min([_from_box(first + part * (last - first), half) for part in parts], axis=0)
    return np.asarray(near - np.sqrt(_dot(b - a, b - a)) / (2.0 * PARTS))


def from_surface(surface: Surface, a: Array, b: Array) -> Array:
    """Signed height [s] of the lowest points of the segments a b above a plane or a cylinder, [s, 3] each."""
    if isinstance(surface, PlaneSurface):
        normal, at = surface.pose.rotation[:, 2], surface.pose.translation
        return np.asarray(np.minimum((a - at) @ normal, (b - at) @ normal))
    if not isinstance(surface, CylinderSurface):
        raise UnknownNameError("surface", type(surface).__name__, ("PlaneSurface", "CylinderSurface"))
    # In the plane across the axis: the distance of a segment from the origin
    p, q = (((x - surface.pose.translation) @ surface.pose.rotation)[:, :2] for x in (a, b))
    zero = np.zeros((len(p), 1))
    flat = [np.concatenate([x, zero], axis=1) for x in (p, q, 0 * p, 0 * p)]
    return np.asarray(between_segments(*flat) - surface.radius)


def from_tangents(positions: Array, axes: Array, a: Array, b: Array) -> Array:
    """Height [s] of the lower end above the plane through the nearest hold, across its axis.

    Args:
        positions, axes: of the holds, [h, 3].
    """
    heights = []
    for end in (a, b):
        near = nearest(positions, end)[0]
        heights.append(-((end - positions[near]) * axes[near]).sum(axis=1))
    return np.asarray(np.minimum(*heights))


def nearest(points: Array, of: Array) -> tuple[np.ndarray, Array]:
    """(row of ``points`` [h, 3], distance [m]) that is nearest to each of ``of``, [s, 3]."""
    square = (points**2).sum(axis=1) - 2.0 * (of @ points.T)
    row = np.argmin(square, axis=1)
    return row, np.linalg.norm(of - points[row], axis=1)


def near_any(points: Array, of: Array, distance: float) -> NDArray[np.bool_]:
    """Whether one of ``points`` [h, 3] is within a distance [m] of each of ``of``, [s, 3]."""
    if not len(of):
        return np.zeros(0, dtype=bool)
    # None outside the box about them is; rounding must not leave out one at its edge
    low, high = of.min(axis=0) - distance, of.max(axis=0) + distance
    inside = ((points >= low - EDGE) & (points <= high + EDGE)).all(axis=1)
    if not inside.any():
        return np.zeros(len(of), dtype=bool)
    return np.asarray(nearest(points[inside], of)[1] <= distance)


def _from_box(x: Array, half: Array) -> Array:
    """Signed distance of points [s, n] from the box from -half to half [n]."""
    beyond = np.abs(x) - half
    outside = np.maximum(beyond, 0.0)
    return np.asarray(np.sqrt(_dot(outside, outside)) + np.minimum(beyond.max(axis=1), 0.0))


def _least_on(function: Callable[[Array], Array], a: Array, b: Array) -> Array:
    """Least value on segments of a function that is convex along them, by thirds."""
    low, high, span = np.zeros(len(a)), np.ones(len(a)), b - a
    for _ in range(THIRDS):
        third = (high - low) / 3.0
        left, right = low + third, high - third
        better = function(a + left[:, None] * span) < function(a + right[:, None] * span)
        low, high = np.where(better, low, left), np.where(better, right, high)
    middle = function(a + ((low + high) / 2.0)[:, None] * span)
    return np.asarray(np.minimum(middle, np.minimum(function(a), function(b))))


def _dot(x: Array, y: Array) -> Array:
    return np.asarray(np.einsum("ij,ij->i", x, y))


def _clip(x: Array) -> Array:
    return np.asarray(np.minimum(np.maximum(x, 0.0), 1.0))
