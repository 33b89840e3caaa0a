"""Cylinders without end."""

from __future__ import annotations

from dataclasses import dataclass

from wbc import validation
from wbc.shapes import Geometry
from wbc.shapes.solid import Kind


@dataclass(frozen=True)
class _Endless(Geometry):
    radius: float

    def __post_init__(self) -> None:
        name = f"{type(self).__name__}.radius"
        object.__setattr__(self, "radius", validation.scalar(name, self.radius, low=0.0, open_low=True, unit="m"))

    @property
    def sizes(self) -> tuple[float, float, float, float, float]:
        return (0.0, 0.0, 0.0, self.radius, 0.0)


@dataclass(frozen=True)
class CylinderInside(_Endless):
    """The wall round the endless cylinder of ``radius`` [m] about z: distances count from the wall inwards."""

    kind = Kind.TUBE


@dataclass(frozen=True)
class EndlessCylinder(_Endless):
    """Points within ``radius`` [m] of the z axis."""

    kind = Kind.ROD
