"""Surfaces as triangles, n x 3 x 3 [m]."""

from __future__ import annotations

import numpy as np

from wbc.validation import Array

#: Points round a circle
AROUND = 48


def hull_of(points: Array) -> Array:
    """The surface of the convex hull of points, n x 3."""
    from scipy.spatial import ConvexHull

    return np.asarray(points[ConvexHull(points).simplices])


def turned(profile: Array) -> Array:
    """The surface that points (distance from z, height), n x 2, sweep round the z axis."""
    angle = 2.0 * np.pi * np.arange(AROUND) / AROUND
    wide, height = profile[:, :1], np.broadcast_to(profile[:, 1:], (len(profile), AROUND))
    return between_rows(np.stack([wide * np.cos(angle), wide * np.sin(angle), height], axis=2), closed=True)


def between_rows(rows: Array, closed: bool = False) -> Array:
    """Two triangles between every four points of a grid, rows x columns x 3, cut from each point to the one that is a
    row and a column on; ``closed``: the first column comes after the last.
    """
    after = np.roll(rows, -1, axis=1)
    if not closed:
        rows, after = rows[:, :-1], after[:, :-1]
    a, b, c, d = rows[:-1], rows[1:], after[:-1], after[1:]
    return np.concatenate([np.stack(three, axis=2).reshape(-1, 3, 3) for three in ([a, b, d], [a, d, c])])
