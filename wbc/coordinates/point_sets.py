"""Surfaces and curves that a point may be held on: f(x) = 0 for a point x [m], with |grad f| = 1 on the set."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import casadi as ca
import numpy as np

from wbc import validation
from wbc.errors import ShapeError

Triple = tuple[float, float, float]
#: Squared lengths below this are not divided by [m^2]
TINY = 1e-24


class PointSet(Protocol):
    """A surface (one row) or a curve (two rows). One of your own: a frozen dataclass with these two."""

    @property
    def count(self) -> int:
        """Rows of :meth:`values`."""

    def values(self, x: ca.SX) -> ca.SX:
        """f(x) [m], a column of ``count`` rows, zero on the set."""


def _column(x: Any) -> ca.SX:
    """Three expressions, or numbers, as a column."""
    if isinstance(x, ca.SX):
        if x.shape != (3, 1):
            raise ShapeError("x", x, "expected a column of three")
        return x
    return ca.SX(ca.DM(validation.ordinary_array("x", x, (3,)).tolist()))


def _point(owner: object, name: str) -> None:
    field = f"{type(owner).__name__}.{name}"
    x, y, z = (float(c) for c in validation.real_array(field, getattr(owner, name), (3,)))
    object.__setattr__(owner, name, (x, y, z))


def _direction(owner: object, name: str) -> None:
    x, y, z = (float(c) for c in validation.unit_vector(f"{type(owner).__name__}.{name}", getattr(owner, name)))
    object.__setattr__(owner, name, (x, y, z))


def _radius(owner: Any) -> None:
    field = f"{type(owner).__name__}.radius"
    object.__setattr__(owner, "radius", validation.scalar(field, owner.radius, low=0.0, open_low=True, unit="m"))


def _constant(vector: Triple) -> ca.SX:
    return ca.SX(ca.DM(list(vector)))


def _length(vector: ca.SX) -> ca.SX:
    return ca.sqrt(ca.fmax(ca.dot(vector, vector), TINY))


def _across(direction: Triple) -> tuple[ca.SX, ca.SX]:
    """Two unit vectors that make a right-handed frame with the direction."""
    along = np.array(direction)
    side = np.cross(along, np.eye(3)[int(np.argmin(np.abs(along)))])
    side /= np.linalg.norm(side)
    return ca.SX(ca.DM(side)), ca.SX(ca.DM(np.cross(along, side)))


@dataclass(frozen=True)
class OnPlane:
    """f = n.(x - p): a plane through ``point`` p with ``normal`` n."""

    point: Triple
    normal: Triple
    count = 1

    def __post_init__(self) -> None:
        _point(self, "point")
        _direction(self, "normal")

    def values(self, x: ca.SX) -> ca.SX:
        """See the class."""
        x = _column(x)
        return ca.dot(_constant(self.normal), x - _constant(self.point))


@dataclass(frozen=True)
class OnSphere:
    """f = |x - p| - radius: a sphere about ``point`` p. The centre has no derivative."""

    point: Triple
    radius: float
    count = 1

    def __post_init__(self) -> None:
        _point(self, "point")
        _radius(self)

    def values(self, x: ca.SX) -> ca.SX:
        """See the class."""
        x = _column(x)
        return _length(x - _constant(self.point)) - self.radius


@dataclass(frozen=True)
class OnCylinder:
    """f = |d - a (a.d)| - radius, d = x - p: a cylinder about the line through ``point`` p along ``axis`` a."""

    point: Triple
    axis: Triple
    radius: float
    count = 1

    def __post_init__(self) -> None:
        _point(self, "point")
        _direction(self, "axis")
        _radius(self)

    def values(self, x: ca.SX) -> ca.SX:
        """See the class."""
        x = _column(x)
        off, along = x - _constant(self.point), _constant(self.axis)
        return _length(off - along * ca.dot(along, off)) - self.radius


@dataclass(frozen=True)
class OnLine:
    """f = (b.(x - p), c.(x - p)), b and c across ``axis``: the line through ``point`` p along ``axis``."""

    point: Triple
    axis: Triple
    count = 2

    def __post_init__(self) -> None:
        _point(self, "point")
        _direction(self, "axis")

    def values(self, x: ca.SX) -> ca.SX:
        """See the class."""
        x = _column(x)
        off = x - _constant(self.point)
        return ca.vertcat(*[ca.dot(side, off) for side in _across(self.axis)])


@dataclass(frozen=True)
class OnCircle:
    """f = (n.d, |d| - radius), d = x - p: a circle about ``point`` p, ``normal`` n. Its centre has no derivative."""

    point: Triple
    normal: Triple
    radius: float
    count = 2

    def __post_init__(self) -> None:
        _point(self, "point")
        _direction(self, "normal")
        _radius(self)

    def values(self, x: ca.SX) -> ca.SX:
        """See the class."""
        x = _column(x)
        off = x - _constant(self.point)
        return ca.vertcat(ca.dot(_constant(self.normal), off), _length(off) - self.radius)
