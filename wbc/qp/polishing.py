"""Active-set polish: from an approximate solution to one at rounding level.

The active set is guessed from (x, lam), the equality-constrained problem on it

    H x + g + C_S' lam_S = 0,     C_S x = b_S

is solved through the factor of H and a QR of the active rows, refined with residuals in long double,
and the set is corrected until every multiplier has the right sign and no other row is violated.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wbc.qp.factor import ActiveRows, Factor, active_bounds
from wbc.qp.problem import QP, QPSolution
from wbc.quick_dataclasses import dataclass
from wbc.validation import Array

#: Corrections of the active set before giving up, and steps of iterative refinement on each set
ROUNDS = 60
REFINEMENTS = 2

#: A bound counts as violated beyond this times (1 + |bound|); a multiplier as wrong beyond this times the largest force
POLISHED = 1e-12


@dataclass(frozen=True, eq=False, slots=True)
class Polished:
    """Result of :func:`polish`.

    Attributes:
        solution: the polished point, or the best point seen if ``exact`` is False.
        exact: the active set satisfies all signs and bounds.
        rounds: active sets tried.
    """

    solution: QPSolution
    exact: bool
    rounds: int


def polish(qp: QP, solution: QPSolution, rounds: int = ROUNDS) -> Polished:
    """Polish ``solution`` (only its x and multipliers are read).

    Each round solves the problem on the present set and then makes one change: if multipliers have the
    wrong sign, the row with the worst one (lam_i |M_i|) leaves; otherwise the most violated row
    (violation_i / |M_i|) enters; if there is neither, the point is the optimum. The best point is the one
    whose worst scaled violation is least.

    Cannot do: prove infeasibility; if H is not positive definite the input comes back with ``exact`` False.
    """
    factor = Factor(qp)
    if not factor.definite:
        return Polished(QPSolution(solution.x, solution.multipliers, "failed", 0), False, 0)
    held = active_bounds(qp, factor, solution)
    norms = np.where(factor.norms > 0.0, factor.norms, 1.0)
    best, best_error = QPSolution(solution.x, solution.multipliers, "failed", 0), np.inf
    lam = solution.multipliers
    for count in range(1, rounds + 1):
        x, lam, rows = solve_on(qp, factor, held, lam)
        wrong = _wrong_signs(qp, held, lam) * norms
        beyond = _violations(qp, x) / norms
        error = float(max(wrong.max(initial=0.0), beyond.max(initial=0.0)))
        if error < best_error:
            best, best_error = QPSolution(x, lam, "failed", count), error
        if error == 0.0:
            return Polished(QPSolution(x, lam, "solved", count), True, count)
        held[rows.dependent[held[rows.dependent] != 2]] = 0
        if wrong.max(initial=0.0) > 0.0:
            held[int(wrong.argmax())] = 0
        else:
            entering = int(beyond.argmax())
            if held[entering] != 0:
                break  # an active row that cannot be met depends on the others: the set is contradictory
            held[entering] = 1 if qp.rows_at(x)[entering] > qp.upper[entering] else -1
    return Polished(best, False, count)


def solve_on(qp: QP, factor: Factor, held: NDArray[np.int8], multipliers: Array) -> tuple[Array, Array, ActiveRows]:
    """The optimum with the rows of ``held`` at their bounds: x, multipliers, and the rows used.

    ``multipliers`` only decides the order in which dependent rows are left out.
    """
    rows = ActiveRows(factor, held, multipliers)
    bound = np.where(held == -1, qp.lower, qp.upper)[rows.index]
    x = np.zeros(qp.n, dtype=np.longdouble)
    lam = np.zeros(qp.n + qp.m, dtype=np.longdouble)
    for _ in range(1 + REFINEMENTS):
        force = -factor.stationarity(qp, x, lam).astype(np.float64)
        offset = (bound - factor.rows_at(x)[rows.index]).astype(np.float64)
        dy, mu = rows.solve(factor.inverse.T @ force, offset)
        x += factor.inverse @ dy
        lam[rows.index] += mu
    return x.astype(np.float64), lam.astype(np.float64), rows


def _wrong_signs(qp: QP, held: NDArray[np.int8], lam: Array) -> Array:
    """How far multipliers point the wrong way, 0 where they are right or within rounding [n + m]."""
    wrong = np.where(held == 1, -lam, np.where(held == -1, lam, 0.0))
    scale = np.abs(lam).max(initial=0.0) + np.abs(qp.g).max(initial=0.0)
    return np.where(wrong > POLISHED * scale, wrong, 0.0)


def _violations(qp: QP, x: Array) -> Array:
    """Violations beyond rounding, 0 otherwise [n + m]."""
    beyond = qp.violation(x)
    bound = np.where(np.isfinite(qp.upper), np.abs(qp.upper), 0.0)
    bound = np.maximum(bound, np.where(np.isfinite(qp.lower), np.abs(qp.lower), 0.0))
    return np.where(beyond > POLISHED * (1.0 + bound), beyond, 0.0)
