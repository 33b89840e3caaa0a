"""Orientations over a path coordinate: products of two turns about fixed axes, and splines of quaternions.

Each gives the rotation matrix R(s), and w(s) with dR/ds = [w]x R in world axes, and the derivatives of w.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from wbc.errors import RangeError
from wbc.rotations import exponential, matrices, relative_quaternion
from wbc.trajectory.paths import bernstein
from wbc.trajectory.paths.path import Index, PolynomialPath
from wbc.validation import Array

#: The spline of quaternions may not come nearer to zero than this, where its direction is badly defined
SHORTEST_QUATERNION = 0.2


class Turning(Protocol):
    """Orientations over the pieces of a path.

    Attributes:
        knots: of the pieces.
        degree: one more than that of w, where w is a polynomial on every piece; else None.
    """

    knots: Array
    degree: int | None

    def evaluate(self, s: Array, order: int, piece: Index) -> Array:
        """R (order 0: m x 3 x 3), w, w' or w'' (order 1 to 3: m x 3)."""


class TwoTurns:
    """Two turns about axes that stand still in the world, the first by a(s) and the second by b(s):

        R = exp([v]x b) exp([u]x a) R_0,        w = v b' + u~ a',        u~ = exp([v]x b) u

    Args:
        angles: polynomials a and b (a path of dof 2).
        first, second: u and v of each piece, m x 3; turns per unit of a and b [rad].
        base: R_0 of each piece, m x 3 x 3.
    """

    def __init__(self, angles: PolynomialPath, first: Array, second: Array, base: Array) -> None:
        self.angles, self.first, self.second, self.base = angles, first, second, base
        self.knots = angles.knots
        both = np.all(np.any(angles.coefficients[:-1] != 0.0, axis=0), axis=1)
        apart = bool(np.cross(first, second)[both].any())
        self.degree: int | None = None if apart or angles.degree is None else angles.degree
        if not (first.any() or second.any()):
            self.degree = 0

    def evaluate(self, s: Array, order: int, piece: Index) -> Array:
        a, b = self.angles.evaluate(s, 0, piece).T
        u, v = self.first[piece], self.second[piece]
        turn = exponential(v * b[:, None])
        if order == 0:
            return np.asarray(turn @ exponential(u * a[:, None]) @ self.base[piece])
        da, db = (x[:, None] for x in self.angles.evaluate(s, 1, piece).T)
        u = np.einsum("mij,mj->mi", turn, u)
        if order == 1:
            return np.asarray(v * db + u * da)
        dda, ddb = (x[:, None] for x in self.angles.evaluate(s, 2, piece).T)
        across = np.cross(v, u)
        if order == 2:
            return np.asarray(v * ddb + u * dda + across * (da * db))
        third_a, third_b = (x[:, None] for x in self.angles.evaluate(s, 3, piece).T)
        twice = np.cross(v, across)
        along = v * third_b + u * third_a + twice * (da * db**2)
        return np.asarray(along + across * (2.0 * dda * db + da * ddb))


class QuaternionSpline:
    """The direction of a spline S(s) in R^4:

        Q = S / |S|,        w = 2 vec(S' S*) / |S|^2

    with the product of quaternions and S* the conjugate; C2 where S is.

    Args:
        spline: x, y, z, w over s. field: what errors name.

    Raises:
        RangeError: |S| gets below 0.2, where its direction is badly defined.
    """

    degree: int | None = None

    def __init__(self, spline: PolynomialPath, field: str) -> None:
        self.spline, self.knots = spline, spline.knots
        nodes = bernstein.nodes(2 * (spline.degree or 0))
        pieces = np.repeat(np.arange(len(spline.knots) - 1), len(nodes))
        grid = (spline.knots[:-1, None] + np.diff(spline.knots)[:, None] * nodes).ravel()
        squares = np.sum(spline.evaluate(grid, 0, pieces) ** 2, axis=1).reshape(-1, len(nodes))
        # Squares are polynomials as well: their smallest value is found, not sampled
        lowest, at, _ = bernstein.largest(-bernstein.coefficients(squares))
        if -lowest < SHORTEST_QUATERNION**2:
            place = f"between {at} and {at + 1} of the poses that differ"
            raise RangeError(field, place, "orientations change too unevenly here; add poses")

    def evaluate(self, s: Array, order: int, piece: Index) -> Array:
        parts = [self.spline.evaluate(s, k, piece) for k in range(order + 1)]
        size = np.einsum("mi,mi->m", parts[0], parts[0])[:, None]
        if order == 0:
            return matrices(parts[0] / np.sqrt(size))
        value, rate = parts[:2]
        n = 2.0 * relative_quaternion(rate, value)[:, :3]
        if order == 1:
            return np.asarray(n / size)
        dn = 2.0 * relative_quaternion(parts[2], value)[:, :3]
        dsize = 2.0 * np.einsum("mi,mi->m", value, rate)[:, None]
        if order == 2:
            return np.asarray(dn / size - n * dsize / size**2)
        ddn = 2.0 * (relative_quaternion(parts[3], value) + relative_quaternion(parts[2], rate))[:, :3]
        ddsize = 2.0 * np.einsum("mi,mi->m", rate, rate)[:, None]
        ddsize += 2.0 * np.einsum("mi,mi->m", value, parts[2])[:, None]
        out = ddn / size - (2.0 * dn * dsize + n * ddsize) / size**2 + 2.0 * n * dsize**2 / size**3
        return np.asarray(out)


def turn_between(first: Array, second: Array) -> Array:
    """The shortest rotation vector [rad], in the world, from one unit quaternion to another."""
    step = relative_quaternion(second, first)
    if step[3] < 0.0:
        step = -step
    sine = float(np.linalg.norm(step[:3]))
    if sine == 0.0:
        return np.zeros(3)
    return np.asarray(step[:3] * (2.0 * np.arctan2(sine, step[3]) / sine))
