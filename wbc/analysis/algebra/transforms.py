"""Exact rigid transforms: rotations and translations whose entries are polynomials of a :class:`TrigRing`."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from math import degrees
from typing import TypeAlias

import numpy as np

from wbc.analysis.algebra.ring import Matrix, Poly, TrigRing
from wbc.errors import RotationError
from wbc.multibody import pin
from wbc.rotations import quaternion
from wbc.validation import Array

Vector: TypeAlias = list[Poly]
#: An entry of a rotation this near to -1, 0 or 1 is that number
SNAP = 1e-9
#: Lengths below this are rounding: 0.4 cos(pi/2) is 2e-17 [m]
LENGTH = 1e-12
#: Largest denominator of the quaternions that approximate other rotations
DENOMINATOR = 1000


@dataclass(frozen=True)
class Transform:
    """x -> R x + p."""

    rotation: Matrix
    position: Vector

    def times(self, other: Transform, ring: TrigRing) -> Transform:
        """Composition: first ``other``."""
        turned = apply(self.rotation, other.position, ring)
        return Transform(
            [_row_times(row, other.rotation, ring) for row in self.rotation],
            [a + b for a, b in zip(self.position, turned, strict=True)],
        )

    def inverse(self, ring: TrigRing) -> Transform:
        """x -> R' (x - p)."""
        back = [list(column) for column in zip(*self.rotation, strict=True)]
        return Transform(back, [-x for x in apply(back, self.position, ring)])


def apply(rotation: Matrix, vector: Vector, ring: TrigRing) -> Vector:
    """R x."""
    return [dot(row, vector, ring) for row in rotation]


def dot(a: Vector, b: Vector, ring: TrigRing) -> Poly:
    """a.b"""
    total = ring.zero
    for x, y in zip(a, b, strict=True):
        if len(x) and len(y):
            total = total + x * y
    return ring.normal(total)


def cross(a: Vector, b: Vector, ring: TrigRing) -> Vector:
    """a x b"""
    pairs = ((1, 2), (2, 0), (0, 1))
    return [ring.normal(a[i] * b[j] - a[j] * b[i]) for i, j in pairs]


def identity(ring: TrigRing) -> Transform:
    """x -> x."""
    return Transform(
        [[ring.one if i == j else ring.zero for j in range(3)] for i in range(3)], [ring.zero, ring.zero, ring.zero]
    )


def exact_placement(ring: TrigRing, placement: pin.SE3, what: str, approximate: bool, notes: list[str]) -> Transform:
    """A placement of a model.

    Rotations by multiples of 90 degrees are exact. Others are refused, or replaced by that of a quaternion with
    rational entries, which is a rotation exactly; the angle between the two is added to ``notes``. Lengths below
    ``LENGTH`` are zero.

    Raises:
        RotationError: another rotation, and no ``approximate``.
    """
    entries = exact_rotation(np.asarray(placement.rotation), what, approximate, notes)
    lengths = [0.0 if abs(x) < LENGTH else float(x) for x in placement.translation]
    return Transform([[ring.constant(x) for x in row] for row in entries], [ring.number(x) for x in lengths])


def exact_rotation(rotation: Array, what: str, approximate: bool, notes: list[str]) -> list[list[Fraction]]:
    """See :func:`exact_placement`."""
    nearest = np.round(rotation)
    if np.abs(rotation - nearest).max() < SNAP:
        return [[Fraction(int(x)) for x in row] for row in nearest]
    if not approximate:
        raise RotationError(
            what, rotation.tolist(), "not a multiple of 90 degrees about an axis; approximate=True takes a rational one"
        )
    raw = quaternion(rotation)
    scaled = raw / np.abs(raw).max()
    x, y, z, w = (Fraction(float(v)).limit_denominator(DENOMINATOR) for v in scaled)
    n = x * x + y * y + z * z + w * w
    out = [
        [1 - 2 * (y * y + z * z) / n, 2 * (x * y - z * w) / n, 2 * (x * z + y * w) / n],
        [2 * (x * y + z * w) / n, 1 - 2 * (x * x + z * z) / n, 2 * (y * z - x * w) / n],
        [2 * (x * z - y * w) / n, 2 * (y * z + x * w) / n, 1 - 2 * (x * x + y * y) / n],
    ]
    off = np.array([[float(v) for v in row] for row in out]).T @ rotation
    angle = float(np.linalg.norm(pin.log3(off)))
    notes.append(f"{what}: rotation approximated by a rational one, {degrees(angle):.2g} deg off")
    return out


def _row_times(row: Vector, matrix: Matrix, ring: TrigRing) -> Vector:
    return [dot(row, [matrix[k][j] for k in range(3)], ring) for j in range(3)]
