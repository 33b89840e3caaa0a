"""Circular arcs of poses. What s is, see ``pose_paths``."""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np

from wbc import validation
from wbc.errors import RangeError
from wbc.rotations import matrices, quaternion
from wbc.trajectory.paths.path import Path, PolynomialPath
from wbc.trajectory.paths.pose_path import Circle, PosePath
from wbc.trajectory.paths.pose_paths import LARGEST_TURN, RADIUS, standing_pose
from wbc.trajectory.paths.turning import TwoTurns, turn_between
from wbc.trajectory.paths.waypoints import SMALLEST, distance
from wbc.validation import Array

Orientation = Literal["carried", "kept"]

#: Three points are on one line where the sine of the angle at the first is below this
STRAIGHT = 1e-9


def arc_path(
    start: Any, center: Any, turn: Any, orientation: Orientation = "carried", radius: float = RADIUS
) -> PosePath:
    """From a pose, round an axis:

        p = c + exp([turn]x s / L) (p_0 - c),        R = exp([turn]x s / L) R_0        for s in [0, L]

    with c the point on the axis that is nearest to p_0, and L = |p_0 - c| |turn| + ``radius`` |turn|, or without the
    second term where the orientation is kept.

    Args:
        start: pose (``pin.SE3``, 4 x 4, or position and quaternion x, y, z, w).
        center: any point on the axis, 3 [m].
        turn: direction of the axis times the angle, world axes, 3 [rad]; more than a whole turn is allowed, and none
            gives a path that stands.
        orientation: ``carried``: turns with the arc; ``kept``: stays.
        radius: metres that a radian counts for, positive.

    Raises:
        ShapeError, NotFiniteError, RotationError: bad pose, center or turn. UnknownNameError: other orientation.
        RangeError: radius not positive; numbers too large.
    """
    validation.one_of("path.orientation", orientation, ("carried", "kept"))
    radius = validation.scalar("path.radius", radius, low=0.0, open_low=True, unit="m")
    pose = validation.pose("path.start", start)
    point, middle = np.array(pose.translation), validation.ordinary_array("path.center", center, (3,))
    whole = validation.ordinary_array("path.turn", turn, (3,))
    angle = distance(np.zeros(3), whole)
    axis = whole / angle if angle > 0.0 else np.zeros(3)
    rotation = matrices(quaternion(pose.rotation)[None])
    arm = point - middle
    x = arm - axis * float(axis @ arm)
    return _arc(point - x, x, axis, angle, whole if orientation == "carried" else np.zeros(3), rotation, radius=radius)


def arc_through(start: Any, via: Any, end: Any, radius: float = RADIUS) -> PosePath:
    """From a pose to a pose on the circle through a point between, turning at the same time from the first orientation
    to the last about one axis: R = exp([w]x s) R_0, w = log(R_1 R_0') / L.

    Args:
        start, end: poses (``pin.SE3``, 4 x 4, or position and quaternion x, y, z, w).
        via: 3 [m].
        radius: metres that a radian counts for, positive.

    Raises:
        ShapeError, NotFiniteError, RotationError: bad poses or via. RangeError: radius not positive; the three points
            on one line, or two of them equal, which is no circle; half a turn, whose direction is not given.
    """
    radius = validation.scalar("path.radius", radius, low=0.0, open_low=True, unit="m")
    first, last = validation.pose("path.start", start), validation.pose("path.end", end)
    a, c = np.array(first.translation), np.array(last.translation)
    b = validation.ordinary_array("path.via", via, (3,))
    middle, normal = _circle(a, b, c)
    x = a - middle
    angle = _angle(x, c - middle, normal)
    quaternions = quaternion(first.rotation), quaternion(last.rotation)
    turn = turn_between(*quaternions)
    if np.linalg.norm(turn) > LARGEST_TURN:
        raise RangeError("path.end", end, "half a turn from the first orientation: both directions are as long")
    return _arc(middle, x, normal, angle, turn, matrices(quaternions[0][None]), radius=radius)


def _circle(a: Array, b: Array, c: Array) -> tuple[Array, Array]:
    """(center, unit normal such that a, b, c follow each other counter-clockwise).

    With u = b - a and v = c - a:    center - a = (|v|^2 (u x v) x u + |u|^2 v x (u x v)) / (2 |u x v|^2)
    """
    scale = max(distance(a, b), distance(a, c), distance(b, c))
    if not SMALLEST < scale < np.inf:
        raise RangeError("path.via", b, "the three points are the same, or too far apart")
    u, v = (b - a) / scale, (c - a) / scale
    normal = np.cross(u, v)
    size = float(np.linalg.norm(normal))
    if size <= STRAIGHT * float(np.linalg.norm(u) * np.linalg.norm(v)) or size == 0.0:
        raise RangeError("path.via", b, "on one line with start and end, which is no circle; geodesic_path is straight")
    center = (v @ v) * np.cross(normal, u) + (u @ u) * np.cross(v, normal)
    return a + scale * center / (2.0 * size**2), normal / size


def _angle(x: Array, y: Array, normal: Array) -> float:
    """From x to y round the normal, in (0, 2 pi)."""
    angle = float(np.arctan2(normal @ np.cross(x, y), x @ y))
    return angle if angle > 0.0 else angle + 2.0 * np.pi


def _arc(
    center: Array, x: Array, normal: Array, angle: float, turn: Array, rotation: Array, *, radius: float
) -> PosePath:
    """By ``angle`` round ``normal`` from center + x, while turning by ``turn``."""
    arm = distance(np.zeros(3), x)
    with np.errstate(over="ignore"):
        travel = arm * angle
        length = travel + radius * distance(np.zeros(3), turn)
    if not np.isfinite(length):
        raise RangeError("path.turn", angle, "the length of the arc is no finite number")
    if length <= SMALLEST:
        return standing_pose(center + x, rotation)
    # A knot a radian, so that samples between them do not meet the same phase of every turn
    pieces = max(1, math.ceil(angle)) if travel > SMALLEST else 1
    knots = np.linspace(0.0, length, pieces + 1)
    position: Path
    if travel <= SMALLEST:
        position = PolynomialPath(knots, np.array([np.zeros(3), center + x])[:, None])
    else:
        position = Circle(center, x, np.cross(normal, x), angle / length, knots)
    angles = np.zeros((2, pieces, 2))
    angles[0, :, 1], angles[1, :, 1] = 1.0, knots[:-1]
    parts = (np.zeros((pieces, 3)), np.tile(turn / length, (pieces, 1)), np.repeat(rotation, pieces, axis=0))
    return PosePath(position, TwoTurns(PolynomialPath(knots, angles), *parts))
