"""A path from a function of one's own: the spline that is followed instead, and how far from the function it is."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import ContinuityError, NotFiniteError, RangeError, ShapeError
from wbc.trajectory.paths.path import PolynomialPath
from wbc.trajectory.paths.waypoints import SMALLEST, distance
from wbc.validation import Array

#: Intervals of the first spline
FIRST = 16

#: Where the spline is compared with the function, within each interval: the middle, which is a sample of the next
#: spline, and two that no halving comes to, since a function may repeat itself with the samples
PLACES = (0.25 * (5.0**0.5 - 1.0), 0.5, 0.25 * (5.0 - 5.0**0.5))

#: Largest change of q' from one spline to the next, as a share of the largest |q'|
SETTLED = 1e-3


class FunctionPath(PolynomialPath):
    """A spline of degree 5 through samples of a function, over the s of :func:`function_path`.

    Attributes:
        start, end: what the function was asked for at both ends of the path.
        deviation: largest distance between path and function between the samples [rad or m].
        intervals: between the samples.
    """

    def __init__(
        self, knots: Array, coefficients: Array, ends: tuple[float, float], deviation: float, intervals: int
    ) -> None:
        super().__init__(knots, coefficients)
        self.start, self.end = ends
        self.deviation, self.intervals = deviation, intervals

    def argument(self, s: Any) -> Array:
        """What the function is asked for at coordinates s: start + (end - start) s / length."""
        given = validation.ordinary_array("s", s)
        return np.asarray(self.start + (self.end - self.start) * ((given - self.knots[0]) / self.length))


def function_path(
    function: Callable[[float], Any], start: float, end: float, tolerance: float = 1e-6, intervals: int = 8192
) -> FunctionPath:
    """The spline of degree 5 (C4) through samples of q(x), x from start to end, halved until it is near enough:

        |path - function| <= tolerance        at three points within each interval, none of them a sample

    and until q' has settled: it changes by at most 1e-3 of its largest value from one spline to the next. s runs from
    0 to the length of the curve, in proportion to x. Limits hold and are certified for the path, which is what moves;
    how far it is from the function is its ``deviation``.

    Args:
        function: x -> n numbers [rad or m].
        start, end: start < end.
        tolerance: largest distance, square root of the sum of squares over joints [rad or m].
        intervals: not more than these, at least 16.

    Raises:
        ShapeError: no function; not n numbers at every x. NotFiniteError: NaN or infinity, with the x where.
        RangeError: start, end, tolerance or intervals out of range.
        ContinuityError: the spline does not come near enough (a step, a corner, a root), with where it is farthest.

    A function that does not change gives a path that stands, over s in [0, 1]. Cannot do: find what lies between all
    samples and all points of comparison. Where q'' jumps, the path has a continuous q'' that oscillates on both sides.
    """
    if not callable(function):
        raise ShapeError("path.function", function, "expected a function of one number")
    low = validation.scalar("path.start", start)
    high = validation.scalar("path.end", end)
    if not low < high or not np.isfinite(high - low):
        raise RangeError("path.end", end, f"must be larger than start, {low:g}")
    tolerance = validation.scalar("path.tolerance", tolerance, low=0.0, open_low=True, unit="rad or m")
    most = int(validation.scalar("path.intervals", intervals, low=FIRST))
    return _halved(_FunctionSamples(function, low, high), tolerance, most)


class _FunctionSamples:
    """Values of a function at shares u in [0, 1] of its range, checked, and asked for once."""

    def __init__(self, function: Callable[[float], Any], low: float, high: float) -> None:
        self.function, self.low, self.high = function, low, high
        self._known: dict[float, Array] = {}
        self._shape: tuple[int, ...] | None = None

    def argument(self, u: float) -> float:
        return self.low + (self.high - self.low) * u if u < 1.0 else self.high

    def at(self, shares: Array) -> Array:
        return np.array([self._one(u) for u in shares.tolist()])

    def _one(self, u: float) -> Array:
        if u not in self._known:
            x = self.argument(u)
            field = f"path.function({x:.6g})"
            value = self.function(x)
            numbers = validation.ordinary_array(field, value, self._shape, finite=False)
            if numbers.ndim != 1 or not len(numbers):
                raise ShapeError(field, value, "expected one number for each joint")
            if not np.isfinite(numbers).all():
                raise NotFiniteError(field, value, "expected finite numbers")
            self._shape = numbers.shape
            self._known[u] = numbers
        return self._known[u]


def _halved(samples: _FunctionSamples, tolerance: float, most: int) -> FunctionPath:
    count, before, off, where = FIRST, None, np.inf, samples.low
    while count <= most:
        nodes = np.arange(count + 1) / count
        values = samples.at(nodes)
        between = ((np.arange(count)[:, None] + np.array(PLACES)) / count).ravel()
        expected = samples.at(between)
        length = sum(distance(a, b) for a, b in pairwise(values))
        none = max(SMALLEST, 8.0 * float(np.finfo(float).eps) * float(np.abs(values).max()))
        if max(float(np.abs(part - values[0]).max()) for part in (values, expected)) <= none:
            ends = (samples.low, samples.high)
            return FunctionPath(np.array([0.0, 1.0]), values[:1, None, :], ends, 0.0, count)
        spline = _spline(nodes, values)
        distances = np.linalg.norm(spline.evaluate(between) - expected, axis=1)
        off, where = float(distances.max()), samples.argument(float(between[int(distances.argmax())]))
        slope = spline.evaluate(nodes, 1)
        if off <= tolerance and before is not None:
            change = np.linalg.norm(slope - before.evaluate(nodes, 1), axis=1)
            where = samples.argument(float(nodes[int(change.argmax())]))
            if change.max() <= SETTLED * float(np.linalg.norm(slope, axis=1).max()):
                return _over_length(spline, length, (samples.low, samples.high), off, count)
        before, count = spline, 2 * count
    raise ContinuityError(
        "path.function",
        where,
        f"not smooth enough near here: with {count // 2} intervals, "
        + (f"off by {off:.3g}, allowed {tolerance:.3g}" if off > tolerance else "the derivative does not settle"),
    )


def _spline(nodes: Array, values: Array) -> PolynomialPath:
    from scipy.interpolate import make_interp_spline

    # Differences from the first value keep the digits of small moves far from zero
    spline = make_interp_spline(nodes, values - values[0], k=5)
    knots = np.unique(spline.t)
    coefficients = np.array([spline(knots[:-1], power) / math.factorial(power) for power in range(5, -1, -1)])
    coefficients[-1] += values[0]
    return PolynomialPath(knots, coefficients)


def _over_length(
    spline: PolynomialPath, length: float, ends: tuple[float, float], off: float, count: int
) -> FunctionPath:
    """The same over s = length times the share."""
    powers = np.arange(spline.coefficients.shape[0] - 1, -1, -1)
    coefficients = spline.coefficients / length ** powers[:, None, None]
    return FunctionPath(spline.knots * length, coefficients, ends, off, count)
