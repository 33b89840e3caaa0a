"""Spheres around points."""

from __future__ import annotations

import numpy as np

from wbc.robot.geometry.hull import Hull
from wbc.robot.recipe import segment_shape
from wbc.shapes import PlacedShape
from wbc.validation import Array

#: Points and facets that enter the problem at once
BATCH = 20
#: How often those that were missed are added
ROUNDS = 12


def quick_ball(points: Array) -> tuple[Array, Array, float]:
    """(center, center, radius) of the ball about the middle of the points' extent: no fit, but fast."""
    axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2]
    along = points @ axes.T
    center = (along.min(axis=0) + along.max(axis=0)) / 2 @ axes
    return center, center, float(np.linalg.norm(points - center, axis=1).max())


def least_excess_ball(points: Array, hull: Hull) -> PlacedShape:
    """The ball that contains the points and stands out of the hull the least,

        min over center c of  max_i |c - p_i| + max_j (n_j . c + o_j),       n_j, o_j the hull's facets          [m]

    a convex problem (a sum of maxima of convex functions); for a flat hull the least ball.
    """
    size = float(np.ptp(hull.vertices, axis=0).max())
    start, _, radius = quick_ball(points)
    if size == 0.0 or radius == 0.0:
        return segment_shape(start, start, radius, 0.0)
    center = start + size * _least((points - start) / size, hull, start, size)
    if _excess(points, hull, center) > _excess(points, hull, start):
        center = start
    radius = float(np.linalg.norm(points - center, axis=1).max()) * (1 + 1e-12)
    return segment_shape(center, center, radius, hull.excess(center, center, radius))


def _excess(points: Array, hull: Hull, center: Array) -> float:
    return float(np.linalg.norm(points - center, axis=1).max() + hull.beyond(center[None])[0])


def _least(points: Array, hull: Hull, start: Array, size: float) -> Array:
    """The best center, in units of ``size`` about ``start``; only points and facets that bind enter the problem."""
    from scipy.optimize import minimize

    normals = hull.facets[:, :3]
    offsets = (normals @ start + hull.facets[:, 3]) / size
    chosen, faces = np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp)
    x = np.zeros(5)  # center, radius, largest facet distance
    for _ in range(ROUNDS):
        reach, depth = np.linalg.norm(points - x[:3], axis=1), normals @ x[:3] + offsets
        if len(chosen) and reach.max() <= x[3] + 1e-9 and (len(depth) == 0 or depth.max() <= x[4] + 1e-9):
            break
        chosen = np.union1d(chosen, np.argsort(reach)[-BATCH:])
        faces = np.union1d(faces, np.argsort(depth)[-BATCH:])
        p, n, o = points[chosen], normals[faces], offsets[faces]

        def slack(x: Array, p: Array = p, n: Array = n, o: Array = o) -> Array:
            return np.concatenate([x[3] - np.linalg.norm(p - x[:3], axis=1), x[4] - n @ x[:3] - o])

        def slope(x: Array, p: Array = p, n: Array = n) -> Array:
            away = p - x[:3]
            unit = away / np.maximum(np.linalg.norm(away, axis=1), 1e-12)[:, None]
            upper = np.hstack([unit, np.ones((len(p), 1)), np.zeros((len(p), 1))])
            return np.vstack([upper, np.hstack([-n, np.zeros((len(n), 1)), np.ones((len(n), 1))])])

        x[3], x[4] = reach[chosen].max(), max(depth[faces].max(), 0.0) if len(faces) else 0.0
        weight = 1.0 if len(faces) else 0.0
        found = minimize(
            lambda x, weight=weight: x[3] + weight * x[4],
            x,
            jac=lambda x, weight=weight: np.array([0.0, 0.0, 0.0, 1.0, weight]),
            constraints=[{"type": "ineq", "fun": slack, "jac": slope}],
            method="SLSQP",
            options={"maxiter": 100, "ftol": 1e-10},
        ).x
        if not np.isfinite(found).all():
            break
        x = found
    return np.asarray(x[:3])
