"""The cylinder and its grid of handholds. Units: inch, radian; T and A count holds.

Fixed frame: z is the axis of the cylinder, y points to its top. Column T = 1 to 25 lies at the angle 25 + 5 T degrees,
13 on top, row A = 1 to 24 at z = -9.25 A:

    x = -r cos(angle),    y = r sin(angle),    z = -9.25 A

Source: M. R. Patterson's thesis on a three-armed walking robot, 2.2.2, 3.2.1, 5.1 and the listings MAIN and HDHOLD.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbc import validation
from wbc.errors import RangeError
from wbc.validation import Array

#: [m]
INCH = 0.0254
#: Of the cylinder, on which the holds lie [in]
RADIUS = 100.0
#: Between rows, and the length of a grid unit in all distances of the gait [in]
PITCH = 9.25
#: Between columns [rad]
STEP = float(np.radians(5.0))
COLUMNS = 25
ROWS = 24

#: A hold: (T, A)
Place = tuple[int, int]


def angle(column: Any) -> Any:
    """Of a column [rad]."""
    return np.radians(25.0) + STEP * column


def point(column: float, row: float, radius: float = RADIUS) -> Array:
    """On the cylinder of a radius [in]."""
    at = angle(column)
    return np.array([-radius * np.cos(at), radius * np.sin(at), -PITCH * row])


def frame(column: float, row: float, radius: float = RADIUS, heading: float = 0.0) -> Array:
    """4 x 4, Euler angles (-angle, 90 degrees, heading): z inward, and without heading x along +A, y along +T."""
    out = np.eye(4)
    out[:3, :3] = rotation(-float(angle(column)), 0.5 * np.pi, heading)
    out[:3, 3] = point(column, row, radius)
    return out


def coordinates(points: Array) -> Array:
    """(T, A) of points ... x 3, whatever their radius."""
    columns = (np.pi - np.arctan2(points[..., 1], points[..., 0]) - np.radians(25.0)) / STEP
    return np.stack([columns, -points[..., 2] / PITCH], axis=-1)


def rotation(alpha: float, beta: float, gamma: float) -> Array:
    """R = Rz(alpha) Ry(beta) Rz(gamma) (2-5)."""
    ca, cb, cg = np.cos(alpha), np.cos(beta), np.cos(gamma)
    sa, sb, sg = np.sin(alpha), np.sin(beta), np.sin(gamma)
    return np.array(
        [
            [ca * cb * cg - sa * sg, -ca * cb * sg - sa * cg, ca * sb],
            [sa * cb * cg + ca * sg, -sa * cb * sg + ca * cg, sa * sb],
            [-sb * cg, sb * sg, cb],
        ]
    )


def euler_angles(matrix: Array) -> tuple[float, float, float]:
    """(alpha, beta, gamma) of (2-5) with beta in [0, pi]; gamma is 0 where only alpha +- gamma is known."""
    sine = float(np.hypot(matrix[2, 0], matrix[2, 1]))
    beta = float(np.arctan2(sine, matrix[2, 2]))
    if sine < 1e-12:
        return float(np.arctan2(matrix[1, 0], matrix[1, 1])), beta, 0.0
    alpha = float(np.arctan2(matrix[1, 2], matrix[0, 2]))
    return alpha, beta, float(np.arctan2(matrix[2, 1], -matrix[2, 0]))


class Terrain:
    """The holds that are there.

    Args:
        removed: places (T, A) without one: holes and trenches, which have no height.

    Attributes:
        present: 25 x 24, [T - 1, A - 1].
        places: of the holds, m x 2, T outer and A inner; ties go to the first.

    Raises:
        ShapeError, RangeError: what is no place of the grid.
    """

    def __init__(self, removed: Iterable[Any] = ()) -> None:
        self.present: NDArray[np.bool_] = np.ones((COLUMNS, ROWS), dtype=bool)
        for column, row in (checked_place("removed", place) for place in removed):
            self.present[column - 1, row - 1] = False
        self.places: NDArray[np.int64] = np.argwhere(self.present) + 1

    def has(self, place: Place) -> bool:
        """Whether a place has a hold."""
        return bool(self.present[place[0] - 1, place[1] - 1])


def checked_place(field: str, value: Any) -> Place:
    """(T, A) within the grid.

    Raises:
        ShapeError: not two numbers. RangeError: outside, or not whole.
    """
    numbers = validation.real_array(field, value, (2,))
    if (numbers != np.rint(numbers)).any() or not 1 <= numbers[0] <= COLUMNS or not 1 <= numbers[1] <= ROWS:
        raise RangeError(field, value, f"expected whole numbers, T in [1, {COLUMNS}] and A in [1, {ROWS}]")
    return int(numbers[0]), int(numbers[1])


def cross(a: Array, b: Array) -> Array:
    """a x b of two vectors of 3."""
    x, y, z = a
    u, v, w = b
    return np.array([y * w - z * v, z * u - x * w, x * v - y * u])


def inverse(pose: Array) -> Array:
    """Of a rigid pose."""
    out = np.eye(4)
    out[:3, :3] = pose[:3, :3].T
    out[:3, 3] = -out[:3, :3] @ pose[:3, 3]
    return out
