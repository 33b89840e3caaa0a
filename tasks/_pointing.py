"""What tasks that point an axis of a frame share: the axes of their rows and the shortest turn."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from wbc import validation
from wbc.errors import RangeError
from wbc.tasks._stereographic import Triple, triple

#: An axis this close to opposite its direction [rad] turns in the declared direction.
OPPOSITE = 1e-9


def checked_axis(field: str, axis: object) -> Triple:
    """A unit vector along a direction of any length.

    Raises:
        ShapeError, NotFiniteError: not three finite numbers. RangeError: zero.
    """
    return triple(validation.unit_vector(field, axis))


def checked_around(field: str, around: object, axis: Triple) -> Triple | None:
    """The part of a direction across the unit vector ``axis``, as a unit vector; None stays None.

    Raises:
        ShapeError, NotFiniteError: not three finite numbers. RangeError: zero or parallel to the axis.
    """
    if around is None:
        return None
    given = validation.unit_vector(field, around)
    across = given - np.array(axis) * float(given @ axis)
    if not float(np.linalg.norm(across)) > 1e-6:
        raise RangeError(field, around, "expected a vector that is not parallel to the axis")
    return triple(across / float(np.linalg.norm(across)))


def row_axes(axis: Triple, around: Triple | None) -> NDArray[np.float64]:
    """3x3 rotation with the columns (b1, b2, axis): rows are counted about b1 and b2.

    b1 is ``around``; for None the coordinate axis after the one nearest ``axis``, made perpendicular to it.
    """
    third = np.array(axis)
    first = np.eye(3)[(int(np.argmax(np.abs(third))) + 1) % 3] if around is None else np.array(around)
    first = first - third * float(first @ third)
    first = first / float(np.linalg.norm(first))
    return np.column_stack([first, np.cross(third, first), third])


def shortest_turn(direction: ca.SX) -> ca.SX:
    """The components 1 and 2 of the rotation vector of the shortest turn that takes a direction to the third axis.

    With (x, y, z) the direction, of any length, and s = |(x, y)|:

        (y, -x) atan2(s, z) / s,      0 at s = 0 < z,      (pi, 0) at s = 0 > z                    [rad]

    Both limits are taken below s = OPPOSITE, a zero direction gives 0. Values only: at z < 0 = s it has no derivative.
    """
    x, y, z = direction[0], direction[1], direction[2]
    square = x * x + y * y
    on_axis = square < OPPOSITE**2
    across = ca.sqrt(ca.if_else(on_axis, 1.0, square))
    factor = ca.if_else(on_axis, 0.0, ca.atan2(across, z) / across)
    half_turn = ca.if_else(ca.logic_and(on_axis, z < 0), np.pi, 0.0)
    return ca.vertcat(factor * y + half_turn, -factor * x)
