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

from wbc.robot.geometry.ball import least_excess_ball, quick_ball
from wbc.robot.geometry.fitting import fit_capsule
from wbc.robot.geometry.hull import Hull
from wbc.robot.geometry.meshes import Mesh
from wbc.shapes import Capsule, PlacedShape, Sphere
from wbc.shapes.around import quick_capsule
from wbc.validation import Array

#: Fractions of a slab's width by which its borders are moved in search of better ones.
MOVES = (0.3, 0.1, 0.03)

#: One more shape must lower the largest excess at least by this fraction.
GAIN = 0.02


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
        if _worst(best) <= tolerance or _flat(hull):
            break
        found = tuple(how.fit(points, hull) for points in _slabs(mesh, number, how, hull))
        if _worst(found) < (1.0 - GAIN) * _worst(best):
            best = found
    return best


def _worst(shapes: tuple[PlacedShape, ...]) -> float:
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
