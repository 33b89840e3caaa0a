"""Surfaces and curves that a point may be held on: f(x) = 0 for a point x [m], with |grad f| = 1 on the set."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import casadi as ca
import numpy as np

from wbc import validation
from wbc.errors import ShapeError
from wbc.tasks._stereographic import Triple, triple

#: Squared lengths below this are not divided by [m^2]
TINY = 1e-24


class PointSet(Protocol):
    """A surface (one row) or a curve (two rows). One of your own: a frozen dataclass with these two."""

    @property
    def count(self) -> int:
        """Rows of :meth:`values`."""

    def values(self, x: ca.SX) -> ca.SX:
        """f(x) [m], a column of ``count`` rows, zero on the set."""


@dataclass(frozen=True)
class _SetAbout:
    """What the sets below share: a ``point`` p, and directions and a radius that are checked by their names."""

    point: Triple

    def __post_init__(self) -> None:
        for name, value in list(vars(self).items()):
            field, checked = f"{type(self).__name__}.{name}", value
            if name == "radius":
                checked = validation.scalar(field, value, low=0.0, open_low=True, unit="m")
            elif name == "point":
                checked = triple(validation.real_array(field, value, (3,)))
            else:
                checked = triple(validation.unit_vector(field, value))
            object.__setattr__(self, name, checked)

    def _off(self, x: Any) -> ca.SX:
        """x - p of three expressions, or of numbers."""
        if not isinstance(x, ca.SX):
            x = _constant(validation.ordinary_array("x", x, (3,)))
        if x.shape != (3, 1):
            raise ShapeError("x", x, "expected a column of three")
        offset: ca.SX = x - _constant(self.point)
        return offset


def _constant(vector: Any) -> ca.SX:
    return ca.SX(ca.DM(np.asarray(vector)))


def _length(vector: ca.SX) -> ca.SX:
    return ca.sqrt(ca.fmax(ca.dot(vector, vector), TINY))


def _across(direction: Triple) -> tuple[ca.SX, ca.SX]:
    """Two unit vectors that make a right-handed frame with the direction."""
    along = np.array(direction)
    side = np.cross(along, np.eye(3)[int(np.argmin(np.abs(along)))])
    side /= np.linalg.norm(side)
    return _constant(side), _constant(np.cross(along, side))


@dataclass(frozen=True)
class OnPlane(_SetAbout):
    """f = n.(x - p): a plane through ``point`` p with ``normal`` n."""

    normal: Triple
    count = 1

    def values(self, x: ca.SX) -> ca.SX:
        return ca.dot(_constant(self.normal), self._off(x))


@dataclass(frozen=True)
class OnSphere(_SetAbout):
    """f = |x - p| - radius: a sphere about ``point`` p. The centre has no derivative."""

    radius: float
    count = 1

    def values(self, x: ca.SX) -> ca.SX:
        return _length(self._off(x)) - self.radius


@dataclass(frozen=True)
class OnCylinder(_SetAbout):
    """f = |d - a (a.d)| - radius, d = x - p: a cylinder about the line through ``point`` p along ``axis`` a."""

    axis: Triple
    radius: float
    count = 1

    def values(self, x: ca.SX) -> ca.SX:
        off, along = self._off(x), _constant(self.axis)
        return _length(off - along * ca.dot(along, off)) - self.radius


@dataclass(frozen=True)
class OnLine(_SetAbout):
    """f = (b.(x - p), c.(x - p)), b and c across ``axis``: the line through ``point`` p along ``axis``."""

    axis: Triple
    count = 2

    def values(self, x: ca.SX) -> ca.SX:
        off = self._off(x)
        return ca.vertcat(*[ca.dot(side, off) for side in _across(self.axis)])


@dataclass(frozen=True)
class OnCircle(_SetAbout):
    """f = (n.d, |d| - radius), d = x - p: a circle about ``point`` p, ``normal`` n. Its centre has no derivative."""

    normal: Triple
    radius: float
    count = 2

    def values(self, x: ca.SX) -> ca.SX:
        off = self._off(x)
        return ca.vertcat(ca.dot(_constant(self.normal), off), _length(off) - self.radius)
