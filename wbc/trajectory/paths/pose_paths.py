"""Paths of poses: straight lines, polylines with rounded corners, and splines; arcs are in ``arcs``.

The coordinate s is metres of travel plus ``radius`` times the turn [rad], so that turns on the spot have a length, and
(p'; w) is bounded by 1 and by 1 / ``radius``. ``radius`` is 0.5 m unless given: one radian counts as half a metre.

Poses that repeat the one before are dropped (nearer than 1e-6 of the whole and than 1e-6 m, or than the rounding of the
coordinates), and passed within that distance; the last one is always reached. Where all are equal, the path stands: it
is of degree 0 over s in [0, 1].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import degrees, pi, radians
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import RangeError, ShapeError
from wbc.rotations import continuous_quaternions, matrices, quaternion
from wbc.trajectory.paths.corners import DEEPEST, RoundedCorners, rounded
from wbc.trajectory.paths.joint_paths import standing_path
from wbc.trajectory.paths.path import PolynomialPath
from wbc.trajectory.paths.pose_path import PosePath
from wbc.trajectory.paths.turning import QuaternionSpline, TwoTurns, turn_between
from wbc.trajectory.paths.waypoints import ENDS, Ends, cubic_spline, distance, kept, summed
from wbc.validation import Array, bound_text

#: A radian of turn counts as so many metres
RADIUS = 0.5

#: Neighbouring orientations may be at most this far apart [rad]: at half a turn both directions are as long
LARGEST_TURN = pi - 1e-6

#: and those of a spline not more than this
LARGEST_SPLINE_TURN = radians(170.0)


@dataclass(frozen=True, eq=False)
class Poses:
    """Poses apart from each other, as points (m x 3), quaternions x, y, z, w (m x 4), and what is between neighbours:
    turns (m - 1 x 3) [rad] and lengths (m - 1) [m].
    """

    points: Array
    quaternions: Array
    turns: Array
    lengths: Array

    @classmethod
    def checked(cls, values: Sequence[Any], radius: float, largest: float = LARGEST_TURN) -> Poses:
        """From ``pin.SE3``, 4 x 4, or position and quaternion x, y, z, w, each.

        Raises:
            ShapeError, NotFiniteError, RotationError: no poses. RangeError: a turn larger than ``largest``.
        """
        points, quaternions = placed_poses("path.poses", values)

        def between(i: int, j: int) -> float:
            turn = float(np.linalg.norm(turn_between(quaternions[i], quaternions[j])))
            return distance(points[i], points[j]) + radius * turn

        size = max(float(np.abs(points).max()), radius)
        numbers = kept("path.poses", len(points), between, size)
        pairs = list(pairwise(numbers))
        turns = np.array([turn_between(quaternions[i], quaternions[j]) for i, j in pairs]).reshape(-1, 3)
        for (_, number), turn in zip(pairs, turns, strict=True):
            angle = float(np.linalg.norm(turn))
            if angle > largest:
                raise RangeError(
                    f"path.poses[{number}]",
                    f"{degrees(angle):.9g} deg",
                    f"too far from the orientation before it, at most {bound_text(degrees(largest), -1)} deg; add a "
                    "pose between",
                )
        return cls(points[numbers], quaternions[numbers], turns, np.array([between(i, j) for i, j in pairs]))

    def standing(self) -> PosePath:
        """The path that stays at the first."""
        return standing_pose(self.points[0], matrices(self.quaternions[:1]))


def placed_poses(field: str, values: Any) -> tuple[Array, Array]:
    """Points m x 3 and unit quaternions m x 4 of two poses or more.

    Raises:
        ShapeError, NotFiniteError, RotationError: no poses, or less than two.
    """
    try:
        given = list(values)
    except TypeError as error:
        raise ShapeError(field, values, "expected a sequence of poses") from error
    if len(given) < 2:
        raise ShapeError(field, len(given), "expected at least two poses")
    placed = [validation.pose(f"{field}[{k}]", value) for k, value in enumerate(given)]
    return np.array([pose.translation for pose in placed]), np.array([quaternion(pose.rotation) for pose in placed])


def geodesic_path(start: Any, end: Any, radius: float = RADIUS) -> PosePath:
    """A straight line, and a constant turn about one axis, both over s in [0, L]:

        p = p_0 + s (p_1 - p_0) / L,    R = exp([w]x s) R_0,    w = log(R_1 R_0') / L,    L = |p_1 - p_0| + radius |log|

    Its degree is 1: certificates of laws along it are exact.

    Args:
        start, end: poses (``pin.SE3``, 4 x 4, or position and quaternion x, y, z, w).
        radius: metres that a radian counts for, positive.

    Raises:
        ShapeError, NotFiniteError, RotationError: no poses. RangeError: half a turn, whose direction is not given;
            radius not positive.
    """
    return pose_polyline([start, end], 1.0, radius=radius)


def pose_polyline(
    poses: Sequence[Any], deviation: float, turn_deviation: float | None = None, radius: float = RADIUS
) -> PosePath:
    """Straight lines that turn about one axis each, with corners rounded in position and in orientation, over a
    distance d before and behind each pose:

        p = c + u a + v b,        R = exp([w_v]x b) exp([w_u]x a) R_c,        a' = 1 - b',        b' = 3 x^2 - 2 x^3

    with x from 0 to 1 over the 2 d of the corner: straight up to it (b = 0), and behind it (a = 0). Pose, (p'; w) and
    (p''; w') are continuous. At every s the pose is at most 3 d |v - u| / 16 <= ``deviation`` and
    3 d |w_v - w_u| / 16 <= ``turn_deviation`` from that of the lines without rounding at the same s.

    Args:
        poses: at least two (``pin.SE3``, 4 x 4, or position and quaternion x, y, z, w).
        deviation: [m], positive. Less where d would be more than half of a segment.
        turn_deviation: [rad], positive; deviation / radius unless given.
        radius: metres that a radian counts for, positive.

    Raises:
        ShapeError, NotFiniteError, RotationError: no poses. RangeError: numbers not positive, or deviations so small
            that corners vanish in rounding; half a turn between neighbours, whose direction is not given.
    """
    radius = validation.scalar("path.radius", radius, low=0.0, open_low=True, unit="m")
    deviation = validation.scalar("path.deviation", deviation, low=0.0, open_low=True, unit="m")
    if turn_deviation is None:
        turn_deviation = deviation / radius
    turn_deviation = validation.scalar("path.turn_deviation", turn_deviation, low=0.0, open_low=True, unit="rad")
    known = Poses.checked(poses, radius)
    if len(known.points) == 1:
        return known.standing()
    directions = np.diff(known.points, axis=0) / known.lengths[:, None]
    rates = known.turns / known.lengths[:, None]
    deflections, twists = (np.linalg.norm(np.diff(x, axis=0), axis=1) for x in (directions, rates))
    with np.errstate(divide="ignore", over="ignore"):
        by_turn = turn_deviation / (DEEPEST * twists)
        by_place = deviation / (DEEPEST * deflections)
    # Where corners are too small, the deviation is named that makes the smallest one
    turns_first = by_turn.min(initial=np.inf) < by_place.min(initial=np.inf)
    field, value = ("path.turn_deviation", turn_deviation) if turns_first else ("path.deviation", deviation)
    corners = rounded(field, value, known.lengths, np.minimum(by_turn, by_place))
    position = PolynomialPath(corners.knots, corners.combined(known.points, directions))
    return PosePath(position, _turns(corners, rates, matrices(known.quaternions)))


def pose_spline(poses: Sequence[Any], ends: Ends = "not-a-knot", radius: float = RADIUS) -> PosePath:
    """Cubic splines of position, and of quaternions S in R^4 (signs such that neighbours are nearest), through poses:

        p = spline(s),        Q = S / |S|,        w = 2 vec(S' S*) / |S|^2

    over the sum of the distances from pose to pose. Pose, (p'; w) and (p''; w') are continuous.

    Args:
        poses: at least two (``pin.SE3``, 4 x 4, or position and quaternion x, y, z, w). Two give a
            :func:`geodesic_path`, unless clamped.
        ends: as in :func:`wbc.trajectory.spline_path`. radius: metres that a radian counts for, positive.

    Raises:
        ShapeError, NotFiniteError, RotationError: no poses. UnknownNameError: other ends. RangeError: radius not
            positive; neighbouring orientations more than 170 degrees apart, or changing too unevenly.

    Cannot do: stay near the straight lines; |(p'; w)| is not constant along s.
    """
    validation.one_of("path.ends", ends, ENDS)
    radius = validation.scalar("path.radius", radius, low=0.0, open_low=True, unit="m")
    known = Poses.checked(poses, radius, LARGEST_SPLINE_TURN)
    if len(known.points) == 1:
        return known.standing()
    if len(known.points) == 2 and ends != "clamped":
        return geodesic_path(poses[0], poses[-1], radius)
    s = summed(known.lengths)
    position = PolynomialPath(s, cubic_spline(s, known.points, ends))
    spline = PolynomialPath(s, cubic_spline(s, continuous_quaternions(known.quaternions), ends))
    return PosePath(position, QuaternionSpline(spline, "path.poses"))


def standing_pose(point: Array, rotation: Array) -> PosePath:
    """Of degree 0, over s in [0, 1]; ``rotation``: 1 x 3 x 3."""
    none = np.zeros((1, 3))
    angles = PolynomialPath([0.0, 1.0], np.zeros((1, 1, 2)))
    return PosePath(standing_path(point), TwoTurns(angles, none, none, rotation))


def _turns(corners: RoundedCorners, rates: Array, rotations: Array) -> TwoTurns:
    angles = np.stack([corners.before, corners.behind], axis=2)
    if not corners.behind[:-2].any():
        angles = angles[-2:]
    first, second = corners.directions(rates)
    return TwoTurns(PolynomialPath(corners.knots, angles), first, second, rotations[corners.corner])
