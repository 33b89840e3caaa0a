"""Paths of poses: a position and an orientation over the same pieces of the same coordinate."""

from __future__ import annotations

import numpy as np

from wbc.errors import RangeError, ShapeError
from wbc.trajectory.paths.path import Index, Path, Space
from wbc.trajectory.paths.turning import Turning
from wbc.validation import Array


class PosePath(Path):
    """Position p(s) and orientation R(s): order 0 is the pose, 4 x 4, then (p'; w), (p''; w'), (p'''; w'') with
    dR/ds = [w]x R, all in world axes.

    Its ``degree`` is one more than that of the polynomials (p'; w), None where they are none: where every piece is
    straight and turns about one axis, what a law makes of its twist and of the derivatives is bounded exactly.

    Args:
        position: of dof 3. turning: the orientations, over the same knots.

    Raises:
        ShapeError: position of another dof. RangeError: other knots.
    """

    space: Space = "poses"
    dof = 6

    def __init__(self, position: Path, turning: Turning) -> None:
        if position.dof != 3:
            raise ShapeError("path.position", position.dof, "expected a path of dof 3")
        if not np.array_equal(position.knots, turning.knots):
            raise RangeError("path.turning", turning.knots, "position and orientation must have the same knots")
        self.position, self.turning = position, turning
        self.knots = position.knots
        known = position.degree is not None and turning.degree is not None
        self.degree = max(position.degree or 0, turning.degree or 0) if known else None

    def evaluate(self, s: Array, order: int = 0, piece: Index | None = None) -> Array:
        s, at = self.places(s, order, piece)
        place, turn = self.position.evaluate(s, order, at), self.turning.evaluate(s, order, at)
        if order:
            return np.hstack([place, turn])
        out = np.zeros((len(s), 4, 4))
        out[:, :3, :3], out[:, :3, 3], out[:, 3, 3] = turn, place, 1.0
        return out


class Circle(Path):
    """p(s) = center + cos(k s) x + sin(k s) y for s in [0, length], of dof 3.

    Args:
        center, x, y: 3 each [m]; x and y span the plane, and are as long as the radius. rate: k, angle per s.
        knots: from 0 to length. What samples a path does so between knots: a radian is far enough.
    """

    def __init__(self, center: Array, x: Array, y: Array, rate: float, knots: Array) -> None:
        self.center, self.x, self.y, self.rate = center, x, y, rate
        self.knots, self.dof = knots, 3

    def evaluate(self, s: Array, order: int = 0, piece: Index | None = None) -> Array:
        # A derivative of sine and cosine is a quarter of a turn ahead
        angles = self.rate * np.asarray(s, dtype=np.float64)[:, None]
        cosine = (np.cos(angles), -np.sin(angles), -np.cos(angles), np.sin(angles))[order]
        sine = (np.sin(angles), np.cos(angles), -np.sin(angles), -np.cos(angles))[order]
        out: Array = self.rate**order * (cosine * self.x + sine * self.y)
        return self.center + out if order == 0 else out
