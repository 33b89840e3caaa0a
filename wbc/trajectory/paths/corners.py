"""Rounded corners of a polyline: how far the path has gone along the segment before a waypoint and the one behind it.

Around waypoint c with directions u before and v behind, everything is c + u a(s) + v b(s), or two turns by a(s) and
b(s). On straight pieces one of the two stands at 0; in a corner of reach d, with x from 0 to 1 over its 2 d,

    b' = 3 x^2 - 2 x^3,        a' = 1 - b',        a from -d to 0,        b from 0 to d

so that a, b and their first two derivatives are continuous. The straight lines have u (a + b) in the first half and
v (a + b) in the second, from which c + u a + v b is off by b (v - u), a (u - v): at most 3/16 d |v - u|, in the middle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.errors import RangeError
from wbc.trajectory.paths.path import Index
from wbc.trajectory.paths.waypoints import summed
from wbc.validation import Array, bound_text

#: b in the middle of a corner of reach 1
DEEPEST = 3.0 / 16.0

#: Smallest reach of a corner, as a share of the length of the whole
SHORTEST = 1e-10


@dataclass(frozen=True, eq=False)
class RoundedCorners:
    """Pieces of a polyline with rounded corners.

    Attributes:
        knots: m + 1 coordinates. corner: m, number of the waypoint that each piece refers to.
        before, behind: 5 x m, coefficients of a and of b, highest power first.
    """

    knots: Array
    corner: Index
    before: Array
    behind: Array

    def directions(self, directions: Array) -> tuple[Array, Array]:
        """(u, v) of each piece, m x n, from the directions of the segments; at the ends the one that there is."""
        last = len(directions) - 1
        return directions[np.clip(self.corner - 1, 0, last)], directions[np.clip(self.corner, 0, last)]

    def combined(self, points: Array, directions: Array) -> Array:
        """Coefficients of c + u a + v b, 5 x m x n; without powers that nothing needs."""
        u, v = self.directions(directions)
        out = self.before[:, :, None] * u + self.behind[:, :, None] * v
        out[-1] += points[self.corner]
        return out if self.behind[:-2].any() else out[-2:]


def rounded(field: str, value: float, lengths: Array, reach: Array) -> RoundedCorners:
    """Corners between segments of these lengths, each of the reach given or of half of the shorter segment beside it.

    Raises:
        RangeError: a corner shorter than 1e-10 of the whole, where ``value`` of ``field`` would have to be larger.
    """
    s = summed(lengths)
    half = 0.5 * np.minimum(lengths[:-1], lengths[1:])
    if (reach < SHORTEST * s[-1]).any():
        needed = value * float((SHORTEST * s[-1] / reach).max())
        raise RangeError(field, value, f"corners of this size vanish in rounding; at least {bound_text(needed, 1, 3)}")
    d = np.minimum(reach, half)
    rounding = 8.0 * float(np.finfo(float).eps) * s[-1]
    knots, corner, before, behind = [0.0], [], [], []
    for k in range(len(lengths)):
        start = d[k - 1] if k > 0 else 0.0
        end = lengths[k] - (d[k] if k < len(d) else 0.0)
        # Two corners that meet in the middle of a segment leave nothing between them
        if end - start > rounding or len(lengths) == 1:
            knots.append(s[k] + end if k < len(d) else s[-1])
            corner.append(k)
            before.append(np.zeros(5))
            behind.append(np.array([0.0, 0.0, 0.0, 1.0, start]))
        if k < len(d):
            knots.append(s[k + 1] + d[k])
            corner.append(k + 1)
            b = np.array([-1.0 / (16.0 * d[k] ** 3), 1.0 / (4.0 * d[k] ** 2), 0.0, 0.0, 0.0])
            before.append(np.array([0.0, 0.0, 0.0, 1.0, -d[k]]) - b)
            behind.append(b)
    return RoundedCorners(np.array(knots), np.array(corner, dtype=np.intp), np.array(before).T, np.array(behind).T)
