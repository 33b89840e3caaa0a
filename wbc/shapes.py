"""Geometric shapes: parameters in metres, each in its own frame.

Shapes are plain data. They are bounded bodies on links (:class:`Sphere`, :class:`Capsule`) or obstacles
in the world (also :class:`HalfSpace`). Where a shape sits is said by whoever uses it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wbc import validation
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
class HalfSpace:
    """Points with z <= 0: the boundary is the plane z = 0 of the shape's frame, outward normal +z."""


Shape = Sphere | Capsule | HalfSpace


@dataclass(frozen=True, eq=False)
class PlacedShape:
    """A shape fixed to a link frame.

    Attributes:
        shape: a :class:`Sphere` or :class:`Capsule`.
        placement: pose of the shape in the link's frame.
        excess: how far the shape may stand out of what it was fitted to [m]; 0 for exact shapes.
    """

    shape: Sphere | Capsule
    placement: pin.SE3
    excess: float = 0.0

    def ends(self) -> tuple[Array, Array]:
        """The two ends of the shape's core segment in the link's frame [m]; equal for a sphere."""
        half = self.shape.length / 2 if isinstance(self.shape, Capsule) else 0.0
        axis = np.array(self.placement.rotation[:, 2])
        center = np.array(self.placement.translation)
        return center - half * axis, center + half * axis
