"""The path coordinate over time, as a piecewise polynomial."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbc import validation
from wbc.errors import RangeError, ShapeError
from wbc.trajectory.paths import bernstein
from wbc.trajectory.paths.path import Index, PolynomialPath, pieces_of, row_of, shifted
from wbc.validation import Array


class Timing:
    """s(t) on [0, duration]:

        s(t) = sum over k of coefficients[k, i] (t - times[i])^(d - k)      on piece i

    Args:
        times: m + 1 numbers from 0, strictly increasing [s].
        coefficients: (d + 1) x m, highest power first.

    Raises:
        ShapeError, NotFiniteError: of other shapes, or not finite. RangeError: times do not increase from 0.
    """

    def __init__(self, times: Any, coefficients: Any) -> None:
        self.times = validation.ordinary_array("timing.times", times)
        self.coefficients = validation.ordinary_array("timing.coefficients", coefficients)
        if self.times.ndim != 1 or len(self.times) < 2:
            raise ShapeError("timing.times", times, "expected at least two numbers")
        if self.times[0] != 0.0 or (np.diff(self.times) <= 0.0).any():
            raise RangeError("timing.times", times, "times must increase strictly from 0")
        if (
            self.coefficients.ndim != 2
            or self.coefficients.shape[1] != len(self.times) - 1
            or not len(self.coefficients)
        ):
            raise ShapeError(
                "timing.coefficients", self.coefficients.shape, f"expected powers x {len(self.times) - 1} pieces"
            )

    @classmethod
    def identity(cls, duration: float, start: float = 0.0) -> Timing:
        """s = start + t."""
        return cls([0.0, duration], [[1.0], [start]])

    @classmethod
    def accelerations(cls, s: Any, speed: Any) -> Timing:
        """Constant path acceleration between coordinates s with path speeds ds/dt >= 0, at least one > 0 in each pair:
        dt = 2 ds / (speed_i + speed_i+1), and d2s/dt2 = (speed_i+1 - speed_i) / dt.

        Raises:
            ShapeError, NotFiniteError: not two vectors of one length. RangeError: s does not increase or by too little,
                or bad speeds.
        """
        positions = validation.ordinary_array("timing.s", s)
        if positions.ndim != 1 or len(positions) < 2:
            raise ShapeError("timing.s", s, "expected at least two numbers")
        speeds = validation.ordinary_array("timing.speed", speed, positions.shape)
        if (np.diff(positions) <= 0.0).any():
            raise RangeError("timing.s", s, "must increase strictly")
        mean = 0.5 * (speeds[:-1] + speeds[1:])
        if (speeds < 0.0).any() or (mean <= 0.0).any():
            raise RangeError("timing.speed", speed, "must not be negative, nor 0 at both ends of an interval")
        times = np.concatenate([[0.0], np.cumsum(np.diff(positions) / mean)])
        with np.errstate(all="ignore"):
            bends = 0.5 * np.diff(speeds) / np.diff(times)
        if not np.isfinite(bends).all():
            raise RangeError("timing.s", s, "steps are too small for these speeds")
        return cls(times, [bends, speeds[:-1], positions[:-1]])

    @property
    def duration(self) -> float:
        """[s]."""
        return float(self.times[-1])

    @property
    def degree(self) -> int:
        """Of the polynomials."""
        return int(self.coefficients.shape[0]) - 1

    def pieces_at(self, t: Array) -> Index:
        """Number of the piece that each time is in."""
        return np.clip(np.searchsorted(self.times, t, side="right") - 1, 0, len(self.times) - 2)

    def evaluate(self, t: Array, order: int = 0, piece: Index | None = None) -> Array:
        """s or a derivative of it along t, at m times; ``piece`` decides on what side of a break it is taken."""
        t = row_of("t", t)
        validation.integer("order", order, 0, 3)
        margin = self.duration
        if t.size and not (t.min() >= -margin and t.max() <= 2.0 * margin):
            raise RangeError("t", t, f"expected times of the timing, 0 to {self.duration:g} s")
        at = self.pieces_at(t) if piece is None else pieces_of(piece, t, len(self.times) - 1)
        local, out = t - self.times[at], np.zeros(len(t))
        highest = self.degree
        for k in range(highest - order + 1):
            out = out * local + float(math.perm(highest - k, order)) * self.coefficients[k, at]
        return out

    def scaled(self, factor: float) -> Timing:
        """The same course in ``factor`` times the time.

        Raises:
            RangeError: not positive, or such that the coefficients overflow.
        """
        factor = validation.scalar("factor", factor, low=0.0, open_low=True)
        powers = np.arange(self.degree, -1, -1)
        return Timing(self.times * factor, self.coefficients / factor ** powers[:, None])

    def reversed(self) -> Timing:
        """Back from the end: s(duration - t)."""
        spans = np.diff(self.times)
        moved = shifted(self.coefficients, spans)
        signs = (-1.0) ** np.arange(self.degree, -1, -1)
        times = np.concatenate([[0.0], np.cumsum(spans[::-1])])
        times[-1] = self.times[-1]
        return Timing(times, (moved * signs[:, None])[:, ::-1])

    def sliced(self, start: float, end: float) -> Timing:
        """The part between two times, from 0 on.

        Raises:
            RangeError: outside [0, duration], or no time between them.
        """
        start = validation.scalar("start", start, low=0.0, high=self.duration, unit="s")
        end = validation.scalar("end", end, low=0.0, high=self.duration, unit="s")
        if not start < end:
            raise RangeError("end", end, f"must be later than start, {start:g} s")
        first, last = (int(p) for p in self.pieces_at(np.array([start, end])))
        if last > first and self.times[last] >= end:
            last -= 1
        inner = self.times[first + 1 : last + 1]
        times = np.concatenate([[start], inner, [end]])
        shift = np.zeros(last - first + 1)
        shift[0] = start - self.times[first]
        return Timing(times - start, shifted(self.coefficients[:, first : last + 1], shift))

    def then(self, other: Timing, shift: float) -> Timing:
        """This course, then another, whose s counts from ``shift``.

        Raises:
            ShapeError, NotFiniteError, RangeError: no timing, or no shift.
        """
        validation.instance("other", other, Timing, "a Timing")
        shift = validation.scalar("shift", shift)
        degree = max(self.degree, other.degree)
        parts = []
        for timing, offset in ((self, 0.0), (other, shift)):
            c = np.zeros((degree + 1, timing.coefficients.shape[1]))
            c[degree - timing.degree :] = timing.coefficients
            c[-1] += offset
            parts.append(c)
        times = np.concatenate([self.times, self.duration + other.times[1:]])
        return Timing(times, np.concatenate(parts, axis=1))

    def hull(self) -> Array:
        """Numbers that enclose s on each piece, pieces x coefficients of Bernstein's polynomials."""
        return PolynomialPath(self.times, self.coefficients[..., None]).hull()[:, 0]

    def ranges(self, enough: Callable[[Array, Array], NDArray[np.bool_]]) -> tuple[Array, Array]:
        """Lowest and highest s of each piece, or numbers beyond them that are good ``enough``, piece by piece."""
        hull = self.hull()
        low, high = hull.min(axis=1), hull.max(axis=1)
        for i in np.flatnonzero(~enough(low, high)):
            low[i], high[i] = -bernstein.largest(-hull[i : i + 1])[0], bernstein.largest(hull[i : i + 1])[0]
        return low, high

    def crossings(self, positions: Array) -> Array:
        """Times inside pieces at which s passes one of the positions, ascending."""
        spans = np.diff(self.times)
        hull = self.hull()
        # What only touches a break is not inside; roots of straight lines are exact
        edge = 1e-12 if self.degree > 1 else 1e-15
        tolerance = edge * (1.0 + np.abs(hull).max(axis=1))
        low, high = hull.min(axis=1) + tolerance, hull.max(axis=1) - tolerance
        ordered = np.sort(positions)
        some = np.searchsorted(ordered, low) < np.searchsorted(ordered, high)
        powers = np.arange(self.degree, -1, -1)
        found = [np.zeros(0)]
        for i in np.flatnonzero(some):
            passed = ordered[(ordered > low[i]) & (ordered < high[i])]
            if self.degree == 1:
                slope, start = self.coefficients[:, i]
                found.append(self.times[i] + (passed - start) / slope)
                continue
            for place in passed:
                shifted = self.coefficients[:, i] * spans[i] ** powers
                shifted[-1] -= place
                # What a leading power adds below rounding would only spoil the roots
                shifted[np.abs(shifted) < 1e-18 * np.abs(shifted).max()] = 0.0
                roots = np.roots(shifted)
                real = roots.real[np.abs(roots.imag) < 1e-9]
                inside = real[(real > edge) & (real < 1.0 - edge)]
                found.append(self.times[i] + spans[i] * inside)
        return np.unique(np.concatenate(found))
