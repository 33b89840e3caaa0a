"""Boxes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc import validation
from wbc.multibody import pin
from wbc.shapes.around import around_cylinder
from wbc.shapes.solid import Kind, Solid
from wbc.shapes.surfaces import hull_of
from wbc.validation import Array


@dataclass(frozen=True)
class Box(Solid):
    """Points within ``size`` / 2 of the origin along each axis; ``size`` is the three side lengths [m]."""

    size: tuple[float, float, float]

    kind = Kind.SUM
    geom = "BOX"

    def __post_init__(self) -> None:
        sides = validation.real_array("Box.size", self.size, (3,)).tolist()
        checked = tuple(validation.scalar("Box.size", x, low=0.0, open_low=True, unit="m") for x in sides)
        object.__setattr__(self, "size", checked)

    @property
    def reach(self) -> float:
        return float(np.linalg.norm(self.size)) / 2

    @property
    def sizes(self) -> tuple[float, float, float, float, float]:
        x, y, z = self.size
        return (x / 2, y / 2, z / 2, 0.0, 0.0)

    def capsule(self) -> tuple[Array, Array, float]:
        half = np.array(self.size) / 2
        axis = int(np.argmax(half))
        radius, reach, _ = around_cylinder(float(np.hypot(*np.delete(half, axis))), float(half[axis]))
        end = reach * np.eye(3)[axis]
        return -end, end, radius

    def row_corners(self) -> Array:
        signs = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
        return np.asarray(signs * np.array(self.size) / 2)

    def triangles(self) -> Array:
        return hull_of(self.row_corners())

    def inertia(self, mass: float) -> pin.Inertia:
        return pin.Inertia.FromBox(mass, *self.size)
