"""Capsules around bodies."""

from __future__ import annotations

import numpy as np

from wbc.validation import Array


def quick_capsule(points: Array) -> tuple[Array, Array, float]:
    """(end, end, radius) of a capsule about the points' principal axis that contains them all: no fit, but fast."""
    center = points.mean(axis=0)
    axis = np.linalg.svd(points - center, full_matrices=False)[2][0]
    across = points - np.outer(points @ axis, axis)
    middle = (across.min(axis=0) + across.max(axis=0)) / 2
    middle -= axis * (middle @ axis)
    radius = float(np.linalg.norm(across - middle, axis=1).max())
    a, b = shortest(points, np.concatenate([middle, middle + axis, [radius]]))
    return a, b, float(distance_to_segment(points, a, b).max())


def distance_to_segment(points: Array, a: Array, b: Array) -> Array:
    """Distance [m] of each point (n x 3) to the segment a b."""
    span = b - a
    square = float(span @ span)
    t = np.clip((points - a) @ span / square, 0.0, 1.0) if square > 0.0 else np.zeros(len(points))
    return np.asarray(np.linalg.norm(points - a - t[:, None] * span, axis=1))


def around_cylinder(radius: float, half: float, inner: float | None = None) -> tuple[float, float, float]:
    """(capsule radius R, capsule half length h, excess) [m] of the least capsule, on the same axis, that contains
    a cylinder of this radius and half length: R in [r, sqrt(r^2 + half^2)], h = half - sqrt(R^2 - r^2), and

        excess = R - min(inner, half - h)

    where ``inner`` is how far the body reaches sideways where it reaches least (default: the radius itself;
    less for a box, whose corners lie on the cylinder).
    """
    cut = np.sqrt(np.linspace(0.0, half**2, 2001))  # half - h; not of R^2 - r^2, which may round to less than 0
    r, h = np.hypot(radius, cut), half - cut
    best = int(np.argmin(2 * h * r**2 + 4 / 3 * r**3))
    side = radius if inner is None else inner
    return float(r[best]), float(h[best]), float(r[best] - min(side, half - h[best]))


def around_ellipsoid(radii: Array) -> tuple[float, float, float]:
    """(capsule radius, capsule half length, excess) [m] for semi-axes a <= b <= c: radius b, half length c - b."""
    a, b, c = sorted(float(x) for x in radii)
    s = np.linspace(0.0, 1.0, 2001)
    gap = b + (c - b) * s - np.sqrt(a**2 * (1 - s**2) + c**2 * s**2)
    return b, c - b, float(max(gap.max(), 0.0))


def shortest(points: Array, capsule: Array) -> tuple[Array, Array]:
    """Ends of the shortest segment on a capsule's axis that keeps all points within its radius.

    The point at t on the axis, d off it, allows ends a <= t + s and b >= t - s with s = sqrt(r^2 - d^2).
    """
    origin, span, radius = capsule[:3], capsule[3:6] - capsule[:3], float(capsule[6])
    length = float(np.linalg.norm(span))
    if length < 1e-9:
        return origin, origin
    axis = span / length
    t = (points - origin) @ axis
    off = np.linalg.norm(points - origin - t[:, None] * axis, axis=1)
    s = np.sqrt(np.maximum(radius**2 - off**2, 0.0))
    first, last = float((t + s).min()), float((t - s).max())
    if last - first < 1e-6:
        first = last = (first + last) / 2
    return origin + first * axis, origin + last * axis
