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
from itertools import pairwise
from typing import Any

import numpy as np

from wbc.errors import InfeasibleError
from wbc.trajectory.laws.certificate import chain
from wbc.trajectory.laws.timing import Timing
from wbc.trajectory.paths.path import Path
from wbc.validation import Array

#: Programs are solved until this many in a row gain less than GAIN
PATIENCE = 3
#: Share of the duration that a program has to gain
GAIN = 5e-4
#: Programs that are solved, at most
ROUNDS = 20

#: but while what limits are passed by falls to this share of what it was, programs go on
SLOWER = 0.98

#: x of a program is no lower than this share of the last one's, below which a tangent says too little of the time; or
#: than the second one, where that is too much
LOWEST = (0.3, 1e-4)

#: Places of a cell at which derivatives are looked at
PLACES = np.array([0.0, 0.25, 0.5, 0.75, 1.0])

#: Cells between two knots at least, where a path has not too many
LEAST_CELLS = 8

#: Cells are not made shorter than this, of a length of 1
SHORTEST = 1e-12


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
        """Even in u between knots, several cells from knot to knot, and none more than twice as long as the next: they
        become shorter towards knots that are near to each other.
        """
        knots = np.concatenate([[start], path.knots[(path.knots > start) & (path.knots < end)], [end]])
        share = (knots - start) / (end - start)
        fine = np.linspace(0.0, 1.0, 20 * cells + 1)
        at = np.interp(share, _grade(fine), fine)
        for _ in range(3):
            at[1:-1] = np.clip(at[1:-1] - (_grade(at[1:-1]) - share[1:-1]) / _slope(at[1:-1]), 0.0, 1.0)
        parts = len(at) - 1
        least = min(max(1, cells // parts), LEAST_CELLS)
        wide = np.diff(at)
        counts = np.maximum(np.round(wide * cells).astype(int), np.where(wide > least * SHORTEST, least, 1))
        rows = [np.linspace(a, b, n, endpoint=False) for (a, b), n in zip(pairwise(at), counts, strict=True)]
        u = np.append(np.concatenate(rows), 1.0)
        while True:
            sizes = np.diff(u)
            beside = np.minimum(np.append(np.inf, sizes[:-1]), np.append(sizes[1:], np.inf))
            long = np.flatnonzero(sizes > 2.001 * np.maximum(beside, SHORTEST))
            if not long.size:
                break
            u = np.insert(u, long + 1, u[long] + 0.5 * sizes[long])
        s = start + (end - start) * _grade(u)
        s[np.searchsorted(u, at)] = knots
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

    def room(self) -> tuple[Array, Array, Array]:
        """(squared speed, acceleration, jerk) of s that no joint minds in each cell: half of each limit is left for the
        curvature.

        Raises:
            InfeasibleError: nothing moves in any cell.
        """
        v, a, j = self.limits
        first, second, third = (
            np.max([np.abs(part) for part in parts], axis=0)
            for parts in zip(*(self.derivatives(u) for u in PLACES), strict=True)
        )
        with np.errstate(divide="ignore", invalid="ignore"):
            speed = np.minimum(v / first, np.minimum(np.sqrt(0.5 * a / second), np.cbrt(0.25 * j / third))).min(axis=1)
            push = np.minimum(0.5 * a / first, j / (12.0 * second * speed[:, None])).min(axis=1)
            jerk = (0.5 * j / first).min(axis=1)
        if not (np.isfinite(jerk) & (speed > 0.0)).any():
            raise InfeasibleError("path", float(self.s[0]), "nothing moves between this coordinate and the next stop")
        # Where nothing moves, anything goes: as much as anywhere else
        speed, push, jerk = (np.where(np.isfinite(x), x, x[np.isfinite(x)].max()) for x in (speed, push, jerk))
        return speed**2, push, jerk


def _grade(u: Array) -> Array:
    return np.asarray(u**3 * (10.0 - 15.0 * u + 6.0 * u * u))


def _slope(u: Array) -> Array:
    return np.asarray(30.0 * (u * (1.0 - u)) ** 2)


def fastest(stretch: Stretch) -> Timing:
    """The timing from rest to rest, its violations of a few percent not yet taken away.

    Raises:
        InfeasibleError: the solver of the linear programs gave up.
    """
    room = stretch.room()
    x, y = _first(stretch, *room)
    shares = np.ones((3, len(x) - 1))
    best, least, idle, before = None, np.inf, 0, np.inf
    for _ in range(ROUNDS):
        x, y = _program(stretch, x, y, shares, room)
        timing = _timing(stretch, x, y)
        ratios = _ratios(stretch, timing)
        loss = max(1.0, *(float(r.max()) ** (1.0 / order) for order, r in enumerate(ratios, 1)))
        # Cells in which more is used between the points that the program looks at are given less
        shares = np.minimum(shares * np.clip(0.9999 / ratios, 0.5, 1.01), 1.0)
        gained, settled = 1.0 - timing.duration * loss / least, loss > SLOWER * before
        before = loss
        if gained > 0.0:
            best, least = timing, timing.duration * loss
        idle = idle + 1 if gained < GAIN and settled else 0
        if idle == PATIENCE:
            break
    assert best is not None
    return best


def _first(stretch: Stretch, most: Array, push: Array, jerk: Array) -> tuple[Array, Array]:
    """x and y to begin with, from what the cells have room for: no more than is reached from slower parts on both
    sides, where from rest x^(3/4) = 3 sqrt(jerk / 2) s with a constant jerk, x = 2 y s with a constant acceleration.
    """
    h = np.diff(stretch.s)
    rise, steep = 2.0 * push * h, 3.0 * np.sqrt(0.5 * jerk) * h
    x = np.concatenate([[0.0], np.minimum(most[1:], most[:-1]), [0.0]])
    for cells in (range(len(h)), range(len(h) - 1, -1, -1)):
        for k in cells:
            here, there = (k, k + 1) if cells.step > 0 else (k + 1, k)
            x[there] = min(x[there], x[here] + rise[k], (x[here] ** 0.75 + steep[k]) ** (4.0 / 3.0))
    return x, 0.5 * np.gradient(x, stretch.s)


def _program(
    stretch: Stretch, x0: Array, y0: Array, shares: Array, room: tuple[Array, Array, Array]
) -> tuple[Array, Array]:
    """x and y that maximise sum h x / x0^(3/2), the gain of time, under the limits linearised at x0.

    Unknowns are x / x0 and y over what it is from rest with a constant jerk, at inner grid points.
    """
    import scipy.optimize
    import scipy.sparse as sparse

    h, count = np.diff(stretch.s), len(stretch.s) - 2
    size_x = x0[1:-1]
    push, jerk = (np.minimum(part[1:], part[:-1]) for part in room[1:])
    size_y = np.minimum(push, np.sqrt(2.0 * jerk) * size_x**0.25)

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
    free, gain = np.full(count, np.inf), 0.5 * (h[1:] + h[:-1]) / np.sqrt(size_x)
    for lowest in LOWEST:
        top = np.maximum(_speeds(stretch, shares) / size_x, 2.0 * lowest)
        answer = scipy.optimize.linprog(
            np.concatenate([-gain / gain.max(), np.zeros(count)]),
            A_ub=upper,
            b_ub=np.concatenate(tops),
            A_eq=sparse.vstack([within, at_ends]),
            b_eq=np.zeros(count + 1),
            bounds=np.stack([np.append(np.full(count, lowest), -free), np.append(top, free)], axis=1),
            method="highs-ipm",
        )
        if answer.x is not None:
            break
    else:
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
