"""Places that a body is over: on the grid of the cylinder, or over holds."""

from __future__ import annotations

from collections.abc import Sequence
from math import radians
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from wbc import validation
from wbc.errors import ShapeError
from wbc.multibody import pin
from wbc.validation import Array

if TYPE_CHECKING:
    from wbc.walking.holds.structure import Structure


class GridPlace(NamedTuple):
    """On the grid of the published cylinder: T round it, A along it, fractions allowed, and the heading [rad]."""

    t: float
    a: float
    heading: float = 0.0


#: Over the grid, or over a hold by its id
Place = GridPlace | str


def grid_place(field: str, value: Any) -> GridPlace:
    """From the text ``T,A`` or ``T,A,heading`` with the heading in degrees, or from numbers, the heading in radians.

    Raises:
        ShapeError: something else. RangeError: a place beside the grid.
    """
    if isinstance(value, str):
        try:
            numbers = [float(part) for part in value.split(",")]
        except ValueError as error:
            raise ShapeError(field, value, "expected T,A or T,A,heading [deg]") from error
        numbers[2:] = [radians(angle) for angle in numbers[2:]]
    else:
        numbers = validation.real_array(field, value, finite=False).ravel().tolist()
    if len(numbers) not in (2, 3):
        raise ShapeError(field, value, "expected T,A or T,A,heading [deg]")
    from wbc.walking.holds.built_in import ROWS_A, ROWS_T

    t, a, heading = (*numbers, 0.0)[:3]
    validation.scalar(f"{field}.T", t, low=1.0, high=float(ROWS_T))
    validation.scalar(f"{field}.A", a, low=1.0, high=float(ROWS_A))
    return GridPlace(t, a, validation.scalar(f"{field}.heading", heading, unit="rad"))


def over_holds(structure: Structure, names: Sequence[str], height: float) -> list[pin.SE3]:
    """Body poses at ``height`` [m] over holds: z along the approach direction, x towards the next one.

    From hold to hold the body turns by the smallest rotation that takes one approach direction to the other.

    Raises:
        UnknownNameError: no such hold.
    """
    rows = [structure.index(name) for name in names]
    axes = structure.axes[rows]
    places = structure.positions[rows] - height * axes
    ahead = next((p - places[0] for p in places[1:] if np.linalg.norm(p - places[0]) > 1e-6), None)
    turn = _frame(axes[0], structure.references[rows[0]] if ahead is None else ahead)
    out = []
    for k, place in enumerate(places):
        if k:
            turn = pin.Quaternion.FromTwoVectors(axes[k - 1], axes[k]).toRotationMatrix() @ turn
        out.append(pin.SE3(turn, place))
    return out


def _frame(z: Array, towards: Array) -> Array:
    """A rotation with this z axis and an x axis that is nearest to a direction; any x if that is along z."""
    across = towards - (towards @ z) * z
    if np.linalg.norm(across) < 1e-6:
        across = np.cross(z, np.eye(3)[int(np.argmin(np.abs(z)))])
    x = across / np.linalg.norm(across)
    return np.stack([x, np.cross(z, x), z], axis=1)
