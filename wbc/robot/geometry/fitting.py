"""Spheres and capsules that contain given bodies, and how far they stand out of them: see ``hull``."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wbc import validation
from wbc.errors import ShapeError
from wbc.robot.geometry.hull import Hull
from wbc.robot.geometry.meshes import spread_directions
from wbc.robot.recipe import segment_shape
from wbc.shapes import Capsule, PlacedShape, Sphere
from wbc.shapes.around import distance_to_segment, shortest
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
    ends = shortest(scaled, best)
    # the rotation from z to the axis rounds the ends, so the radius is measured from where the shape has them
    line = segment_shape(middle + size * ends[0], middle + size * ends[1], 0.0, 0.0)
    radius = float(distance_to_segment(cloud, *line.ends()).max()) * (1 + 1e-12)
    shape = Capsule(radius, line.shape.length) if isinstance(line.shape, Capsule) else Sphere(radius)
    return replace(line, shape=shape, excess=hull.excess(*line.ends(), radius))


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


def _volume(x: Array) -> float:
    return float(x[6] ** 2 * np.linalg.norm(x[3:6] - x[:3]) + 4 / 3 * x[6] ** 3)


def _cutting_planes(points: Array, a: Array, b: Array) -> Array:
    """:func:`_least_volume` of few points, those that stick out added until none do: hulls may have thousands."""
    chosen = np.unique((spread_directions(60) @ points.T).argmax(axis=1))
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
