"""Distances and witness points of pairs at one configuration, for users and for tests of other things."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from wbc import validation
from wbc.multibody import pin
from wbc.proximity.body import OBSTACLE, Body, checked_pairs
from wbc.proximity.native import Sensing
from wbc.proximity.scene import PairScene
from wbc.validation import Array

if TYPE_CHECKING:
    from wbc.robot import Robot


@dataclass(frozen=True, eq=False)
class Witness:
    """Where two bodies are closest, or where they overlap deepest.

        on_second - on_first = distance * normal

    Attributes:
        distance: signed [m]; negative: how far they must be moved apart along ``normal`` to touch.
        normal: unit, from body A to body B [3].
        on_first, on_second: the witness points in the world [m], 3 each.
        doubtful: the normal is a declared one, see docs/proximity.md.
    """

    distance: float
    normal: Array
    on_first: Array
    on_second: Array
    doubtful: bool


def distances(robot: Robot, pairs: Sequence[tuple[Body, Body]], q: Any, pose: Any = None) -> Array:
    """Signed distance of every pair [m]; negative where two bodies overlap.

    Args:
        robot: the robot that carries the bodies.
        pairs: bodies A and B each.
        q: configuration [nq].
        pose: of what moves from outside, see :class:`Body`; default: the identity.

    Raises:
        ShapeError, NotFiniteError, RotationError, UnknownNameError, DuplicateNameError, RangeError: bad pairs,
            configuration or pose.

    The geometries are made anew in every call: for many configurations use :class:`PairSensor`.
    """
    return np.array([w.distance for w in witnesses(robot, pairs, q, pose)])


def witnesses(robot: Robot, pairs: Sequence[tuple[Body, Body]], q: Any, pose: Any = None) -> tuple[Witness, ...]:
    """Distance, normal and witness points of every pair; arguments and errors as for :func:`distances`."""
    from wbc.robot.robot import Robot  # robots measure their own pairs with this package

    validation.instance("robot", robot, Robot, "a wbc Robot, see wbc.robots.load")
    outside = frozenset({OBSTACLE})
    checked = checked_pairs("pairs", robot, pairs, outside)
    configuration = robot.configuration("q", q)
    where = pin.SE3.Identity() if pose is None else validation.pose("pose", pose)
    if not checked:
        return ()
    found = Sensing(PairScene(robot, checked, outside))
    found.measure(configuration, where)
    out = []
    for k in range(len(checked)):
        gap, normal, point = float(found.distances[k]), np.array(found.normals[k]), np.array(found.points[k])
        out.append(Witness(gap, normal, point, point + gap * normal, bool(found.doubtful[k])))
    return tuple(out)
