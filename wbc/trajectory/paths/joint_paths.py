"""Paths of joints through waypoints: standing, straight, splines, and straight pieces with rounded corners.

The coordinate s is the distance sqrt(sum of squares) [rad or m] from waypoint to waypoint, so that |q'| is near 1
whatever the size of the move. Waypoints that repeat the one before are dropped (nearer than 1e-6 of the whole and than
1e-6, or than the rounding of the coordinates), and passed within that distance; the last one is always reached. Where
all are equal, the path stands: see :func:`standing_path`.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import ShapeError
from wbc.trajectory.paths.corners import DEEPEST, rounded
from wbc.trajectory.paths.path import PolynomialPath
from wbc.trajectory.paths.waypoints import ENDS, Ends, cubic_spline, distance, joint_waypoints, summed
from wbc.validation import Array


def standing_path(position: Any) -> PolynomialPath:
    """q(s) = position for s in [0, 1], a polynomial of degree 0: the path of a law that stands.

    ``position``: n [rad or m].

    Raises:
        ShapeError, NotFiniteError: not n finite numbers.
    """
    place = validation.ordinary_array("path.position", position)
    if place.ndim != 1 or not len(place):
        raise ShapeError("path.position", position, "expected one number for each joint")
    return PolynomialPath([0.0, 1.0], place[None, None])


def straight_path(start: Any, end: Any) -> PolynomialPath:
    """q(s) = start + s (end - start) / |end - start| for s in [0, |end - start|].

    Standing, where there is nothing between the two.

    Raises:
        ShapeError, NotFiniteError: not two vectors of n finite numbers. RangeError: too far apart.
    """
    first = validation.ordinary_array("path.start", start)
    if first.ndim != 1:
        raise ShapeError("path.start", start, "expected one number for each joint")
    last = validation.ordinary_array("path.end", end, first.shape)
    points, lengths = joint_waypoints("path", np.array([first, last]))
    if len(points) == 1:
        return standing_path(points[0])
    return PolynomialPath([0.0, lengths[0]], np.array([(last - first) / lengths[0], first])[:, None])


def joint_polyline(points: Array) -> PolynomialPath:
    """Straight pieces between points [m, n] with corners, at which laws rest; points that repeat are left out."""
    steps = np.diff(points, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    kept = lengths > 0.0
    knots = np.concatenate([[0.0], np.cumsum(lengths[kept])])
    return PolynomialPath(knots, np.array([steps[kept] / lengths[kept, None], points[:-1][kept]]))


def spline_path(waypoints: Any, ends: Ends = "not-a-knot") -> PolynomialPath:
    """The cubic spline through waypoints over the sum of the distances between them: q, q' and q'' are continuous.

    Args:
        waypoints: m x n, m >= 2 [rad or m].
        ends: ``not-a-knot``: one polynomial over the two first and over the two last segments (natural where the
            segment at the end is more than 4 times as long as its neighbour, since the spline would swing out);
            ``clamped``: q' = 0 at both ends; ``natural``: q'' = 0 there.

    Raises:
        ShapeError, NotFiniteError: of other shapes, or not finite. UnknownNameError: other ends.
        RangeError: too far apart.

    Source: C. de Boor, A Practical Guide to Splines, chapter IV. Cannot do: stay near the straight lines between
    waypoints, see :func:`blend_path`.
    """
    validation.one_of("path.ends", ends, ENDS)
    points, lengths = joint_waypoints("path.waypoints", waypoints)
    if len(points) == 1:
        return standing_path(points[0])
    if len(points) == 2 and ends != "clamped":
        return straight_path(points[0], points[1])
    s = summed(lengths)
    return PolynomialPath(s, cubic_spline(s, points, ends))


def blend_path(waypoints: Any, deviation: float) -> PolynomialPath:
    """Straight between waypoints, with corners rounded over a distance d before and behind each:

        q' = u + (v - u) (3 x^2 - 2 x^3),        x in [0, 1] over the 2 d of the corner

    from direction u to direction v, a polynomial of degree 4. q, q' and q'' are continuous, hence the curvature too
    (but where the path turns straight back, which has none). At every s, the path is at most
    3 d |v - u| / 16 <= ``deviation`` from the straight lines at the same s; that farthest place is in the middle of
    the corner, where it passes the waypoint. The first and the last waypoint are reached.

    Args:
        waypoints: m x n, m >= 2 [rad or m].
        deviation: largest distance (square root of the sum of squares over joints) from the straight lines,
            positive. Less where d would be more than half of a segment.

    Raises:
        ShapeError, NotFiniteError: of other shapes, or not finite. RangeError: not positive, or so small that corners
            vanish in rounding (then the smallest that works is named); waypoints too far apart.
    """
    deviation = validation.scalar("path.deviation", deviation, low=0.0, open_low=True, unit="rad or m")
    points, lengths = joint_waypoints("path.waypoints", waypoints)
    if len(points) == 1:
        return standing_path(points[0])
    directions = np.diff(points, axis=0) / lengths[:, None]
    deflections = np.array([distance(u, v) for u, v in pairwise(directions)])
    with np.errstate(divide="ignore", over="ignore"):
        reach = deviation / (DEEPEST * deflections)
    corners = rounded("path.deviation", deviation, lengths, reach)
    return PolynomialPath(corners.knots, corners.combined(points, directions))
