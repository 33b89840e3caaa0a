"""Geometric paths: positions over a path coordinate s, without time.

A path has derivatives with respect to s, pieces between knots on which it is smooth, and a space:

    joints   n coordinates [rad or m], as vectors
    poses    SE(3): a pose, and (dp/ds; w) with dR/ds = [w]x R, both in world axes; then the derivatives of these six

Where all pieces are polynomials, what a law does with the path can be bounded exactly.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from wbc import validation
from wbc.errors import RangeError, ShapeError
from wbc.validation import Array

Index = NDArray[np.intp]
Space = Literal["joints", "poses"]


class Path(ABC):
    """Positions over s in [knots[0], knots[-1]].

    Attributes:
        knots: strictly increasing; the path is smooth between neighbours.
        dof: numbers of a derivative: n joints, or 6.
        space: see the module.
        degree: highest degree of the polynomials between knots, None where they are no polynomials; of poses, one more
            than that of (dp/ds; w).
        gaps: numbers of pieces on which there is no path, see :class:`JoinedPath`.
    """

    knots: Array
    dof: int
    space: Space = "joints"
    degree: int | None = None
    gaps: Index = np.zeros(0, dtype=np.intp)

    @abstractmethod
    def evaluate(self, s: Array, order: int = 0, piece: Index | None = None) -> Array:
        """Position (order 0: m x n, or m x 4 x 4) or a derivative along s (order 1 to 3: m x n), at m coordinates.

        ``piece``: number of the piece to evaluate for each s, which decides on what side of a knot the derivative is
        taken; without it, the piece that begins at the knot.
        """

    def places(self, s: Any, order: Any, piece: Any) -> tuple[Array, Index]:
        """Checked: coordinates on the path, and the number of the piece of each.

        Raises:
            ShapeError, NotFiniteError, RangeError: not numbers in one row, no order of 0 to 3, no pieces.
        """
        validation.integer("order", order, 0, 3)
        s = row_of("s", s)
        margin = self.length
        if s.size and not (s.min() >= self.knots[0] - margin and s.max() <= self.knots[-1] + margin):
            raise RangeError("s", s, f"expected coordinates of the path, {self.knots[0]:g} to {self.knots[-1]:g}")
        if piece is None:
            return s, self.pieces_at(s)
        return s, pieces_of(piece, s, len(self.knots) - 1)

    @property
    def length(self) -> float:
        """Of the interval of s."""
        return float(self.knots[-1] - self.knots[0])

    def pieces_at(self, s: Array) -> Index:
        """Number of the piece that each coordinate is on: on a knot, the one behind it; in a gap, the nearest."""
        at = np.clip(np.searchsorted(self.knots, s, side="right") - 1, 0, len(self.knots) - 2)
        if not len(self.gaps):
            return at
        behind = np.asarray(s) > 0.5 * (self.knots[at] + self.knots[at + 1])
        return np.where(np.isin(at, self.gaps), np.where(behind, at + 1, at - 1), at)

    def pieces_before(self, s: Array, piece: Index) -> Index:
        """The pieces before knots that coordinates stand on; for others, and where there is no path, their own."""
        before = piece - 1
        on_knot = (self.knots[piece] == s) & (before >= 0) & ~np.isin(before, self.gaps)
        return np.where(on_knot, before, piece)

    def same_kind(self, other: Path) -> bool:
        """Whether both are about the same number of joints, or both about poses."""
        return self.space == other.space and self.dof == other.dof


def pieces_of(piece: Any, s: Array, count: int) -> Index:
    """Numbers of pieces below ``count``, one for each coordinate.

    Raises:
        ShapeError, NotFiniteError, RangeError: they are not.
    """
    if not (type(piece) is np.ndarray and piece.dtype == np.intp and piece.shape == s.shape):
        numbers = validation.ordinary_array("piece", piece, s.shape)
        piece = numbers.astype(np.intp)
        if (piece != numbers).any():
            raise ShapeError("piece", numbers, "expected whole numbers")
    if piece.size and not (piece.min() >= 0 and piece.max() < count):
        raise RangeError("piece", piece, f"expected numbers of pieces, 0 to {count - 1}")
    return np.asarray(piece)


def row_of(field: str, value: Any) -> Array:
    """Finite numbers in one row; arrays of floats are taken as they are."""
    ready = type(value) is np.ndarray and value.dtype == np.float64 and value.ndim == 1
    if ready and np.isfinite(value).all():
        return np.asarray(value)
    out = validation.ordinary_array(field, value)
    if out.ndim != 1:
        raise ShapeError(field, value, "expected numbers in one row")
    return out


def shifted(coefficients: Array, by: Array) -> Array:
    """Coefficients of p(x + by), a number for each piece [powers, pieces, ...], by repeated synthetic division."""
    out = coefficients.copy()
    size = len(out)
    for row in range(size - 1):
        for k in range(1, size - row):
            out[k] += by * out[k - 1]
    return out


class PolynomialPath(Path):
    """Polynomials of one degree d between knots:

        q(s) = sum over k of coefficients[k, i] (s - knots[i])^(d - k)      on piece i

    Args:
        knots: m + 1, strictly increasing.
        coefficients: (d + 1) x m x n, highest power first, as in ``scipy.interpolate.PPoly``.

    Raises:
        ShapeError, NotFiniteError: of other shapes, or not finite. RangeError: knots do not increase.
    """

    def __init__(self, knots: Any, coefficients: Any) -> None:
        self.knots = validation.ordinary_array("path.knots", knots)
        self.coefficients = validation.ordinary_array("path.coefficients", coefficients)
        if self.knots.ndim != 1 or len(self.knots) < 2:
            raise ShapeError("path.knots", knots, "expected at least two numbers")
        if (np.diff(self.knots) <= 0.0).any():
            raise RangeError("path.knots", knots, "knots must increase strictly")
        shape = self.coefficients.shape
        if len(shape) != 3 or shape[1] != len(self.knots) - 1 or 0 in shape:
            raise ShapeError(
                "path.coefficients",
                self.coefficients.shape,
                f"expected powers x {len(self.knots) - 1} pieces x joints",
            )
        self.degree = self.coefficients.shape[0] - 1
        self.dof = self.coefficients.shape[2]

    def evaluate(self, s: Array, order: int = 0, piece: Index | None = None) -> Array:
        s, at = self.places(s, order, piece)
        local = (s - self.knots[at])[:, None]
        out = np.zeros((len(s), self.dof))
        highest = self.coefficients.shape[0] - 1
        for k in range(highest - order + 1):
            out = out * local + float(math.perm(highest - k, order)) * self.coefficients[k, at]
        return out

    def hull(self) -> Array:
        """Numbers that enclose q on each piece, pieces x joints x coefficients of Bernstein's polynomials."""
        degree, size = len(self.coefficients) - 1, np.diff(self.knots)
        power = [self.coefficients[degree - k] * (size**k)[:, None] for k in range(degree + 1)]
        shares = [[math.comb(i, k) / math.comb(degree, k) for k in range(i + 1)] for i in range(degree + 1)]
        return np.stack([sum(share * power[k] for k, share in enumerate(row)) for row in shares], axis=2)

    @classmethod
    def joined(cls, paths: Sequence[PolynomialPath]) -> PolynomialPath:
        """One path after the other, each of which begins where the one before it ends; coordinates go on from the
        first's.

        Raises:
            ShapeError: no polynomial paths, none at all, or of different numbers of coordinates.
        """
        paths = validation.items("paths", paths, "PolynomialPaths")
        for k, path in enumerate(paths):
            validation.instance(f"paths[{k}]", path, PolynomialPath, "a PolynomialPath")
        if len({path.coefficients.shape[2] for path in paths}) != 1:
            raise ShapeError("paths", len(paths), "expected one path or more, all of as many coordinates")
        degree = max(int(path.degree or 0) for path in paths)
        knots, rows = paths[0].knots[:1], list[Array]()
        for path in paths:
            knots = np.concatenate([knots, knots[-1] - path.knots[0] + path.knots[1:]])
            rows.append(np.pad(path.coefficients, ((degree - int(path.degree or 0), 0), (0, 0), (0, 0))))
        return cls(knots, np.concatenate(rows, axis=1))

    def sliced(self, start: float, end: float) -> PolynomialPath:
        """The part between two coordinates of the path, which keep their values.

        Raises:
            RangeError: they are not on the path, or the end is not behind the start.
        """
        start = validation.scalar("start", start, low=float(self.knots[0]), high=float(self.knots[-1]))
        end = validation.scalar("end", end, low=start, open_low=True, high=float(self.knots[-1]))
        inner = self.knots[(self.knots > start + 1e-12) & (self.knots < end - 1e-12)]
        knots = np.concatenate([[start], inner, [end]])
        pieces = self.pieces_at(knots[:-1])
        # The first piece begins within one of the path's
        shift = np.zeros((len(pieces), 1))
        shift[0] = start - self.knots[pieces[0]]
        return PolynomialPath(knots, shifted(self.coefficients[:, pieces], shift))


class JoinedPath(Path):
    """One path after another: the second's coordinate is moved behind the first's, with a gap between them, so that
    every coordinate belongs to one of the two.
    """

    #: Between the end of one path and the beginning of the next
    GAP = 1.0

    def __init__(self, first: Path, second: Path) -> None:
        if not first.same_kind(second):
            kinds = ((first.space, first.dof), (second.space, second.dof))
            raise ShapeError("path", kinds, "paths of one space and one number of joints can be joined")
        self.first, self.second = first, second
        self.shift = float(first.knots[-1] + self.GAP - second.knots[0])
        self.knots = np.concatenate([first.knots, second.knots + self.shift])
        behind = len(first.knots)
        self.gaps = np.concatenate([first.gaps, [behind - 1], second.gaps + behind]).astype(np.intp)
        self.dof, self.space = first.dof, first.space
        known = first.degree is not None and second.degree is not None
        self.degree = max(first.degree or 0, second.degree or 0) if known else None

    def evaluate(self, s: Array, order: int = 0, piece: Index | None = None) -> Array:
        s, at = self.places(s, order, piece)
        pieces = len(self.first.knots)
        behind = at >= pieces
        shape = (len(s), 4, 4) if self.space == "poses" and order == 0 else (len(s), self.dof)
        out = np.empty(shape)
        out[~behind] = self.first.evaluate(s[~behind], order, at[~behind])
        out[behind] = self.second.evaluate(s[behind] - self.shift, order, at[behind] - pieces)
        return out
