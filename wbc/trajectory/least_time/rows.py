"""Limits along a path as rows that are linear in the path acceleration and in the square of the path speed.

With u = d2s/dt2 and x = (ds/dt)^2 a joint's acceleration is q' u + q'' x, and a torque M q' u + (M q'' + C(q, q') q') x
+ g. Both are taken at both ends of each interval of a grid, from inside of it,
because the path may have a corner at a knot.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.trajectory.paths.path import Path
from wbc.validation import Array


@dataclass(frozen=True, eq=False)
class Grid:
    """Intervals of a path coordinate, each on one piece of the path.

    Attributes:
        s: N + 1 coordinates, increasing, the knots of the path among them.
        piece: the piece of the path that each of the N intervals is on.
    """

    s: Array
    piece: Array

    @classmethod
    def over(cls, path: Path, first: int, last: int, count: int, least: int) -> Grid:
        """About ``count`` intervals over the pieces first to last - 1 of a path, at least ``least`` on each piece."""
        knots = path.knots[first : last + 1]
        total = float(knots[-1] - knots[0])
        numbers = [max(least, round(count * float(span) / total)) for span in np.diff(knots)]
        parts = [np.linspace(a, b, n + 1)[:-1] for a, b, n in zip(knots[:-1], knots[1:], numbers, strict=True)]
        return cls(np.concatenate([*parts, knots[-1:]]), np.repeat(np.arange(first, last), numbers))

    @property
    def spans(self) -> Array:
        """Lengths of the intervals."""
        return np.diff(self.s)

    def at_ends(self, path: Path, order: int) -> Array:
        """The path or a derivative of it at both ends of every interval: N x 2 x ..., from inside."""
        ends = np.stack([self.s[:-1], self.s[1:]], axis=1)
        out = path.evaluate(ends.ravel(), order, np.repeat(self.piece, 2))
        return out.reshape(len(self.piece), 2, *out.shape[1:])


@dataclass(frozen=True, eq=False)
class PathRows:
    """a u + b x + c <= 1, with c <= 1, at both ends of N intervals: N x 2 x m each; >= -1 too where ``both``, with
    c = 0.
    """

    a: Array
    b: Array
    c: Array
    both: bool = True

    def shrunk(self, factor: float) -> PathRows:
        """The same with limits that are smaller by a factor; what is there without motion stays inside."""
        bound = np.maximum(1.0 / factor, self.c)
        return PathRows(self.a / bound, self.b / bound, self.c / bound, self.both)


def accelerations(path: Path, grid: Grid, limit: Array) -> PathRows:
    """|q' u + q'' x| <= limit, for the joints that have one."""
    has = np.isfinite(limit)
    a = grid.at_ends(path, 1)[..., has] / limit[has]
    return PathRows(a, grid.at_ends(path, 2)[..., has] / limit[has], np.zeros_like(a))


def squared_speed(slope: Array, limit: Array) -> Array:
    """Upper bounds of x at the N + 1 points of a grid for |slope| sd <= limit: slopes N x 2 x m, limits m."""
    largest = (np.abs(slope) / limit).max(axis=-1, initial=0.0)
    at = np.zeros(len(largest) + 1)
    at[:-1] = largest[:, 0]
    at[1:] = np.maximum(at[1:], largest[:, 1])
    out = np.full(len(at), np.inf)
    np.divide(1.0, at * at, out=out, where=at * at > 0.0)
    return out
