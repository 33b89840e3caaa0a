"""Distances of pairs at a configuration, one call of Coal a pair: plain, and slow enough to be obvious."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

# isort: split
import pinocchio as pin

# isort: split
import coal

from wbc import validation
from wbc.proximity.body import OBSTACLE, Body, checked_pairs
from wbc.proximity.geometry import geometry_of
from wbc.symbolic.kinematics import WORLD, frame_index
from wbc.validation import Array

if TYPE_CHECKING:
    from wbc.robot import Robot


@dataclass(frozen=True, eq=False)
class Witness:
    """Where two bodies are closest, or where they overlap deepest.

    Attributes:
        distance: signed [m]; negative: how far they must be moved along ``normal`` to touch.
        normal: unit, from body A to body B [3].
        on_first, on_second: the witness points in the world [m]; on_second - on_first = distance * normal.
    """

    distance: float
    normal: Array
    on_first: Array
    on_second: Array


def distances(robot: Robot, pairs: Sequence[tuple[Body, Body]], q: Any, pose: Any = None) -> Array:
    """Signed distance of every pair [m].

    Args:
        pose: of what moves from outside; default: the identity.

    Raises:
        ShapeError, NotFiniteError, RotationError, UnknownNameError: bad pairs, configuration or pose.
    """
    return np.array([w.distance for w in witnesses(robot, pairs, q, pose)])


def witnesses(robot: Robot, pairs: Sequence[tuple[Body, Body]], q: Any, pose: Any = None) -> tuple[Witness, ...]:
    """Distance, normal and witness points of every pair; as :func:`distances`."""
    checked = checked_pairs("pairs", robot, pairs, frozenset({OBSTACLE}))
    configuration = robot.configuration("q", q)
    outside = pin.SE3.Identity() if pose is None else validation.pose("pose", pose)
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, configuration)

    def placed(body: Body) -> tuple[Any, Any]:
        geometry = geometry_of(body.shape)
        above = pin.SE3.Identity()
        if body.frame == OBSTACLE:
            above = outside
        elif body.frame != WORLD:
            above = data.oMf[frame_index(robot.model, body.frame)]
        place = above * body.placement * geometry.offset
        return geometry.geometry, coal.Transform3s(place.rotation, place.translation)

    out = []
    request = coal.DistanceRequest()
    request.enable_signed_distance = True
    for first, second in checked:
        result = coal.DistanceResult()
        value = coal.distance(*placed(first), *placed(second), request, result)
        points = (np.array(result.getNearestPoint1()), np.array(result.getNearestPoint2()))
        out.append(Witness(float(value), np.array(result.normal), *points))
    return tuple(out)
