"""How the optimum of strict levels moves with its data, the rows that push and the ranks being what they are.

With the rows S_k that push first at level k held at their sides, level k is

    minimise  1/2 |W^(1/2) (J_k x - b_k)|^2 + damping and curvature      over  x = x_(k-1) + N_k z,  C_S x = b_S

which is one linear system, and a smooth function of its numbers as long as no rank changes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wbc.errors import SolverError
from wbc.qp.levels.cascade import Cascade, LevelRows, LevelStep, complement, rest
from wbc.qp.levels.hierarchy import Hierarchy, LevelsAnswer
from wbc.validation import Array

#: Curvature of a level's cost along what the rows that push leave, below which a direction is not its own
_FLAT = 1e-13


class FrozenLevels:
    """The optimum for the rows that push, the sides that they push at, and the ranks of one answer.

    Args:
        problem, answer: where these come from; multipliers of the answer may be in any units.
    """

    def __init__(self, cascade: Cascade, problem: Hierarchy, answer: LevelsAnswer) -> None:
        n = problem.x.size
        self._cascade = cascade
        self._equal = LevelRows(problem).equal
        self._equal[n:] &= answer.dropped < 0.0
        self._places = np.where(self._equal, -1, answer.pushes)
        self._upper = answer.multipliers > 0.0
        self._ranks = [level.rank for level in answer.levels]

    @property
    def active(self) -> list[int]:
        """Rows that hold the optimum: those that push, and equality rows that do not depend on others."""
        return np.flatnonzero((self._places >= 0) | self._equal).tolist()

    def at(self, problem: Hierarchy) -> Array:
        """The optimum of another problem of the same form, from its x [n].

        Raises:
            SolverError: it has another rank.
        """
        n = problem.x.size
        rows = LevelRows(problem)
        low, high = problem.lower.copy(), problem.upper.copy()
        crossed = low > high
        low[crossed] = high[crossed] = 0.5 * (low[crossed] + high[crossed])
        sides = np.where(self._upper, high, low)
        equal = rows.C[self._equal]
        x = problem.x + np.linalg.lstsq(equal, low[self._equal] - equal @ problem.x, rcond=None)[0]
        space = complement(equal, np.eye(n))
        for place, level in enumerate([*problem.levels, rest(n)]):
            step = LevelStep(self._cascade, level, rows, space, x, place == len(problem.levels))
            if step.rank != self._ranks[place]:
                raise SolverError("levels", place, "a direction is about to change its level: there is no derivative")
            push = np.flatnonzero(self._places == place)
            soft = np.isin(push, n + level.soft)
            gap = sides[push] - rows.C[push] @ x
            weight = level.soft_weight[np.searchsorted(level.soft, push[soft] - n)]
            z = _optimum(step, rows.C[push], gap, soft, weight)
            x = x + step.Z @ z[: step.rank] + step.F @ z[step.rank :]
            space = complement(rows.C[push], step.F)
        return np.asarray(x)

    def to_bound(self, problem: Hierarchy, row: int, start: Array) -> Array:
        """dx / db of the side that holds a row, zero for rows that hold nothing [n].

        ``start`` is how the problem's own x moves. The optimum is affine in its sides, so a difference is exact.
        """
        if row not in self.active:
            return np.zeros(problem.x.size)
        ends = []
        for by in (1.0, -1.0):
            moved = problem.lower.copy(), problem.upper.copy()
            for side in moved:
                side[row] += by
            ends.append(self.at(Hierarchy(problem.x + by * start, *moved, problem.A, problem.levels)))
        return np.asarray(0.5 * (ends[0] - ends[1]))


def _optimum(step: LevelStep, C: Array, gap: Array, soft: NDArray[np.bool_], weight: Array) -> Array:
    """z = (y_c, y_f) of a level with rows that push: hard ones close their gap, soft ones are weighed."""
    width = step.rank + step.F.shape[1]
    z = np.zeros(width)
    if not gap.size:
        z[: step.rank] = np.linalg.solve(step.H, step.right) if step.rank else 0.0
        return z
    local = np.hstack((C @ step.Z, C @ step.F))
    H, right = np.zeros((width, width)), np.zeros(width)
    H[: step.rank, : step.rank], right[: step.rank] = step.H, step.right
    H += local[soft].T @ (weight[:, None] * local[soft])
    right += local[soft].T @ (weight * gap[soft])
    hard = local[~soft]
    if hard.size:
        z = np.linalg.lstsq(hard, gap[~soft], rcond=None)[0]
    left = complement(hard, np.eye(width))
    reduced = left.T @ H @ left
    value, direction = np.linalg.eigh(0.5 * (reduced + reduced.T))
    counts = value > _FLAT * max(float(value.max(initial=0.0)), 1.0)
    along = left @ direction[:, counts]
    return np.asarray(z + along @ ((along.T @ (right - H @ z)) / value[counts]))
