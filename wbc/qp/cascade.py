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

from wbc.qp.daqp import Daqp
from wbc.qp.equalities import independent
from wbc.qp.hierarchy import Achieved, Answer, Hierarchy, Level
from wbc.qp.level_step import LevelStep, Rows, complement
from wbc.qp.problem import QP
from wbc.validation import Array

#: Singular values below this are damped
ONSET = 1e-2


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

    def solve(self, problem: Hierarchy) -> Answer:
        """The optimum of all levels."""
        n = self.n
        rows = Rows(problem)
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
        return Answer(x, multipliers, pushes, np.where(dropped, off, -1.0), achieved, iterations)

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


def _equalities(problem: Hierarchy, rows: Rows) -> tuple[Array, NDArray[np.bool_]]:
    """(basis of the space that equality rows leave, rows that were dropped because they depend on others)."""
    n, m = problem.x.size, problem.A.shape[0]
    low, high = np.where(rows.equal, problem.lower, -np.inf), np.where(rows.equal, problem.upper, np.inf)
    found = independent(QP(np.eye(n), np.zeros(n), low, high, problem.A))
    dropped = np.zeros(m, dtype=np.bool_)
    dropped[found.dropped] = True
    fixed = np.eye(n)[rows.equal[:n]]
    return complement(np.vstack((fixed, found.basis)), np.eye(n)), dropped
