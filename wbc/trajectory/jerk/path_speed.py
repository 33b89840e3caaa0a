"""The fastest speed along a path under limits of velocity, acceleration and jerk, by a sequence of linear programs.

With x = (ds/dt)^2 and y = d2s/dt2 over the path coordinate s, dx/ds = 2 y, and

    dq/dt = q' sqrt(x),    d2q/dt2 = q'' x + q' y,    d3q/dt3 = sqrt(x) (q''' x + 3 q'' y + q' dy/ds)

Velocities and accelerations bound x and y linearly. The jerk's limit J / sqrt(x) is convex in x, so its tangent at any
speed lies below it: what satisfies the tangent satisfies the limit, and the tangent at the last solution leaves a
margin for a faster one. Between grid points y is linear in u, where s = start + L g(u): beside rest s goes with u^3
and constant jerk makes y go with u. So dx/du = 2 y L g'(u) is integrated exactly.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from wbc.errors import InfeasibleError
from wbc.trajectory.jerk.course import moved, rest_to_rest
from wbc.trajectory.laws.certificate import chain
from wbc.trajectory.laws.timing import Timing
from wbc.trajectory.paths.path import Path
from wbc.validation import Array

#: Programs are solved until so many in a row gain less than this share of the duration, and no more than so many
PATIENCE, GAIN, ROUNDS = 3, 5e-4, 20

#: x of a program is no lower than this share of the last one's, so that the next one has a tangent
LOWEST = 1e-4

#: Places of a cell at which derivatives are looked at
PLACES = np.array([0.0, 0.25, 0.5, 0.75, 1.0])


@dataclass(frozen=True, eq=False)
class Stretch:
    """A smooth part of a path between two points at which it is at rest, on a grid.

    Attributes:
        u: grid in [0, 1]; s: its path coordinates, knots of the path among them. limits: velocity, acceleration, jerk.
    """

    path: Path
    u: Array
    s: Array
    limits: tuple[Array, Array, Array]

    @classmethod
    def of(cls, path: Path, start: float, end: float, limits: tuple[Array, Array, Array], cells: int) -> Stretch:
        """Even in u, but that grid points beside knots are left out."""
        u = np.linspace(0.0, 1.0, cells + 1)
        s = start + (end - start) * _grade(u)
        knots = path.knots[(path.knots > start) & (path.knots < end)]
        if knots.size:
            fine = np.linspace(0.0, 1.0, 20 * cells + 1)
            at = np.interp((knots - start) / (end - start), _grade(fine), fine)
            for _ in range(3):
                at = np.clip(at - (_grade(at) - (knots - start) / (end - start)) / _slope(at), 0.0, 1.0)
            near = np.searchsorted(at, u)
            away = np.minimum(np.abs(u - at[np.maximum(near - 1, 0)]), np.abs(at[np.minimum(near, len(at) - 1)] - u))
            keep = away > 0.4 / cells
            keep[[0, -1]] = True
            order = np.argsort(np.concatenate([u[keep], at]))
            u, s = (np.concatenate(pair)[order] for pair in ((u[keep], at), (s[keep], knots)))
        s[[0, -1]] = start, end
        return cls(path, u, s, limits)

    def coordinates(self, place: float) -> Array:
        """Coordinates at a place in [0, 1] of every cell."""
        if place in (0.0, 1.0):
            return self.s[int(place) :][: len(self.s) - 1]
        inside = self.s[0] + (self.s[-1] - self.s[0]) * _grade(self.u[:-1] + place * np.diff(self.u))
        return np.asarray(np.clip(inside, self.s[:-1], self.s[1:]))

    def derivatives(self, place: float) -> tuple[Array, Array, Array]:
        """q', q'', q''' there: cells x n."""
        piece = self.path.pieces_at(0.5 * (self.s[1:] + self.s[:-1]))
        first, second, third = (self.path.evaluate(self.coordinates(place), order, piece) for order in (1, 2, 3))
        return first, second, third

    def gained(self, place: float) -> Array:
        """(w0, w1) by cell with x(place) = x0 + w0 y0 + w1 y1."""
        nodes, weights = np.polynomial.legendre.leggauss(6)
        share = 0.5 * place * (nodes + 1.0)
        span = np.diff(self.u)[:, None]
        part = (self.s[-1] - self.s[0]) * _slope(self.u[:-1, None] + span * share) * span * place * weights
        return np.stack([part @ (1.0 - share), part @ share], axis=1)

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


def _grade(u: Array) -> Array:
    return np.asarray(u**3 * (10.0 - 15.0 * u + 6.0 * u * u))


def _slope(u: Array) -> Array:
    return np.asarray(30.0 * (u * (1.0 - u)) ** 2)


def fastest(stretch: Stretch) -> Timing:
    """The timing from rest to rest, its violations of a few percent not yet taken away.

    Raises:
        InfeasibleError: the solver of the linear programs gave up.
    """
    x, y = _first(stretch)
    shares = np.ones((3, len(x) - 1))
    best, least, idle = None, np.inf, 0
    for _ in range(ROUNDS):
        x, y = _program(stretch, x, y, shares)
        timing = _timing(stretch, x, y)
        ratios = _ratios(stretch, timing)
        loss = max(1.0, *(float(r.max()) ** (1.0 / order) for order, r in enumerate(ratios, 1)))
        # Cells in which more is used between the points that the program looks at are given less
        shares = np.minimum(shares * np.clip(0.9999 / ratios, 0.8, 1.01), 1.0)
        gained = 1.0 - timing.duration * loss / least
        if gained > 0.0:
            best, least = timing, timing.duration * loss
        idle = idle + 1 if gained < GAIN else 0
        if idle == PATIENCE:
            break
    assert best is not None
    return best


def _first(stretch: Stretch) -> tuple[Array, Array]:
    """x and y of the course from rest to rest under constant limits."""
    s = stretch.s - stretch.s[0]
    course = rest_to_rest(float(s[-1]), *stretch.constant())
    rows = []
    for point, jerk, span in zip(course.points(), course.jerks, course.spans, strict=False):
        rows += [moved(point, jerk, t) for t in np.linspace(0.0, span, 200)]
    at, speeds, pushes = np.array(rows).T
    # Beside rest an interpolated speed is far too low
    near = np.minimum(s, s[-1] - s)
    x = np.interp(s, at, speeds) ** 2
    least = 0.5 * x.max() * (near / s[-1]) ** (4.0 / 3.0)
    low = x < least
    return np.where(low, least, x), np.where(low, 0.0, np.interp(s, at, pushes))


def _program(stretch: Stretch, x0: Array, y0: Array, shares: Array) -> tuple[Array, Array]:
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
    jerks = [matrix(*rows, every[:-1]) for rows in _jerks(stretch, x0, y0, shares[2])]
    # The square of the speed in the middle of cells, over its limit
    lever = stretch.gained(0.5)[1:-1]
    with np.errstate(divide="ignore"):
        most = (np.min(stretch.limits[0] / np.abs(stretch.derivatives(0.5)[0]), axis=1) * shares[0])[1:-1, None] ** 2
    middles = matrix(np.array([[1.0, 0.0]]) / most, lever / most, every[:-1])
    upper = sparse.vstack([*pushes, *(-rows for rows in pushes), middles, *jerks])
    tops = [np.ones(2 * len(pushes) * count + count - 1), np.full(len(jerks) * (count - 1), 1.5)]
    w = stretch.gained(1.0)
    unit = 1.0 / size_x[:-1, None]
    within = matrix(np.array([[-1.0, 1.0]]) * unit, -w[1:-1] * unit, every[:-1])
    unit = 1.0 / size_x[ends, None]
    at_ends = matrix(unit, np.array([[-w[0, 1]], [w[-1, 0]]]) * unit, ends)
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
    x, y = np.split(answer.x, 2)
    return np.concatenate([zero, x * size_x, zero]), np.concatenate([zero, y * size_y, zero])


def _accelerations(stretch: Stretch, shares: Array) -> list[tuple[Array, Array]]:
    """(coefficients of x, of y) at every inner grid point, by joint; at most 1 in size."""
    share = np.minimum(shares[1:], shares[:-1])
    first, second, _ = (part[1:] for part in stretch.derivatives(0.0))
    rows = []
    for i, limit in enumerate(stretch.limits[1]):
        scale = (limit * share)[:, None]
        rows.append((second[:, i, None] / scale, first[:, i, None] / scale))
    return rows


def _jerks(stretch: Stretch, x0: Array, y0: Array, shares: Array) -> list[tuple[Array, Array]]:
    """(coefficients of x, of y) of both ends of every inner cell, by joint and sign; at most 3/2.

    In the middle of a cell x = x0 + w0 y0 + w1 y1; over its limit J / sqrt(x), linearised at X, the jerk is

        sqrt(X)/J |q''' x + 3 q'' y + q' dy/ds| + x/(2 X) <= 3/2
    """
    cells = np.diff(stretch.u)
    first, second, third = (part[1:-1] for part in stretch.derivatives(0.5))
    lever = stretch.gained(0.5)[1:-1]
    whole = np.tile([1.0, 0.0], (len(lever), 1))
    before = np.maximum(x0[1:-2] + (lever * np.stack([y0[1:-2], y0[2:-1]], axis=1)).sum(axis=1), 1e-3 * x0[1:-2])
    half = np.full((len(lever), 2), 0.5)
    steep = _slope(stretch.u[:-1] + 0.5 * cells) * (stretch.s[-1] - stretch.s[0]) * cells
    slope = np.array([-1.0, 1.0]) / steep[1:-1, None]
    tangent = 0.5 / before[:, None]
    rows = []
    for i, limit in enumerate(stretch.limits[2]):
        unit = (np.sqrt(before) / (limit * shares[1:-1]))[:, None]
        of_x = third[:, i, None] * whole * unit
        of_y = (third[:, i, None] * lever + 3.0 * second[:, i, None] * half + first[:, i, None] * slope) * unit
        for sign in (1.0, -1.0):
            rows.append((sign * of_x + tangent * whole, sign * of_y + tangent * lever))
    return rows


def _speeds(stretch: Stretch, shares: Array) -> Array:
    """Largest x at inner grid points: by the velocities, and by the jerk of the cells at both ends."""
    v, _, j = stretch.limits
    at, end = stretch.derivatives(0.0)[0], stretch.derivatives(1.0)[0][-1]
    share = np.minimum(shares[0, 1:], shares[0, :-1])
    with np.errstate(divide="ignore"):
        top = np.min((v / np.abs(at[1:])) ** 2, axis=1) * share**2
        for place, q in ((0, at[0]), (-1, end)):
            # x = 3/2 h y with y^3 = 6 h jerk^2
            h = abs(float(stretch.s[place] - stretch.s[1 if place == 0 else -2]))
            jerk = float(np.min(j / np.abs(q))) * shares[2, place]
            top[place] = min(top[place], 1.5 * h * np.cbrt(6.0 * h * jerk * jerk))
    return np.asarray(top)


def _timing(stretch: Stretch, x: Array, y: Array) -> Timing:
    """Quintics in time between grid points, with the s, ds/dt and d2s/dt2 of both."""
    s, h = stretch.s, np.diff(stretch.s)
    nodes, weights = np.polynomial.legendre.leggauss(10)
    # Time over a cell: the integral of ds / sqrt(x)
    span = np.zeros(len(h))
    for node, weight in zip(0.5 * (nodes + 1.0), 0.5 * weights, strict=True):
        w = stretch.gained(float(node))
        inside = np.maximum(x[:-1] + w[:, 0] * y[:-1] + w[:, 1] * y[1:], 1e-9 * np.maximum(x[:-1], x[1:]))
        span += weight * _slope(stretch.u[:-1] + node * np.diff(stretch.u)) / np.sqrt(inside)
    span *= np.diff(stretch.u) * (s[-1] - s[0])
    v = np.sqrt(x)
    v0, a0, v1, a1 = v[:-1] * span, y[:-1] * span**2, v[1:] * span, y[1:] * span**2
    c3 = 10.0 * h - 6.0 * v0 - 4.0 * v1 - 1.5 * a0 + 0.5 * a1
    c4 = -15.0 * h + 8.0 * v0 + 7.0 * v1 + 1.5 * a0 - a1
    c5 = 6.0 * h - 3.0 * (v0 + v1) - 0.5 * (a0 - a1)
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
