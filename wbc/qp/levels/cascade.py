"""Strict levels solved one after the other, each in the space that the earlier ones leave.

With the columns of N a basis of that space, level k is  x_k = x_(k-1) + N z  with the least

    1/2 |W^(1/2) (J x_k - b)|^2 + 1/2 sum_i damping(sigma_i) (n_i' x_k)^2,     J N = U S V',  n_i = N v_i

over the rows that must hold. Directions with sigma_i below a threshold are left to later levels, and so is the null
space; damping(sigma) = damping (1 - (sigma / ONSET)^2)^2 below ONSET and 0 above. Rows that push become equalities of
the later levels. Where no inequality binds z follows from one triangular solve, elsewhere from a QP. docs/levels.md
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wbc.qp.equalities import independent
from wbc.qp.levels.hierarchy import Achieved, Hierarchy, Level, LevelsAnswer
from wbc.qp.polishing import polish
from wbc.qp.problem import QP, QPSolution, definite
from wbc.qp.solvers.daqp import Daqp
from wbc.validation import Array

#: Singular values below this are damped
ONSET = 1e-2
#: Cost of the directions that a level leaves free, in the QP of that level; the steps take its effect away again
PROXIMAL = 1e-6
#: Steps at most
STEPS = 12
#: Relative change at which the steps end
SETTLED = 1e-11
#: Corrections of the active set where the solver finds none
POLISH_ROUNDS = 200
#: Violations up to this are rounding
TOLERANCE = 1e-9
#: Rows shorter than this in the space that is left cannot be moved
DEAD = 1e-9
#: Multipliers above this share of what drives a level are not rounding
PUSHING = 1e-6
#: Multipliers below this are rounding, whatever drives the level
NOISE = 1e-12
#: Directions that binding rows share with others by less than this angle count as one
DEPENDENT = 1e-7
#: Curvature above this share of the largest one takes its direction
BENT = 1e-3

_EPS = float(np.finfo(np.float64).eps)


class Cascade:
    """Kept solvers of a cascade with ``n`` variables and ``m`` general rows.

    Args:
        threshold: singular values below it are left to later levels.
        damping: of a direction whose singular value is 0.
    """

    def __init__(self, n: int, m: int, threshold: float, damping: float) -> None:
        self.n, self.m = n, m
        self._threshold, self._damping = threshold, damping
        self._solvers: dict[tuple[int, int], Daqp] = {}

    def reset(self) -> None:
        """Forget the active sets of the last answer."""
        for solver in self._solvers.values():
            solver.reset()

    def solve(self, problem: Hierarchy) -> LevelsAnswer:
        """The optimum of all levels."""
        n = self.n
        rows = LevelRows(problem)
        space, dropped = _equalities(problem, rows)
        x, iterations, error = problem.x, 0, 0.0
        multipliers, pushes = np.zeros(n + self.m), np.full(n + self.m, -1)
        achieved: list[Achieved] = []
        for place, level in enumerate([*problem.levels, rest(n)]):
            last = place == len(problem.levels)
            step = LevelStep(self, level, rows, space, x, last)
            out, space, lam = step.solve(place)
            iterations += step.iterations
            error = out.error = out.error + error * (1.0 + step.gain)
            fresh = (lam != 0.0) & (pushes < 0)
            multipliers[fresh], pushes[fresh] = lam[fresh], place
            rows.pass_on(level, out.x)
            x = out.x
            achieved.append(out)
        for level, out in zip(problem.levels, achieved, strict=False):
            out.disturbance = float(np.abs(level.rows @ (x - out.x)).max(initial=0.0))
        off = np.abs(problem.A @ x - problem.lower[n:])
        return LevelsAnswer(x, multipliers, pushes, np.where(dropped, off, -1.0), achieved, iterations)

    def split(self, rows: Array) -> tuple[Array, Array, int]:
        """(V, singular values, number of those that count) of rows in the space that is left."""
        width = rows.shape[1]
        sigma = np.zeros(width)
        if not rows.shape[0] or not width:
            return np.eye(width), sigma, 0
        _, found, directions = np.linalg.svd(rows)
        sigma[: found.size] = found
        return directions.T, sigma, int((found >= self._threshold).sum())

    def damped(self, sigma: Array) -> Array:
        """Damping of directions by their singular values."""
        return np.asarray(self._damping * np.maximum(0.0, 1.0 - (sigma / ONSET) ** 2) ** 2)

    def solver(self, place: int, size: int) -> Daqp:
        """The kept solver of a level whose QP has ``size`` variables."""
        key = (place, size)
        if key not in self._solvers:
            self._solvers[key] = Daqp(size, self.n + self.m)
        return self._solvers[key]


def rest(n: int) -> Level:
    """What comes after all levels: the least x of all that is left."""
    return Level(np.zeros((0, n)), np.zeros(0), np.zeros(n), np.zeros(0, dtype=np.intp), np.zeros(0))


def _equalities(problem: Hierarchy, rows: LevelRows) -> tuple[Array, NDArray[np.bool_]]:
    """(basis of the space that equality rows leave, rows that were dropped because they depend on others)."""
    n, m = problem.x.size, problem.A.shape[0]
    low, high = np.where(rows.equal, problem.lower, -np.inf), np.where(rows.equal, problem.upper, np.inf)
    found = independent(QP(np.eye(n), np.zeros(n), low, high, problem.A))
    dropped = np.zeros(m, dtype=np.bool_)
    dropped[found.dropped] = True
    fixed = np.eye(n)[rows.equal[:n]]
    return complement(np.vstack((fixed, found.basis)), np.eye(n)), dropped


class LevelRows:
    """Sides of all rows as they stand for a level, and how x sees them."""

    def __init__(self, problem: Hierarchy) -> None:
        n = problem.x.size
        self.C = np.vstack((np.eye(n), problem.A))
        at = self.C @ problem.x
        self.lower, self.upper = np.minimum(problem.lower, at), np.maximum(problem.upper, at)
        self.given = problem.lower, problem.upper
        later = np.zeros(at.size, dtype=np.bool_)
        for level in problem.levels:
            later[n + level.soft] = True
        self.equal = (problem.lower == problem.upper) & ~later
        #: rows that hold now
        self.on = ~(later | self.equal)

    def pass_on(self, level: Level, x: Array) -> None:
        """What a level minimised holds from now on, as far as x keeps it."""
        soft = x.size + level.soft
        self.on[soft] = True
        at = self.C @ x
        self.lower, self.upper = np.minimum(self.lower, at), np.maximum(self.upper, at)
        self.lower[soft] = np.minimum(self.given[0][soft], at[soft])
        self.upper[soft] = np.maximum(self.given[1][soft], at[soft])

    def without(self, space: Array, multipliers: Array) -> Array:
        """The part of a space in which the rows that push do not change."""
        rows = self.C[multipliers != 0.0]
        return complement(rows, space)


class LevelStep:
    """One level at work: its coordinates y_c (taken) and y_f (free), its optimum, and what it leaves."""

    def __init__(self, cascade: Cascade, level: Level, rows: LevelRows, space: Array, x: Array, last: bool) -> None:
        self.cascade, self.level, self.rows, self.x, self.last = cascade, level, rows, x, last
        self.local = space if last else level.rows @ space
        if last:
            directions, self.sigma, self.rank = np.eye(space.shape[1]), np.ones(space.shape[1]), space.shape[1]
        else:
            directions, self.sigma, self.rank = cascade.split(self.local)
        self.sigma = self.sigma[: self.rank]
        turned = space @ directions
        if level.bent is not None:
            turned = self._take_bent(turned, level.bent[1])
        self.Z, self.F = turned[:, : self.rank], turned[:, self.rank :]
        self.iterations, self.gain = 0, 0.0
        self._measure()

    def _take_bent(self, turned: Array, bent: Array) -> Array:
        """The directions with those that curvature takes next to those that the rows take."""
        free = turned[:, self.rank :]
        local = free.T @ bent @ free
        value, direction = np.linalg.eigh(0.5 * (local + local.T))
        order = np.argsort(-value, kind="stable")
        out = np.hstack((turned[:, : self.rank], free @ direction[:, order]))
        self.rank += int((value > BENT * np.abs(bent).max(initial=0.0)).sum())
        return out

    def _measure(self) -> None:
        """H and the right side in y_c."""
        level, x = self.level, self.x
        if self.last:
            self.T, self.damped = self.Z, np.zeros(self.rank)
            self.H, self.plain = np.eye(self.rank), -self.Z.T @ x
        else:
            self.T = level.rows @ self.Z
            self.damped = np.zeros(self.rank) if level.bent is not None else self.cascade.damped(self.sigma)
            self.H = self.T.T @ (level.weight[:, None] * self.T) + np.diag(self.damped)
            pull = level.wanted - level.rows.T @ (level.weight * (level.rows @ x))
            if level.bent is not None:
                self.H += self.Z.T @ level.bent[0] @ self.Z
                pull -= level.bent[0] @ x
            self.plain = self.Z.T @ pull
        self.H = definite(self.H)
        self.right = self.plain - self.damped * (self.Z.T @ x)

    def solve(self, place: int) -> tuple[Achieved, Array, Array]:
        """(what was achieved, the space that is left, multipliers)."""
        y, force, lam, solved = np.zeros(self.rank), self._none(), self._none(), True
        if self.rank:
            try:
                y = np.asarray(np.linalg.solve(self.H, self.right))
            except np.linalg.LinAlgError:  # pivots of elimination may vanish where those of Cholesky do not
                factor = np.linalg.inv(np.linalg.cholesky(self.H))
                y = np.asarray(factor.T @ (factor @ self.right))
        x = self.x + self.Z @ y
        if not self._holds(x):
            x, y, force, solved = self._searched(place)
            lam = self._pushing(force)
        free = self.rows.without(self.F, lam)
        residual = np.concatenate(
            (
                self.H @ y - self.right + self.Z.T @ (self.rows.C.T @ force),
                self.F.T @ (self.rows.C.T @ force),
            )
        )
        inverse = np.linalg.inv(np.linalg.cholesky(self.H)).T if self.rank else np.zeros((0, 0))
        reach = float(np.linalg.norm(inverse))
        if not self.last:
            # |H^-1 T'W J| <= |R^-1| |W^(1/2) J|, as R'R is at least T'W T
            self.gain = reach * float(np.linalg.norm(np.sqrt(self.level.weight)[:, None] * self.level.rows))
        terms = np.abs(self.H) @ np.abs(y) + np.abs(self.right) + np.abs(self.level.wanted).max(initial=0.0)
        size = np.abs(residual[: self.rank]) + (x.size + 4) * _EPS * terms
        at = self.rows.C @ x
        side = np.where(force > 0.0, self._sides()[1], self._sides()[0])
        gap = np.abs(force * np.where(force != 0.0, at - side, 0.0))
        gap[x.size + self.level.soft] = 0.0
        out = Achieved(
            x,
            self.rank,
            free.shape[1],
            float(self.sigma.min(initial=np.inf)),
            self._price(y),
            float(np.abs(residual).max(initial=0.0)) if solved else np.inf,
            float(gap.max(initial=0.0)),
            reach * float(np.linalg.norm(np.abs(inverse).T @ size)) if solved else np.inf,
            np.zeros(0) if self.last else share(self.level.rows, self.local),
            solved,
        )
        return out, free, lam

    def _none(self) -> Array:
        return np.zeros(self.rows.on.size)

    def _sides(self) -> tuple[Array, Array]:
        """Sides of the rows that hold now and of those that are minimised, infinite for the others."""
        rows, soft = self.rows, self.x.size + self.level.soft
        low, high = np.where(rows.on, rows.lower, -np.inf), np.where(rows.on, rows.upper, np.inf)
        first, last = rows.given[0][soft], rows.given[1][soft]
        crossed = first > last
        first[crossed] = last[crossed] = 0.5 * (first[crossed] + last[crossed])
        low[soft], high[soft] = first, last
        return low, high

    def _holds(self, x: Array) -> bool:
        low, high = self._sides()
        at = self.rows.C @ x
        return bool(((at >= low - TOLERANCE) & (at <= high + TOLERANCE)).all())

    def _searched(self, place: int) -> tuple[Array, Array, Array, bool]:
        """(x, y_c, multipliers, solved) where rows bind."""
        rows, level, rank = self.rows, self.level, self.rank
        free, soft = self.F.shape[1], level.soft
        low, high = self._sides()
        moved = np.hstack((rows.C @ self.Z, rows.C @ self.F))
        still = np.linalg.norm(moved, axis=1) <= DEAD
        low[still], high[still] = -np.inf, np.inf
        size = rank + free + soft.size
        A = np.hstack((moved, np.zeros((moved.shape[0], soft.size))))
        # slacks at the cost s^2 / 2, whatever the weight
        A[self.x.size + soft, rank + free + np.arange(soft.size)] = 1.0 / np.sqrt(level.soft_weight)
        H = np.diag(np.concatenate((np.zeros(rank), np.full(free, PROXIMAL), np.ones(soft.size))))
        H[:rank, :rank] = self.H
        base = rows.C @ self.x
        ends = (
            np.concatenate((np.full(size, -np.inf), low - base)),
            np.concatenate((np.full(size, np.inf), high - base)),
        )
        g = np.zeros(size)
        g[:rank] = -self.right
        found = self._proximal(place, QP(H, g, *ends, A))
        if found is None:
            return self.x, np.zeros(rank), self._none(), False
        x = self.x + self.Z @ found.x[:rank] + self.F @ found.x[rank : rank + free]
        return x, found.x[:rank], found.multipliers[size:].copy(), True

    def _pushing(self, force: Array) -> Array:
        """Multipliers of the rows that push; those of the others are rounding, or too small to tell from it."""
        seen = np.linalg.norm(self.rows.C @ np.hstack((self.Z, self.F)), axis=1)
        seen[self.x.size + self.level.soft] = np.hypot(seen[self.x.size + self.level.soft], 1.0)
        drive = max(float(np.abs(self.right).max(initial=0.0)), float(np.abs(force).max(initial=0.0)))
        return np.where(np.abs(force) * seen <= max(PUSHING * drive, NOISE), 0.0, force)

    def _proximal(self, place: int, qp: QP) -> QPSolution | None:
        """The QP with the cost of the free directions taken away again."""
        free = slice(self.rank, self.rank + self.F.shape[1])
        solver = self.cascade.solver(place, qp.n)
        best: QPSolution | None = None
        for _ in range(STEPS):
            found = solver.solve(qp)
            self.iterations += found.iterations
            if not found.solved:
                found = polish(qp, found, POLISH_ROUNDS).solution
            if not found.solved:
                break
            moved = np.inf if best is None else float(np.abs(found.x - best.x).max(initial=0.0))
            best = found
            if moved <= SETTLED or free.start == free.stop:
                break
            qp.g[free] = -PROXIMAL * found.x[free]
        return best

    def _price(self, y: Array) -> float:
        """How far damping moves the level's rows."""
        if self.last or not self.damped.any():
            return 0.0
        # in t = sigma y the rows are well scaled, however small a singular value
        T = self.T / self.sigma
        undamped = np.linalg.solve(T.T @ (self.level.weight[:, None] * T), self.plain / self.sigma)
        gap = T @ (undamped - self.sigma * y)
        exact = float(gap @ (self.level.weight * gap))
        low, high = self._sides()
        n = self.x.size
        fastest = np.maximum(np.abs(low[:n]), np.abs(high[:n]))
        if not np.isfinite(fastest).all():
            return float(np.sqrt(exact))
        reached = self.Z.T @ self.x + y
        bound = float(self.damped @ np.maximum(0.0, (np.abs(self.Z).T @ fastest) ** 2 - reached**2))
        return float(np.sqrt(min(exact, bound)))


def complement(rows: Array, space: Array) -> Array:
    """The directions of a space that rows do not see."""
    lengths = np.linalg.norm(rows, axis=1)
    local = (rows[lengths > 0.0] / lengths[lengths > 0.0, None]) @ space
    if not local.size:
        return space
    _, sigma, directions = np.linalg.svd(local)
    return np.asarray(space @ directions[int((sigma > DEPENDENT).sum()) :].T)


def share(rows: Array, local: Array) -> Array:
    """Length of each row in the space that is left, as a part of its whole length; 1 for rows without."""
    lengths = np.linalg.norm(rows, axis=1)
    left = np.linalg.norm(local, axis=1) / np.where(lengths > 0.0, lengths, 1.0)
    return np.asarray(np.where(lengths > 0.0, left, 1.0))
