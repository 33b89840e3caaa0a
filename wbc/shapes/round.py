"""Balls and capsules."""

from __future__ import annotations

import numpy as np

from wbc import validation
from wbc.multibody import pin
from wbc.quick_dataclasses import dataclass
from wbc.shapes.solid import Kind, Solid
from wbc.shapes.surfaces import turned
from wbc.validation import Array

#: Circles on a half sphere that is drawn
RINGS = 12


@dataclass(frozen=True)
class Sphere(Solid):
    """Points within ``radius`` [m] of the origin."""

    radius: float

    kind = Kind.SUM
    geom = "SPHERE"

    def __post_init__(self) -> None:
        validation.own_scalars(self, "radius", low=0.0, unit="m")

    @property
    def reach(self) -> float:
        return self.radius

    @property
    def sizes(self) -> tuple[float, float, float, float, float]:
        return (0.0, 0.0, 0.0, 0.0, self.radius)

    def triangles(self) -> Array:
        return _rounded(self.radius, 0.0)

    def inertia(self, mass: float) -> pin.Inertia:
        return pin.Inertia.FromSphere(mass, self.radius)


@dataclass(frozen=True)
class Capsule(Solid):
    """Points within ``radius`` [m] of the segment from -length/2 to +length/2 [m] along z."""

    radius: float
    length: float

    kind = Kind.SUM
    geom = "CAPSULE"

    def __post_init__(self) -> None:
        validation.own_scalars(self, "radius", "length", low=0.0, unit="m")

    @property
    def reach(self) -> float:
        return self.radius + self.length / 2

    @property
    def sizes(self) -> tuple[float, float, float, float, float]:
        return (0.0, 0.0, self.length / 2, 0.0, self.radius)

    def capsule(self) -> tuple[Array, Array, float]:
        a, b = self.row_corners()
        return a, b, self.radius

    def row_corners(self) -> Array:
        return np.array([[0.0, 0.0, -0.5], [0.0, 0.0, 0.5]]) * self.length

    def triangles(self) -> Array:
        return _rounded(self.radius, self.length / 2)

    def inertia(self, mass: float) -> pin.Inertia:
        return pin.Inertia.FromCapsule(mass, self.radius, self.length)


def _rounded(radius: float, half: float) -> Array:
    angle = np.linspace(0.0, np.pi / 2, RINGS + 1)
    cap = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1) + np.array([0.0, half])
    return turned(np.concatenate([cap[::-1] * np.array([1.0, -1.0]), cap]))
