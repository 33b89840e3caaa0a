"""Cylinders with flat ends."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc import validation
from wbc.multibody import pin
from wbc.shapes.around import around_cylinder
from wbc.shapes.solid import Kind, Solid
from wbc.shapes.surfaces import turned
from wbc.validation import Array

#: Points on each rim that count as corners
RIM = 8


@dataclass(frozen=True)
class Cylinder(Solid):
    """Points within ``radius`` [m] of the z axis and ``length`` / 2 [m] of the plane z = 0."""

    radius: float
    length: float

    kind = Kind.SUM
    geom = "CYLINDER"

    def __post_init__(self) -> None:
        validation.own_scalars(self, "radius", "length", low=0.0, open_low=True, unit="m")

    @property
    def reach(self) -> float:
        return float(np.hypot(self.radius, self.length / 2))

    @property
    def sizes(self) -> tuple[float, float, float, float, float]:
        return (0.0, 0.0, self.length / 2, self.radius, 0.0)

    def capsule(self) -> tuple[Array, Array, float]:
        radius, reach, _ = around_cylinder(self.radius, self.length / 2)
        end = np.array([0.0, 0.0, reach])
        return -end, end, radius

    def row_corners(self) -> Array:
        turn = 2 * np.pi * np.arange(RIM) / RIM
        rim = np.stack([np.cos(turn), np.sin(turn)], axis=1) * self.radius
        return np.vstack([np.column_stack([rim, np.full(RIM, z)]) for z in (-self.length / 2, self.length / 2)])

    def triangles(self) -> Array:
        half = self.length / 2
        return turned(np.array([[0.0, -half], [self.radius, -half], [self.radius, half], [0.0, half]]))

    def inertia(self, mass: float) -> pin.Inertia:
        return pin.Inertia.FromCylinder(mass, self.radius, self.length)
