"""The fastest path speeds under rows that are linear in path acceleration and squared path speed: TOPP-RA.

Backwards, the interval of squared speeds from which the end can be reached is found at every point of a grid; forwards,
the largest path acceleration is taken that stays in these intervals (Pham and Pham, "A new approach to time-optimal
path parameterization based on reachability analysis", IEEE T-RO 34, 2018). toppra solves the small linear programs, in
units in which lengths, speeds and accelerations are near 1: its tolerances are absolute.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from toppra.constraint import LinearConstraint
from toppra.solverwrapper import seidelWrapper

from wbc.trajectory.least_time.rows import PathRows
from wbc.validation import Array

#: Shares by which a squared speed is lowered when rounding leaves no path acceleration
LOWERED = (0.0, 1e-12, 1e-10, 1e-8, 1e-6, 1e-4, 1e-3, 1e-2)

#: Intervals in the program's units are no shorter: toppra takes 2 u of a shorter one for none
SHORTEST = 1e-8

#: Squared speeds in the program's units that are not bounded otherwise
LARGEST = 1e8


class _ToppraPath:
    """What toppra asks of a path when the coefficients are ready made."""

    path_interval = (0.0, 1.0)
    dof = 0


class _Coefficients(LinearConstraint):  # type: ignore[misc]  # toppra has no types
    """Coefficients that are ready made, in the order that toppra wants: a, b, c, F, g, bounds of u, bounds of x."""

    def __init__(self, parameters: tuple[Any, ...]) -> None:
        super().__init__()
        self.identical = True
        self._parameters = parameters

    def compute_constraint_params(self, path: Any, gridpoints: Any, *args: Any, **more: Any) -> tuple[Any, ...]:
        return self._parameters


@dataclass(frozen=True, eq=False)
class PathSpeeds:
    """Path speeds at the points of a grid, or None with the speeds from which the end could be reached.

    Attributes:
        speed: N + 1, None where there are none.
        start: lowest and highest speed at the beginning from which the end can be reached, None if from nowhere.
    """

    speed: Array | None
    start: tuple[float, float] | None


class SpeedProgram:
    """The linear programs of one grid.

    Args:
        s: N + 1 points, increasing. rows: limits at both ends of the N intervals.
        squared: upper bounds of the squared path speed at the N + 1 points, inf where there is none.
    """

    def __init__(self, s: Array, rows: Sequence[PathRows], squared: Array) -> None:
        self.length = float(s[-1] - s[0])
        spans = np.diff(s) / self.length
        self.count = len(s) - 1
        # Of a shorter one u is that much less
        self.spans = np.maximum(spans, SHORTEST)
        self._given = (s, rows, squared)
        self.unit = _unit_of_time(rows, squared, np.diff(s))
        scale = self.length / self.unit**2
        longer = self.spans / spans
        constraints = [_Coefficients(_parameters(r, spans, longer, scale, self.length)) for r in rows]
        bounds = np.zeros((self.count + 1, 2))
        bounds[:, 1] = np.minimum(squared * (self.unit / self.length) ** 2, LARGEST)
        self.bounds = bounds
        constraints.append(_Coefficients((None, None, None, None, None, None, bounds)))
        self._solver = seidelWrapper(constraints, _ToppraPath(), np.append(0.0, np.cumsum(self.spans)), 1)
        self._up, self._down = np.array([1e-9, -1.0]), np.array([-1e-9, 1.0])

    def fastest(self, start: float = 0.0, end: float = 0.0) -> PathSpeeds:
        """The largest path speeds between given ones at the ends."""
        factor = self.unit / self.length
        first, last = (start * factor) ** 2, (end * factor) ** 2
        low, high = self._backwards(last)
        if np.isnan(high[0]):
            return PathSpeeds(None, None)
        reach = float(np.sqrt(low[0])) / factor, float(np.sqrt(high[0])) / factor
        tolerance = 1e-9 * (1.0 + first)
        if not low[0] - tolerance <= first <= high[0] + tolerance:
            return PathSpeeds(None, reach)
        squared = self._forwards(min(max(first, low[0]), high[0]), low, high)
        if squared is None:
            return PathSpeeds(None, reach)
        speed = np.sqrt(squared) / factor
        speed[0], speed[-1] = start, end
        return PathSpeeds(speed, reach)

    def reversed(self) -> SpeedProgram:
        """The same path from its end to its beginning."""
        s, rows, squared = self._given
        back = [PathRows(-r.a[::-1, ::-1], r.b[::-1, ::-1], r.c[::-1, ::-1], r.both) for r in rows]
        return SpeedProgram(-s[::-1], back, squared[::-1])

    def _backwards(self, last: float) -> tuple[Array, Array]:
        """Lowest and highest squared speeds from which the end can be reached; NaN at the beginning if from nowhere."""
        solve = self._solver.solve_stagewise_optim
        low, high = np.zeros(self.count + 1), np.full(self.count + 1, np.nan)
        low[-1] = high[-1] = last
        if last > self.bounds[-1, 1] * (1.0 + 1e-9):
            return low, high
        for i in range(self.count - 1, -1, -1):
            top = solve(i, None, self._up, np.nan, np.nan, low[i + 1], high[i + 1])[1]
            if np.isnan(top):
                return low, high
            high[i] = min(max(top, 0.0), self.bounds[i, 1])
            if low[i + 1] > 0.0:
                bottom = solve(i, None, self._down, np.nan, np.nan, low[i + 1], high[i + 1])[1]
                low[i] = min(max(bottom, 0.0), high[i])
        return low, high

    def _forwards(self, first: float, low: Array, high: Array) -> Array | None:
        """Squared speeds from a first one on, None where rounding left none."""
        solve = self._solver.solve_stagewise_optim
        out = np.zeros(self.count + 1)
        out[0] = first
        for i, span in enumerate(self.spans.tolist()):
            aim = np.array([-2.0 * span, -1.0])
            for share in LOWERED:
                x = out[i] * (1.0 - share)
                u = solve(i, None, aim, x, x, low[i + 1], high[i + 1])[0]
                if not np.isnan(u):
                    break
            else:
                return None
            out[i] = x
            out[i + 1] = min(max(x + 2.0 * span * u, low[i + 1]), high[i + 1])
        return out


def _parameters(rows: PathRows, spans: Array, longer: Array, scale: float, length: float) -> tuple[Any, ...]:
    """Rows at both ends of each interval in terms of u and of x at its beginning, in units of length and time, on
    intervals that are so many times as long as ``spans``.

    Each row is divided by its largest factor, because the tolerances of the linear programs are absolute.
    """
    count, _, size = rows.a.shape
    right = rows.a[:, 1] + 2.0 * (spans * length)[:, None] * rows.b[:, 1]
    a = np.concatenate([rows.a[:, 0], right], axis=1) * scale * longer[:, None]
    b = rows.b.reshape(count, 2 * size) * (scale * length)
    c = rows.c.reshape(count, 2 * size) - 1.0
    if rows.both:
        a, b, c = (np.concatenate([part, sign * part], axis=1) for part, sign in ((a, -1.0), (b, -1.0), (c, 1.0)))
    largest = np.maximum(np.maximum(np.abs(a), np.abs(b)), 1e-9)
    parts = [np.concatenate([part, part[-1:]]) for part in (a / largest, b / largest, c / largest)]
    width = a.shape[1]
    return (*parts, np.eye(width), np.zeros(width), None, None)


def _unit_of_time(rows: Sequence[PathRows], squared: Array, spans: Array) -> float:
    """About the time that the path takes."""
    length = float(spans.sum())
    slopes = max((float(np.abs(r.a).max(initial=0.0)) * length for r in rows), default=0.0)
    curvatures = [float((np.sqrt(np.abs(r.b).max(axis=(1, 2), initial=0.0)) * spans).sum()) for r in rows]
    quick = float(np.sqrt(slopes)) + max(curvatures, default=0.0)
    speeds = np.sqrt(np.minimum(squared[:-1], squared[1:]))
    slow = float((spans / speeds).sum())
    if quick == 0.0:
        return slow or 1.0
    return float(np.sqrt(quick * slow)) if slow > quick else quick
