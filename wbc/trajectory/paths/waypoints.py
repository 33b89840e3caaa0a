"""Waypoints without repetitions, and what every path through them needs: lengths, and the kinds of ends of splines."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any, Literal

import numpy as np

from wbc import validation
from wbc.errors import RangeError, ShapeError
from wbc.validation import Array

Ends = Literal["not-a-knot", "clamped", "natural"]
ENDS = ("not-a-knot", "clamped", "natural")

#: Waypoints nearer to the one before than this share of the whole are dropped: a way through both, one beside the
#: other, is nearly a stop, for what no robot can show
NEAREST = 1e-6

#: but of long paths none that are farther apart than this [rad or m]
FARTHEST = 1e-6

#: and those nearer than this [rad or m], or than the rounding of the coordinates: no robot can tell them apart
SMALLEST = 1e-14

#: Where the segment at an end is longer than its neighbour by more than this, not-a-knot swings out far
LARGEST_STEP = 4.0


def joint_waypoints(field: str, value: Any) -> tuple[Array, Array]:
    """(m x n waypoints that are apart from each other, m - 1 distances between them), see :func:`kept`; m = 1 where all
    are equal.

    Raises:
        ShapeError, NotFiniteError: not m x n finite numbers with m >= 2 and n >= 1. RangeError: too far apart to add.
    """
    points = validation.ordinary_array(field, value)
    if points.ndim != 2 or points.shape[0] < 2 or points.shape[1] < 1:
        raise ShapeError(field, points.shape, "expected waypoints x joints, at least two waypoints")
    numbers = kept(field, len(points), lambda i, j: distance(points[i], points[j]), float(np.abs(points).max()))
    apart = points[numbers]
    return apart, np.array([distance(a, b) for a, b in pairwise(apart)])


def kept(field: str, count: int, between: Callable[[int, int], float], size: float) -> list[int]:
    """Numbers of the waypoints that a path goes through: not those nearer to the last one kept than

        max(1e-6 of the sum of all distances or 1e-6, whichever is less, 1e-14, rounding of coordinates of this size)

    The first always stays, and so does the last, unless none is apart from the first.

    Raises:
        RangeError: the sum of the distances is beyond the numbers.
    """
    with np.errstate(over="ignore"):
        whole = sum(between(k - 1, k) for k in range(1, count))
    if not np.isfinite(whole):
        raise RangeError(field, whole, "waypoints too far apart: the sum of their distances is no finite number")
    tolerance = max(min(NEAREST * whole, FARTHEST), SMALLEST, 8.0 * float(np.finfo(float).eps) * size)
    out = [0]
    for k in range(1, count):
        if between(out[-1], k) > tolerance:
            out.append(k)
    last = count - 1
    if len(out) > 1 and out[-1] != last:
        while len(out) > 1 and between(out[-1], last) <= tolerance:
            out.pop()
        out.append(last)
    return out


def distance(a: Array, b: Array) -> float:
    """|b - a|, also where squares would overflow or vanish."""
    step = b - a
    largest = float(np.abs(step).max())
    if largest == 0.0 or not np.isfinite(largest):
        return largest
    return largest * float(np.linalg.norm(step / largest))


def summed(lengths: Array) -> Array:
    """Coordinates of the waypoints: 0, and the sums of the lengths up to each."""
    return np.concatenate([[0.0], np.cumsum(lengths)])


def cubic_spline(s: Array, values: Array, ends: Ends) -> Array:
    """Coefficients (4 x pieces x columns) of the C2 cubic spline through values at s.

    Not-a-knot is replaced by natural at an end whose segment is more than 4 times as long as the next: there it would
    swing out in proportion to that ratio.
    """
    from scipy.interpolate import CubicSpline

    lengths = np.diff(s)
    kind: str | Sequence[str] = ends
    if ends == "not-a-knot" and len(lengths) > 1:
        first, last = lengths[0] > LARGEST_STEP * lengths[1], lengths[-1] > LARGEST_STEP * lengths[-2]
        # With three points both ends share the one condition that there is
        if len(lengths) > 2:
            kind = ("natural" if first else ends, "natural" if last else ends)
        elif first or last or lengths[1] > LARGEST_STEP * lengths[0] or lengths[0] > LARGEST_STEP * lengths[1]:
            kind = "natural"
    return np.asarray(CubicSpline(s, values, bc_type=kind).c, dtype=np.float64)
