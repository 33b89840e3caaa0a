"""The angle of a direction about a line, against a reference that is singular on one half-line only.

Let p (pole) and r (direction) be perpendicular unit vectors, t = p x r, and u the unit vector along the
line. The reference frame of u is the image of (p, r, t) under the shortest rotation that takes p to u:

    a(u) = r - (r.u) / (1 + p.u) (p + u),      b(u) = u x a(u) = t - (t.u) / (1 + p.u) (p + u).

With s = p + u these are the reflections a = r - 2 s (s.r) / |s|^2 and b = t - 2 s (s.t) / |s|^2, so both are
smooth on the whole sphere without the point u = -p. A nowhere singular field does not exist (hairy ball). It is
the reference of the stereographic shoulder-elbow-wrist angle, A. J. Elias and J. T. Wen, "Redundancy
parameterization and inverse kinematics of 7-DOF revolute manipulators", arXiv:2307.13122, with e_t = -p, e_r = r.
"""

from __future__ import annotations

import math

import casadi as ca
import numpy as np

from wbc import validation
from wbc.errors import RangeError
from wbc.quick_dataclasses import dataclass
from wbc.symbolic import rotations as rot

Triple = tuple[float, float, float]

#: Squared lengths below this [m^2, or 1 for pure numbers] are not divided by; every row is off long before.
TINY = 1e-24

#: A fading factor is exactly 0 below this part of its width, so the guards above are never seen.
INNER = 0.1


@dataclass(frozen=True)
class PlaneReference:
    """Where the angle of a plane about a line is 0: at a(u) of this module's formula.

    Attributes:
        pole: the line direction at which ``direction`` itself is the reference. The reference is singular on the
            half-line from the shoulder along ``-pole``: point it where the wrist never is (into the floor).
        direction: angle 0 for a line along ``pole``; its part along ``pole`` is dropped.

    Both are in the axes of the item's ``base`` frame, of any length, and are kept as unit vectors.

    Raises:
        RangeError: ``pole`` is zero, or ``direction`` is parallel to it.
    """

    pole: Triple = (0.0, 0.0, 1.0)
    direction: Triple = (1.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        pole = validation.unit_vector("reference.pole", self.pole)
        direction = validation.unit_vector("reference.direction", self.direction)
        across = direction - pole * float(pole @ direction)
        if not float(np.linalg.norm(across)) > 1e-6:
            raise RangeError("reference.direction", self.direction, "expected a vector not parallel to reference.pole")
        across = across / float(np.linalg.norm(across))
        object.__setattr__(self, "pole", triple(pole))
        object.__setattr__(self, "direction", triple(across))

    @property
    def third(self) -> Triple:
        """pole x direction: an angle of +pi/2 for a line along ``pole``."""
        return triple(np.cross(self.pole, self.direction))


def triple(vector: np.ndarray) -> Triple:
    """Three plain floats."""
    x, y, z = (float(c) for c in vector)
    return (x, y, z)


def square(vector: ca.SX) -> ca.SX:
    """|vector|^2."""
    return ca.dot(vector, vector)


def length(vector: ca.SX) -> ca.SX:
    """|vector|, with a zero derivative at 0."""
    return ca.sqrt(ca.fmax(square(vector), TINY))


def unit(vector: ca.SX) -> ca.SX:
    """vector / |vector|; the vector itself where |vector|^2 <= TINY, so it and its derivative stay finite."""
    size = square(vector)
    return vector / ca.sqrt(ca.if_else(size > TINY, size, 1.0))


def coordinates(line: ca.SX, direction: ca.SX, reference: PlaneReference) -> tuple[ca.SX, ca.SX]:
    """|s|^2 (a.d, b.d): the direction in the reference frame of the unit vector ``line``, without a division."""
    pole = rot.constant(reference.pole)
    across = line + pole
    reflected = square(across) * direction - 2 * ca.dot(across, direction) * across
    return ca.dot(rot.constant(reference.direction), reflected), ca.dot(rot.constant(reference.third), reflected)


def turned(x: ca.SX, y: ca.SX, target: ca.SX) -> ca.SX:
    """atan2(y, x) - target, wrapped to (-pi, pi]; 0 where x = y = 0, where there is no angle."""
    fine = x * x + y * y > TINY
    x, y = ca.if_else(fine, x, 1.0), ca.if_else(fine, y, 0.0)
    cos, sin = ca.cos(target), ca.sin(target)
    return ca.if_else(fine, ca.atan2(cos * y - sin * x, cos * x + sin * y), 0.0)


def fade(squared: ca.SX, width: float) -> ca.SX:
    """0 up to INNER width, 1 from width on, and a twice differentiable step of the squared distance between.

    t = (squared - (INNER width)^2) / (width^2 - (INNER width)^2) cut to [0, 1]; 10 t^3 - 15 t^4 + 6 t^5.
    """
    inner = (INNER * width) ** 2
    t = ca.fmin(ca.fmax((squared - inner) / (width * width - inner), 0.0), 1.0)
    return t * t * t * (10 + t * (6 * t - 15))


def half_line_fade(line: ca.SX, reference: PlaneReference, width: float) -> ca.SX:
    """:func:`fade` of the chord |p + u| from the unit vector ``line`` to the singular half-line; ``width`` in rad."""
    return fade(square(line + rot.constant(reference.pole)), 2 * math.sin(width / 2))
