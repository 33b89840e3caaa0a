"""Convex hulls of points."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from wbc import pickling, validation
from wbc.errors import RangeError, ShapeError
from wbc.shapes.around import quick_capsule
from wbc.shapes.solid import Kind, Solid, Stored
from wbc.shapes.surfaces import hull_of
from wbc.validation import Array

if TYPE_CHECKING:
    import mujoco

#: Points closer to a plane than this, relative to their extent, span no volume.
FLAT = 1e-6
#: Points of hulls that ``geometry/native/shapes.h`` takes at a time
LANES = 8
#: A hull has at most this many corners for rows, those farthest from each other
CORNERS = 48


@dataclass(frozen=True, eq=False)
class Convex(Solid):
    """The convex hull of ``points`` (n x 3) [m]; kept are the hull's vertices.

    Raises:
        ShapeError, NotFiniteError: not n x 3 finite numbers.
        RangeError: the points lie in a plane, within 1e-6 of their extent, so that the hull has no inside.
    """

    points: Array

    kind = Kind.HULL
    geom = "MESH"

    def __post_init__(self) -> None:
        points = validation.ordinary_array("Convex.points", self.points)
        if points.ndim != 2 or points.shape[1] != 3 or len(points) < 4:
            raise ShapeError("Convex.points", points.shape, "expected at least 4 points, n x 3")
        centred = points - points.mean(axis=0)
        spread = np.linalg.svd(centred, compute_uv=False)
        if spread[2] <= FLAT * max(spread[0], 1e-300):
            raise RangeError("Convex.points", points.shape, "the points lie in a plane: the hull has no inside")
        # Imported here: most processes make no hull, and scipy takes longer to import than all the rest
        from scipy.spatial import ConvexHull

        kept = np.array(points[ConvexHull(points).vertices])
        kept.flags.writeable = False
        object.__setattr__(self, "points", kept)

    def __setstate__(self, state: dict[str, Any]) -> None:
        pickling.restore(self, state, {"points"})
        pickling.freeze(self)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Convex) and np.array_equal(self.points, other.points)

    def __hash__(self) -> int:
        return hash(self.points.tobytes())

    def __repr__(self) -> str:
        digest = hashlib.sha256(self.points.tobytes()).hexdigest()[:16]
        return f"Convex({len(self.points)} points, {digest})"

    @property
    def center(self) -> Array:
        return np.asarray(self.points.mean(axis=0))

    @property
    def reach(self) -> float:
        return float(np.linalg.norm(self.points - self.center, axis=1).max())

    def stored(self) -> Stored:
        filled = padded(self.points - self.center)
        return Stored(len(filled), filled.T.ravel())

    def capsule(self) -> tuple[Array, Array, float]:
        return quick_capsule(self.points)

    def row_corners(self) -> Array:
        return spread(self.points - self.center, CORNERS)

    def triangles(self) -> Array:
        return hull_of(self.points)

    def become(self, geom: mujoco.MjsGeom, spec: mujoco.MjSpec, name: str) -> None:
        super().become(geom, spec, name)
        mesh = spec.add_mesh(name=name)
        mesh.uservert = self.points.ravel()
        geom.meshname = mesh.name


def padded(points: Array) -> Array:
    """The last point again, up to a multiple of what the kernel takes at a time."""
    return np.vstack([points, np.tile(points[-1], (-len(points) % LANES, 1))])


def spread(points: Array, count: int) -> Array:
    """At most ``count`` of some points: the farthest from the origin, then the farthest from those chosen so far."""
    chosen = [int(np.argmax(np.linalg.norm(points, axis=1)))]
    away = np.full(len(points), np.inf)
    while len(chosen) < min(count, len(points)):
        away = np.minimum(away, np.linalg.norm(points - points[chosen[-1]], axis=1))
        chosen.append(int(np.argmax(away)))
    return points[sorted(chosen)]
