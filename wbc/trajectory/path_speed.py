"""The fastest speed along a path under limits of velocity, acceleration and jerk, by a sequence of linear programs.

With x = (ds/dt)^2 and y = d2s/dt2 over the path coordinate s, dx/ds = 2 y, and

    dq/dt = q' sqrt(x),    d2q/dt2 = q'' x + q' y,    d3q/dt3 = sqrt(x) (q''' x + 3 q'' y + q' dy/ds)

Velocities and accelerations bound x and y linearly. The jerk's limit J / sqrt(x) is convex in x, so its tangent at any
speed lies below it: what keeps the tangent keeps the limit, and the tangent at the last solution gives room for a
faster one. y is linear in s between grid points, so x is quadratic there; the cells at both ends, from and to rest, have
constant jerk instead: x = 3/2 s y.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from wbc.errors import InfeasibleError
from wbc.trajectory.certificate import chain
from wbc.trajectory.course import rest_to_rest
from wbc.trajectory.path import Path
from wbc.trajectory.timing import Timing
from wbc.validation import Array

#: Programs are solved until one gains less than this share of the duration, and no more than so many
GAIN, ROUNDS = 1e-3, 25

#: x of a program is no lower than this share of the last one's, so that the next one has a tangent
LOWEST = 1e-4

#: Places of a cell at which derivatives are looked at
PLACES = np.array([0.0, 0.25, 0.5, 0.75, 1.0])


@dataclass(frozen=True, eq=False)
class Stretch:
    """A smooth part of a path between two places at which it is at rest, on a grid.

    Attributes:
        s: grid, knots of the path in it. piece: of the path, by cell. limits: velocity, acceleration, jerk, n each.
    """

    path: Path
    s: Array
    limits: tuple[Array, Array, Array]

    @classmethod
    def of(cls, path: Path, start: float, end: float, limits: tuple[Array, Array, Array], cells: int) -> Stretch:
        """Places s = start + L (10 u^3 - 15 u^4 + 6 u^5): even in time where the jerk is constant at the ends."""
        u = np.linspace(0.0, 1.0, cells + 1)
        s = start + (end - start) * u**3 * (10.0 - 15.0 * u + 6.0 * u * u)
        knots = path.knots[(path.knots > start) & (path.knots < end)]
        if knots.size:
            # A grid point that stands beside a knot gives way to it
            room = 0.4 * np.interp(s, 0.5 * (s[1:] + s[:-1]), np.diff(s))
            near = np.searchsorted(knots, s)
            before = np.abs(s - knots[np.maximum(near - 1, 0)])
            after = np.abs(knots[np.minimum(near, len(knots) - 1)] - s)
            keep = np.minimum(before, after) > room
            keep[[0, -1]] = True
            s = np.union1d(s[keep], knots)
        return cls(path, s, limits)

    def derivatives(self, place: float) -> tuple[Array, Array, Array]:
        """q', q'', q''' at a place in [0, 1] of every cell: cells x n."""
        s = self.s[:-1] + place * np.diff(self.s)
        piece = self.path.pieces_at(0.5 * (self.s[1:] + self.s[:-1]))
        first, second, third = (self.path.evaluate(s, order, piece) for order in (1, 2, 3))
        return first, second, third

    def constant(self) -> tuple[float, float, float]:
        """Speed, acceleration and jerk of s that no joint minds anywhere: half of each limit for the curvature."""
        v, a, j = self.limits
        first, second, third = (
            np.max([np.abs(part).max(axis=0) for part in parts], axis=0)
            for parts in zip(*(self.derivatives(u) for u in PLACES), strict=True)
        )
        with np.errstate(divide="ignore"):
            speed = min(
                float(np.min(v / first)),
                float(np.min(np.sqrt(0.5 * a / second))),
                float(np.min(np.cbrt(j / (4.0 * third)))),
            )
            push = min(float(np.min(0.5 * a / first)), float(np.min(j / (12.0 * second * speed))))
            jerk = float(np.min(0.5 * j / first))
        if not 0.0 < speed < np.inf or not np.isfinite([push, jerk]).all():
            raise InfeasibleError("path", float(self.s[0]), "nothing moves between this coordinate and the next stop")
        return speed, push, jerk


def fastest(stretch: Stretch) -> Timing:
    """The timing from rest to rest, its violations of a few percent not yet taken away.

    Raises:
        InfeasibleError: the solver of the linear programs gave up.
    """
    s = stretch.s
    x, shares = _first(stretch), np.ones((3, len(s) - 1))
    best, least = None, np.inf
    for _ in range(ROUNDS):
        x, y = _program(stretch, x, shares)
        timing = _timing(s, x, y)
        ratios = _ratios(stretch, timing)
        loss = max(1.0, *(float(r.max()) ** (1.0 / order) for order, r in enumerate(ratios, 1)))
        # Cells in which more is used between the places that the program looks at are given less
        shares *= np.clip(0.9999 / ratios, 0.8, 1.0)
        gained = 1.0 - timing.duration * loss / least
        if gained > 0.0:
            best, least = timing, timing.duration * loss
        if best is not None and abs(gained) < GAIN:
            break
    assert best is not None
    return best


def _first(stretch: Stretch) -> Array:
    """x of the course from rest to rest under constant limits."""
    s = stretch.s - stretch.s[0]
    course = rest_to_rest(float(s[-1]), *stretch.constant())
    points = np.array(course.points())
    places, speeds = [], []
    for point, jerk, span in zip(points[:-1], course.jerks, course.spans, strict=True):
        t = np.linspace(0.0, span, 60)
        places.append(point[0] + t * (point[1] + t * (0.5 * point[2] + t * jerk / 6.0)))
        speeds.append(point[1] + t * (point[2] + 0.5 * jerk * t))
    x = np.interp(s, np.concatenate(places), np.concatenate(speeds)) ** 2
    # Interpolated beside rest, it would be far too low
    least = 1e-3 * x.max() * (np.minimum(s, s[-1] - s) / s[-1]) ** (4.0 / 3.0)
    return np.asarray(np.maximum(x, least))


def _program(stretch: Stretch, x0: Array, shares: Array) -> tuple[Array, Array]:
    """x and y that maximise sum h x / x0^(3/2), the gain of time, under the limits linearised at x0.

    Unknowns are x / x0 and y over what it is where the jerk is constant, at inner grid points.
    """
    import scipy.optimize
    import scipy.sparse as sparse

    h, count = np.diff(stretch.s), len(stretch.s) - 2
    size_x = x0[1:-1]
    size_y = size_x / np.minimum(stretch.s[1:-1] - stretch.s[0], stretch.s[-1] - stretch.s[1:-1])

    def matrix(of_x: Array, of_y: Array, first: Any) -> Any:
        """A row for each of ``first``: coefficients of the x and of the y of that grid point and those behind it."""
        rows, width = of_x.shape
        nodes = first[:, None] + np.arange(width)
        place = (np.repeat(np.arange(rows), width), nodes.ravel())
        parts = [(c * size[nodes]).ravel() for c, size in ((of_x, size_x), (of_y, size_y))]
        return sparse.hstack([sparse.csr_matrix((part, place), (rows, count)) for part in parts], format="csr")

    every, ends = np.arange(count), np.array([0, count - 1])
    pushes = [matrix(*rows, every) for rows in _accelerations(stretch, shares[1])]
    jerks = [matrix(*rows, every[:-1]) for rows in _jerks(stretch, x0, shares[2])]
    upper = sparse.vstack([*pushes, *(-rows for rows in pushes), *jerks])
    tops = [np.ones(2 * len(pushes) * count), np.full(len(jerks) * (count - 1), 1.5)]
    # dx/ds = 2 y within, x = 3/2 s y at both ends
    inside, unit = h[1:-1, None], 1.0 / size_x[:-1, None]
    within = matrix(np.array([[-1.0, 1.0]]) * unit, -np.array([[1.0, 1.0]]) * inside * unit, every[:-1])
    unit = 1.0 / size_x[ends, None]
    at_ends = matrix(unit, np.array([[-1.5 * h[0]], [1.5 * h[-1]]]) * unit, ends)
    top = np.maximum(_speeds(stretch, shares) / size_x, 2.0 * LOWEST)
    free = np.full(count, np.inf)
    gain = 0.5 * (h[1:] + h[:-1]) / np.sqrt(size_x)
    answer = scipy.optimize.linprog(
        np.concatenate([-gain / gain.max(), np.zeros(count)]),
        A_ub=upper,
        b_ub=np.concatenate(tops),
        A_eq=sparse.vstack([within, at_ends]),
        b_eq=np.zeros(count + 1),
        bounds=np.stack([np.append(np.full(count, LOWEST), -free), np.append(top, free)], axis=1),
        method="highs-ipm",
    )
    if answer.x is None:
        raise InfeasibleError("path", float(stretch.s[0]), f"no speed was found from here on: {answer.message}")
    zero = np.zeros(1)
    x, y = answer.x[:count] * size_x, answer.x[count:] * size_y
    return np.concatenate([zero, x, zero]), np.concatenate([zero, y, zero])


def _accelerations(stretch: Stretch, shares: Array) -> list[tuple[Array, Array]]:
    """(coefficients of x, of y) at every inner grid point, by joint; at most 1 in size."""
    share = np.minimum(shares[1:], shares[:-1])
    first, second, _ = (part[1:] for part in stretch.derivatives(0.0))
    rows = []
    for i, limit in enumerate(stretch.limits[1]):
        scale = (limit * share)[:, None]
        rows.append((second[:, i, None] / scale, first[:, i, None] / scale))
    return rows


def _jerks(stretch: Stretch, x0: Array, shares: Array) -> list[tuple[Array, Array]]:
    """(coefficients of x, of y) of both ends of every inner cell, by joint and sign; at most 3/2.

    In the middle of a cell x = (x0 + x1)/2 + h (y0 - y1)/8; over its limit J / sqrt(x), linearised at X, the jerk is

        sqrt(X)/J |q''' x + 3 q'' y + q' dy/ds| + x/(2 X) <= 3/2
    """
    h = np.diff(stretch.s)[1:-1]
    first, second, third = (part[1:-1] for part in stretch.derivatives(0.5))
    before = 0.5 * (x0[1:-2] + x0[2:-1])
    half = np.full((len(h), 2), 0.5)
    lever = np.stack([h / 8.0, -h / 8.0], axis=1)
    slope = np.stack([-1.0 / h, 1.0 / h], axis=1)
    tangent = 0.5 / before[:, None]
    rows = []
    for i, limit in enumerate(stretch.limits[2]):
        unit = (np.sqrt(before) / (limit * shares[1:-1]))[:, None]
        of_x = third[:, i, None] * half * unit
        of_y = (third[:, i, None] * lever + 3.0 * second[:, i, None] * half + first[:, i, None] * slope) * unit
        for sign in (1.0, -1.0):
            rows.append((sign * of_x + tangent * half, sign * of_y + tangent * lever))
    return rows


def _speeds(stretch: Stretch, shares: Array) -> Array:
    """Largest x at inner grid points: by the velocities, and by the jerk of the cells at both ends."""
    v, _, j = stretch.limits
    h = np.diff(stretch.s)
    at, end = stretch.derivatives(0.0)[0], stretch.derivatives(1.0)[0][-1]
    share = np.minimum(shares[0, 1:], shares[0, :-1])
    with np.errstate(divide="ignore"):
        top = np.min((v / np.abs(at[1:])) ** 2, axis=1) * share**2
        for place, q in ((0, at[0]), (-1, end)):
            # x = 3/2 h y with y^3 = 6 h jerk^2
            jerk = float(np.min(j / np.abs(q))) * shares[2, place]
            top[place] = min(top[place], 1.5 * h[place] * np.cbrt(6.0 * h[place] * jerk * jerk))
    return np.asarray(top)


def _timing(s: Array, x: Array, y: Array) -> Timing:
    """Quintics in time between grid points, with the s, ds/dt and d2s/dt2 of both."""
    h = np.diff(s)
    nodes, weights = np.polynomial.legendre.leggauss(10)
    u = 0.5 * (nodes + 1.0)
    # Time over a cell: the integral of ds / sqrt(x); at rest at one end: 3 h / speed
    inner = x[:-1, None] + 2.0 * h[:, None] * u * (y[:-1, None] + 0.5 * u * np.diff(y)[:, None])
    span = np.empty(len(h))
    span[1:-1] = (h[:, None] * 0.5 * weights / np.sqrt(np.maximum(inner, 1e-300)))[1:-1].sum(axis=1)
    span[[0, -1]] = 3.0 * h[[0, -1]] / np.sqrt(x[[1, -2]])
    v = np.sqrt(x)
    p0, v0, a0, v1, a1 = 0.0, v[:-1] * span, y[:-1] * span**2, v[1:] * span, y[1:] * span**2
    way = h - p0
    c3 = 10.0 * way - 6.0 * v0 - 4.0 * v1 - 1.5 * a0 + 0.5 * a1
    c4 = -15.0 * way + 8.0 * v0 + 7.0 * v1 + 1.5 * a0 - a1
    c5 = 6.0 * way - 3.0 * (v0 + v1) - 0.5 * (a0 - a1)
    rows = [c5 / span**5, c4 / span**4, c3 / span**3, 0.5 * y[:-1], v[:-1], s[:-1]]
    return Timing(np.concatenate([[0.0], np.cumsum(span)]), rows)


def _ratios(stretch: Stretch, timing: Timing) -> Array:
    """The largest shares of the limits of velocity, acceleration and jerk that are used: 3 x cells."""
    span = np.diff(timing.times)
    cell = np.repeat(np.arange(len(span)), len(PLACES))
    t = (timing.times[:-1, None] + span[:, None] * PLACES).ravel()
    s = [timing.evaluate(t, order, cell) for order in range(4)]
    s[0] = np.clip(s[0], stretch.s[cell], stretch.s[cell + 1])
    piece = stretch.path.pieces_at(0.5 * (stretch.s[cell] + stretch.s[cell + 1]))
    out = []
    for order, limit in enumerate(stretch.limits, 1):
        used = (np.abs(chain(stretch.path, s, piece, order)) / limit).max(axis=1)
        out.append(np.maximum(used.reshape(len(span), -1).max(axis=1), 1e-9))
    return np.array(out)
