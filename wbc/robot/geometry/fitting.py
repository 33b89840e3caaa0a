"""Spheres and capsules that contain given bodies, and how far they stand out of them: see ``hull``."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wbc import validation
from wbc.errors import ShapeError
from wbc.robot.geometry.hull import Hull
from wbc.robot.recipe import segment_shape
from wbc.shapes import Capsule, PlacedShape, Sphere
from wbc.validation import Array


def fit_capsule(points: Array) -> PlacedShape:
    """The sphere or capsule of (locally) least volume that contains all points; volume pi r^2 l + 4/3 pi r^3.

    Args:
        points: n x 3 [m], at least one.

    Returns:
        The shape in the points' frame. ``excess`` is over the points' convex hull, see
        :meth:`~wbc.robot.geometry.hull.Hull.excess` for its accuracy.

    Raises:
        ShapeError, NotFiniteError: not n x 3 finite numbers.

    Cannot do: the least volume among all capsules is not guaranteed, as the problem has several minima; the
    best of four starts (three principal axes, and a ball) is taken.
    """
    cloud = validation.real_array("points", points)
    if cloud.ndim != 2 or cloud.shape[1] != 3 or len(cloud) == 0:
        raise ShapeError("points", points, "expected n x 3 numbers, n >= 1")
    hull = Hull(cloud)
    corners = hull.vertices
    middle = (corners.min(axis=0) + corners.max(axis=0)) / 2
    size = float(np.abs(corners - middle).max())
    if size == 0.0:
        return segment_shape(middle, middle, 0.0, 0.0)
    scaled = (corners - middle) / size
    best = min((_cutting_planes(scaled, *start) for start in _starts(scaled)), key=_volume)
    ends = _shortest(scaled, best)
    # the rotation from z to the axis rounds the ends, so the radius is measured from where the shape has them
    line = segment_shape(middle + size * ends[0], middle + size * ends[1], 0.0, 0.0)
    radius = float(distance_to_segment(cloud, *line.ends()).max()) * (1 + 1e-12)
    shape = Capsule(radius, line.shape.length) if isinstance(line.shape, Capsule) else Sphere(radius)
    return replace(line, shape=shape, excess=hull.excess(*line.ends(), radius))


def quick_capsule(points: Array) -> tuple[Array, Array, float]:
    """(end, end, radius) of a capsule about the points' principal axis that contains them all: no fit, but fast."""
    center = points.mean(axis=0)
    axis = np.linalg.svd(points - center, full_matrices=False)[2][0]
    across = points - np.outer(points @ axis, axis)
    middle = (across.min(axis=0) + across.max(axis=0)) / 2
    middle -= axis * (middle @ axis)
    radius = float(np.linalg.norm(across - middle, axis=1).max())
    a, b = _shortest(points, np.concatenate([middle, middle + axis, [radius]]))
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
    r = np.sqrt(np.linspace(0.0, half**2, 2001) + radius**2)
    h = half - np.sqrt(r**2 - radius**2)
    best = int(np.argmin(2 * h * r**2 + 4 / 3 * r**3))
    side = radius if inner is None else inner
    return float(r[best]), float(h[best]), float(r[best] - min(side, half - h[best]))


def around_ellipsoid(radii: Array) -> tuple[float, float, float]:
    """(capsule radius, capsule half length, excess) [m] for semi-axes a <= b <= c: radius b, half length c - b."""
    a, b, c = sorted(float(x) for x in radii)
    s = np.linspace(0.0, 1.0, 2001)
    gap = b + (c - b) * s - np.sqrt(a**2 * (1 - s**2) + c**2 * s**2)
    return b, c - b, float(max(gap.max(), 0.0))


def _spread_directions(n: int) -> Array:
    """n unit vectors, evenly spread (Fibonacci lattice)."""
    i = np.arange(n) + 0.5
    z = 1 - 2 * i / n
    turn = np.pi * (1 + np.sqrt(5.0)) * i
    flat = np.sqrt(1 - z**2)
    return np.column_stack([flat * np.cos(turn), flat * np.sin(turn), z])


def _starts(points: Array) -> list[tuple[Array, Array]]:
    """Segments to start from: along the three principal axes, half as long as the points reach, and a short one."""
    center = points.mean(axis=0)
    axes = np.linalg.eigh(np.cov(points.T) if len(points) > 1 else np.eye(3))[1].T
    out = []
    for axis in axes:
        along = (points - center) @ axis
        low, high = along.min(), along.max()
        middle, half = center + axis * (low + high) / 2, (high - low) / 4
        out.append((middle - half * axis, middle + half * axis))
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    out.append((middle - 0.01 * axes[-1], middle + 0.01 * axes[-1]))
    return out


def _shortest(points: Array, capsule: Array) -> tuple[Array, Array]:
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


def _volume(x: Array) -> float:
    return float(x[6] ** 2 * np.linalg.norm(x[3:6] - x[:3]) + 4 / 3 * x[6] ** 3)


def _cutting_planes(points: Array, a: Array, b: Array) -> Array:
    """:func:`_least_volume` of few points, those that stick out added until none do: hulls may have thousands."""
    chosen = np.unique((_spread_directions(60) @ points.T).argmax(axis=1))
    capsule = np.concatenate([a, b, [0.0]])
    for _ in range(8):
        capsule = _least_volume(points[chosen], a, b)
        gap = distance_to_segment(points, capsule[:3], capsule[3:6]) - capsule[6]
        if gap.max() <= 1e-9:
            break
        chosen = np.union1d(chosen, np.argsort(gap)[-30:])
        a, b = capsule[:3], capsule[3:6]
    capsule[6] = distance_to_segment(points, capsule[:3], capsule[3:6]).max()
    return capsule


def _least_volume(points: Array, a: Array, b: Array) -> Array:
    """(a, b, radius), a local minimum of the volume with radius >= distance of every point to the segment."""
    from scipy.optimize import minimize

    def slack(x: Array) -> Array:
        return np.asarray(x[6] - distance_to_segment(points, x[:3], x[3:6]))

    def slack_gradient(x: Array) -> Array:
        start, end = x[:3], x[3:6]
        span = end - start
        square = max(float(span @ span), 1e-18)
        t = np.clip((points - start) @ span / square, 0.0, 1.0)
        away = points - start - t[:, None] * span
        unit = away / np.maximum(np.linalg.norm(away, axis=1), 1e-12)[:, None]
        return np.column_stack([unit * (1 - t)[:, None], unit * t[:, None], np.ones(len(points))])

    def gradient(x: Array) -> Array:
        span = x[3:6] - x[:3]
        length = max(float(np.linalg.norm(span)), 1e-9)
        side = x[6] ** 2 * span / length
        return np.concatenate([-side, side, [2 * x[6] * length + 4 * x[6] ** 2]])

    start = np.concatenate([a, b, [distance_to_segment(points, a, b).max()]])
    rows = {"type": "ineq", "fun": slack, "jac": slack_gradient}
    options = {"maxiter": 100, "ftol": 1e-9}
    found = minimize(_volume, start, jac=gradient, constraints=[rows], method="SLSQP", options=options).x
    if not np.isfinite(found).all():
        return start
    found[6] = distance_to_segment(points, found[:3], found[3:6]).max()
    return np.asarray(found if _volume(found) < _volume(start) else start)
