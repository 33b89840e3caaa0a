"""Several spheres or capsules that contain a mesh together: the mesh is cut into slabs, each gets one.

A slab's shape contains the corners of the mesh's pieces in it, hence their hull, hence all of the body in that slab
(see ``Mesh.slabs``); so the shapes together contain the body. ``excess`` is how far a shape
stands out of the hull of the whole mesh, not of its slab: shapes of neighbouring slabs overlap within the body.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from wbc.robot.geometry.fitting import fit_capsule
from wbc.robot.geometry.hull import Hull
from wbc.robot.geometry.meshes import Mesh
from wbc.robot.recipe import segment_shape
from wbc.shapes import Capsule, PlacedShape, Sphere
from wbc.shapes.around import quick_capsule
from wbc.validation import Array

#: Fractions of a slab's width by which its borders are moved in search of better ones.
MOVES = (0.3, 0.1, 0.03)

#: One more shape must lower the largest excess at least by this fraction.
GAIN = 0.02
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


@dataclass(frozen=True)
class CoverKind:
    """A kind of shape: ``fit`` makes a good one around points, ``guess`` a quick one (end, end, radius)."""

    fit: Callable[[Array, Hull], PlacedShape]
    guess: Callable[[Array], tuple[Array, Array, float]]


def cover(mesh: Mesh, kind: str, count: int, tolerance: float) -> tuple[PlacedShape, ...]:
    """At most ``count`` shapes of a kind that contain a mesh, fewer where they stand out of it by at most
    ``tolerance`` [m] or where more are no better.

    Args:
        mesh: closed, or the shapes contain its surface only.
        kind: ``capsule`` or ``spheres``.
    """
    how, hull = KINDS[kind], Hull(mesh.vertices)
    best: tuple[PlacedShape, ...] = (how.fit(hull.vertices, hull),)
    for number in range(2, count + 1):
        if largest_excess(best) <= tolerance or _flat(hull):
            break
        found = tuple(how.fit(points, hull) for points in _slabs(mesh, number, how, hull))
        if largest_excess(found) < (1.0 - GAIN) * largest_excess(best):
            best = found
    return best


def largest_excess(shapes: tuple[PlacedShape, ...]) -> float:
    """How far the shapes stand out at most [m]."""
    return max(shape.excess for shape in shapes)


def _flat(hull: Hull) -> bool:
    return len(hull.facets) == 0


def _slabs(mesh: Mesh, number: int, how: CoverKind, hull: Hull) -> list[Array]:
    """Slabs across the principal axis on which equal ones do best, whose borders then move where that helps."""

    def equal(axis: Array) -> tuple[float, list[Array], Array, Array]:
        height = mesh.vertices @ axis
        cuts = np.linspace(height.min(), height.max(), number + 1)
        return *_judged(mesh, axis, cuts[1:-1], how, hull), axis, cuts

    axes = np.linalg.svd(hull.vertices - hull.vertices.mean(axis=0), full_matrices=False)[2]
    worst, slabs, axis, cuts = min((equal(axis) for axis in axes), key=lambda found: found[0])
    width = (cuts[-1] - cuts[0]) / number
    for move, k, sign in itertools.product(MOVES, range(1, number), (-1.0, 1.0)):
        moved = cuts.copy()
        moved[k] += sign * move * width
        if (np.diff(moved) <= 0.0).any():
            continue
        new, pieces = _judged(mesh, axis, moved[1:-1], how, hull)
        if new < worst:
            worst, slabs, cuts = new, pieces, moved
    return slabs


def _judged(mesh: Mesh, axis: Array, cuts: Array, how: CoverKind, hull: Hull) -> tuple[float, list[Array]]:
    """(largest excess of quick shapes, slabs with something in them)."""
    slabs = [points for points in mesh.slabs(axis, cuts) if len(points)]
    worst = 0.0
    for points in slabs:
        a, b, radius = how.guess(points)
        worst = max(worst, radius + float(hull.beyond(np.array([a, b])).max()))
    return worst, slabs


def _capsule(points: Array, hull: Hull) -> PlacedShape:
    placed = fit_capsule(points)
    assert isinstance(placed.shape, (Capsule, Sphere))
    return replace(placed, excess=hull.excess(*placed.ends(), placed.shape.radius))


KINDS = {"capsule": CoverKind(_capsule, quick_capsule), "spheres": CoverKind(least_excess_ball, quick_ball)}
