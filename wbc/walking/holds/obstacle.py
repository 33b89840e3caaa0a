"""Obstacles: bodies that no link may touch."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wbc import validation
from wbc.clearance import TriangleMesh
from wbc.errors import ShapeError
from wbc.geometry import segment_distances
from wbc.multibody import pin
from wbc.shapes import Box, Capsule, Cylinder, Sphere
from wbc.validation import Array
from wbc.walking.holds.hold import checked_id

#: What an obstacle can be; a mesh is a closed surface
ObstacleShape = Box | Capsule | Sphere | Cylinder | TriangleMesh
#: Golden ratio's inverse, and how often an interval is cut by it: to 5e-10 of its length
GOLDEN, CUTS = (5**0.5 - 1) / 2, 45


@dataclass(frozen=True, eq=False)
class Obstacle:
    """A body of a structure that no link may touch; the constraint is :class:`wbc.tasks.Obstacle`.

    Attributes:
        id: name, unique among the structure's obstacles.
        shape: :class:`~wbc.shapes.Box`, :class:`~wbc.shapes.Capsule`, :class:`~wbc.shapes.Sphere`,
            :class:`~wbc.shapes.Cylinder` (solid, with flat ends) or a solid :class:`~wbc.clearance.TriangleMesh`.
        placement: pose of the shape in the structure's frame.

    Raises:
        ShapeError: an empty id, another shape, or a mesh that is a sheet. NotFiniteError, RotationError: a bad
            placement.
    """

    id: str
    shape: ObstacleShape
    placement: pin.SE3

    def __post_init__(self) -> None:
        object.__setattr__(self, "id", checked_id("Obstacle.id", self.id))
        if not isinstance(self.shape, ObstacleShape):
            raise ShapeError(
                "Obstacle.shape",
                self.shape,
                f"of {self.id!r}: expected a Box, Capsule, Sphere, Cylinder or TriangleMesh",
            )
        if isinstance(self.shape, TriangleMesh) and not self.shape.solid:
            raise ShapeError("Obstacle.shape", "a sheet", f"of {self.id!r}: expected a closed mesh (solid=True)")
        object.__setattr__(self, "placement", validation.pose("Obstacle.placement", self.placement))

    def distance(self, points: Array) -> Array:
        """Signed distance [m] of points ``[..., 3]`` in the structure's frame from the body."""
        local = (np.asarray(points, dtype=np.float64) - self.placement.translation) @ self.placement.rotation
        shape = self.shape
        if isinstance(shape, TriangleMesh):
            return shape.distance(local)
        if isinstance(shape, (Capsule, Sphere)):
            half = shape.length / 2 if isinstance(shape, Capsule) else 0.0
            local = local - np.clip(local[..., 2:], -half, half) * np.array([0.0, 0.0, 1.0])
            length: Array = np.linalg.norm(local, axis=-1)
            return length - shape.radius
        if isinstance(shape, Cylinder):
            across = np.linalg.norm(local[..., :2], axis=-1) - shape.radius
            beyond = np.stack([across, np.abs(local[..., 2]) - shape.length / 2], axis=-1)
        else:
            beyond = np.abs(local) - np.array(shape.size) / 2
        outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=-1)
        out: Array = outside + np.minimum(beyond.max(axis=-1), 0.0)
        return out

    def segment_distance(self, a: Array, b: Array) -> Array:
        """Least signed distance [m] on the segments from ``a`` to ``b``, ``[..., 3]`` each in the structure's frame.

        Of a box and a cylinder it is found by golden section, as a signed distance from a convex body is convex along
        a line; the error is under 1e-9 of the segment's length. Of a mesh it is 0 where a segment goes through the
        surface, and that of the point next to the surface where one is wholly inside.
        """
        if isinstance(self.shape, (Box, Cylinder)):
            return _least_along(self.distance, a, b)
        if isinstance(self.shape, TriangleMesh):
            at, turn = self.placement.translation, self.placement.rotation
            return self.shape.segment_distance((np.asarray(a) - at) @ turn, (np.asarray(b) - at) @ turn)
        length = self.shape.length if isinstance(self.shape, Capsule) else 0.0
        half = length / 2 * self.placement.rotation[:, 2]
        ends = (self.placement.translation - half, self.placement.translation + half)
        return segment_distances(a, b, *ends) - self.shape.radius

    def moved(self, pose: pin.SE3) -> Obstacle:
        """The same obstacle on a structure that was moved by ``pose``."""
        return Obstacle(self.id, self.shape, pose * self.placement)


def _least_along(distance: Callable[[Array], Array], a: Array, b: Array) -> Array:
    """Least of a function that is convex along every segment."""
    start, span = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64) - a
    low, high = np.zeros(start.shape[:-1]), np.ones(start.shape[:-1])
    left, right = low + (1 - GOLDEN), low + GOLDEN
    at_left, at_right = (distance(start + t[..., None] * span) for t in (left, right))
    for _ in range(CUTS):
        lower = at_left < at_right
        low, high = np.where(lower, low, left), np.where(lower, right, high)
        kept, at_kept = np.where(lower, left, right), np.where(lower, at_left, at_right)
        new = np.where(lower, high - GOLDEN * (high - low), low + GOLDEN * (high - low))
        at_new = distance(start + new[..., None] * span)
        left, at_left = np.where(lower, new, kept), np.where(lower, at_new, at_kept)
        right, at_right = np.where(lower, kept, new), np.where(lower, at_kept, at_new)
    ends = np.minimum(distance(start), distance(start + span))
    return np.asarray(np.minimum(np.minimum(at_left, at_right), ends))
