"""Geometric shapes: parameters in metres, each in its own frame.

Shapes are plain data. They are bounded bodies on links or obstacles in the world (also :class:`HalfSpace`); a mesh
is a list of :class:`Convex` parts. Where a shape sits is said by whoever uses it.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from wbc import pickling, validation
from wbc.errors import RangeError, ShapeError
from wbc.validation import Array


@dataclass(frozen=True)
class Sphere:
    """Points within ``radius`` [m] of the origin."""

    radius: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "radius", validation.scalar("Sphere.radius", self.radius, low=0.0, unit="m"))


@dataclass(frozen=True)
class Capsule:
    """Points within ``radius`` [m] of the segment from -length/2 to +length/2 [m] along z."""

    radius: float
    length: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "radius", validation.scalar("Capsule.radius", self.radius, low=0.0, unit="m"))
        object.__setattr__(self, "length", validation.scalar("Capsule.length", self.length, low=0.0, unit="m"))


@dataclass(frozen=True)
class Box:
    """Points within ``size`` / 2 of the origin along each axis; ``size`` is the three side lengths [m]."""

    size: tuple[float, float, float]

    def __post_init__(self) -> None:
        sides = validation.real_array("Box.size", self.size, (3,)).tolist()
        checked = tuple(validation.scalar("Box.size", x, low=0.0, open_low=True, unit="m") for x in sides)
        object.__setattr__(self, "size", checked)


@dataclass(frozen=True)
class Cylinder:
    """Points within ``radius`` [m] of the z axis and ``length`` / 2 [m] of the plane z = 0."""

    radius: float
    length: float

    def __post_init__(self) -> None:
        for name in ("radius", "length"):
            number = validation.scalar(f"Cylinder.{name}", getattr(self, name), low=0.0, open_low=True, unit="m")
            object.__setattr__(self, name, number)


@dataclass(frozen=True)
class HalfSpace:
    """Points with z <= 0: the boundary is the plane z = 0 of the shape's frame, outward normal +z."""


@dataclass(frozen=True, eq=False)
class Convex:
    """The convex hull of ``points`` (n x 3) [m]; kept are the hull's vertices.

    Raises:
        ShapeError, NotFiniteError: not n x 3 finite numbers.
        RangeError: the points lie in a plane, within 1e-6 of their extent, so that the hull has no inside.
    """

    points: Array

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


#: Distance [m] that stands for nothing in reach.
FAR = 1e3

#: Points closer to a plane than this, relative to their extent, span no volume.
FLAT = 1e-6

#: Bodies of finite size, which links can have
Solid = Sphere | Capsule | Box | Cylinder | Convex

Shape = Solid | HalfSpace


@dataclass(frozen=True, eq=False)
class PlacedShape:
    """A shape fixed to a link frame.

    Attributes:
        shape: a :data:`Solid`; a :class:`HalfSpace` is no part of a link, but may stand in the world.
        placement: pose of the shape in the link's frame.
        excess: how far the shape may stand out of what it was fitted to [m]; 0 for exact shapes.

    Raises:
        ShapeError: no solid. NotFiniteError, RotationError, RangeError: a bad placement or excess.
    """

    shape: Solid
    placement: pin.SE3
    excess: float = 0.0

    def __post_init__(self) -> None:
        if not isinstance(self.shape, Shape):
            raise ShapeError("PlacedShape.shape", self.shape, "expected a Sphere, Capsule, Box, Cylinder or Convex")
        object.__setattr__(self, "placement", validation.pose("PlacedShape.placement", self.placement))
        object.__setattr__(self, "excess", validation.scalar("PlacedShape.excess", self.excess, low=0.0, unit="m"))

    def ends(self) -> tuple[Array, Array]:
        """The two ends of the shape's core segment in the link's frame [m]; equal for all but a capsule."""
        half = self.shape.length / 2 if isinstance(self.shape, Capsule) else 0.0
        axis = np.array(self.placement.rotation[:, 2])
        center = np.array(self.placement.translation)
        return center - half * axis, center + half * axis
