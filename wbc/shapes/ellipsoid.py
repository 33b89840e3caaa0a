"""Ellipsoids."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc import validation
from wbc.multibody import pin
from wbc.shapes.around import around_ellipsoid
from wbc.shapes.round import Sphere
from wbc.shapes.solid import Kind, Solid
from wbc.validation import Array


@dataclass(frozen=True)
class Ellipsoid(Solid):
    """Points with (x/a)^2 + (y/b)^2 + (z/c)^2 <= 1; ``semi_axes`` is a, b, c [m].

    Raises:
        ShapeError, NotFiniteError: not three finite numbers. RangeError: one that is not above 0.
    """

    semi_axes: tuple[float, float, float]

    kind = Kind.ELLIPSOID
    geom = "ELLIPSOID"

    def __post_init__(self) -> None:
        given = validation.real_array("Ellipsoid.semi_axes", self.semi_axes, (3,)).tolist()
        checked = tuple(validation.scalar("Ellipsoid.semi_axes", x, low=0.0, open_low=True, unit="m") for x in given)
        object.__setattr__(self, "semi_axes", checked)

    @property
    def reach(self) -> float:
        return max(self.semi_axes)

    @property
    def sizes(self) -> tuple[float, float, float, float, float]:
        return (*self.semi_axes, 0.0, 0.0)

    def capsule(self) -> tuple[Array, Array, float]:
        radius, half, _ = around_ellipsoid(np.array(self.semi_axes))
        end = half * np.eye(3)[int(np.argmax(self.semi_axes))]
        return -end, end, radius

    def triangles(self) -> Array:
        return np.asarray(Sphere(1.0).triangles() * np.array(self.semi_axes))

    def inertia(self, mass: float) -> pin.Inertia:
        return pin.Inertia.FromEllipsoid(mass, *self.semi_axes)
