"""A certificate: how far an answer can be from the true minimiser, whatever solver gave it.

Derivation (docs/solvers.md has it in full). Let xh = x - delta meet the active rows S exactly and violate
no other row, and let lam have the right signs on S and vanish elsewhere. Then xh minimises the same
problem with g - s in place of g, s = H xh + g + C' lam. For two minimisers over one convex set,
(xh - x*)' H (xh - x*) <= (xh - x*)' s, hence with H = R'R

    |R (xh - x*)| <= |R^-T s|      and      |x_j - x*_j| <= |delta_j| + |row_j R^-1| |R^-T s|.

No singular value of the rows and no guess of the true active set enters. Both minimisers meet the equality rows E,
so that only the parts of R^-T s and of row_j R^-1 count that are orthogonal to those rows seen through R; and any
multipliers of the right sign certify: lam is fitted to xh in long double first. Where prices of 10^9 stand beside
damping of 10^-8, the rounding of lam to double alone would be worth 0.1 rad/s.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbc.qp.factor import ROUNDOFF, WIDE_ROUNDOFF, ActiveRows, Factor, Wide, active_bounds
from wbc.qp.problem import QP, QPSolution
from wbc.quick_dataclasses import dataclass
from wbc.validation import Array

_CORRECTIONS = 4
#: Fits of the multipliers
_FITS = 2
#: Roundings of an entry in a Householder factorisation (Higham 2002, lemma 19.3)
_TILT = 12.0


@dataclass(frozen=True, slots=True)
class Certificate:
    """Residuals of an answer and a bound on its error.

    Attributes:
        stationarity: largest entry of |H x + g + [1; A]' lam|.
        violation: largest violation of a bound, in the units of its row.
        complementarity: largest |lam_i| times the distance of row i from the bound that lam_i names.
        error_bound: bound on the largest |x_j - x*_j| (rad/s, m/s for joint velocities); inf if none can
            be stated: H is not positive definite, or x is too far from a feasible point of its active set.
    """

    stationarity: float
    violation: float
    complementarity: float
    error_bound: float


def certify(qp: QP, solution: QPSolution, count: int | None = None) -> Certificate:
    """The certificate of ``solution.x`` and ``solution.multipliers``; the flag is not read.

    The bound is on the errors of the first ``count`` variables; None: of all.

    x* is the minimiser of the problem whose bounds are the given ones up to the rounding of one
    evaluation, 4 u (|b_i| + |C_i|_1 |x|_inf) with u = 2^-53.
    """
    x, lam = solution.x, solution.multipliers
    stationarity = np.abs(qp.H @ x + qp.g + lam[: qp.n] + qp.A.T @ lam[qp.n :])
    at = qp.rows_at(x)
    named = np.where(lam > 0.0, qp.upper, np.where(lam < 0.0, qp.lower, at))
    with np.errstate(invalid="ignore"):
        product = np.abs(lam) * np.abs(named - at)
    return Certificate(
        float(stationarity.max(initial=0.0)),
        float(qp.violation(x).max(initial=0.0)),
        float(product.max(initial=0.0)),
        error_bound(qp, solution, count),
    )


def error_bound(qp: QP, solution: QPSolution, count: int | None = None) -> float:
    """The bound on max |x_j - x*_j| over the first ``count`` variables, or inf."""
    factor = Factor(qp)
    if not factor.definite:
        return np.inf
    gamma = (qp.n + 2) * ROUNDOFF
    # relative error of |R .| and |R^-1 .| through the rounding of the factorisation itself
    loss = gamma * float(np.linalg.norm(factor.R)) ** 2 * float(np.linalg.norm(factor.inverse)) ** 2
    if loss > 0.1:
        return np.inf
    x, lam = solution.x, solution.multipliers
    held = active_bounds(qp, factor, solution)
    clean = np.where(_right(held, lam), lam, 0.0)
    size = np.concatenate((np.ones(qp.n), np.abs(qp.A).sum(axis=1))) * np.abs(x).max(initial=0.0)

    exact = x.astype(np.longdouble)
    bound = np.where(held == -1, qp.lower, np.where(held == 0, 0.0, qp.upper))
    rows = ActiveRows(factor, held, clean)
    for _ in range(_CORRECTIONS):
        residual = (bound - factor.rows_at(exact))[rows.index].astype(np.float64)
        dy, _ = rows.solve(np.zeros(qp.n), residual)
        exact = exact + factor.inverse @ dy
    at = factor.rows_at(exact)
    tolerance = 4.0 * ROUNDOFF * (np.where(held == 0, 0.0, np.abs(bound)) + size)
    low, high = at - qp.lower, qp.upper - at
    off = np.abs(np.where(held == 0, 0.0, bound - at))
    if bool((np.minimum(low, high) < -tolerance).any()) or bool((off > tolerance)[clean != 0.0].any()):
        return np.inf

    held[off > tolerance] = 0  # active rows that depend on others and are missed take no force
    force, rounding = _forces(qp, factor, rows, held, exact, clean)
    left = off[rows.index].astype(np.float64) + WIDE_ROUNDOFF * (qp.n + 2) * size[rows.index]
    rest = float(np.linalg.norm(left)) * rows.inverse_norm()
    inverse, tilt = _within_equalities(factor, rows, held)
    whole = np.abs(factor.inverse.T) @ (np.abs(force) + rounding)
    step = float(np.linalg.norm(inverse.T @ force)) + float(np.linalg.norm(np.abs(inverse).T @ rounding))
    step += tilt * float(np.linalg.norm(whole)) + rest
    reach = np.linalg.norm(inverse, axis=1) + tilt * np.linalg.norm(factor.inverse, axis=1)
    total = np.abs(exact - x).astype(np.float64) + reach * step * (1.0 + 2.0 * loss) / (1.0 - loss)
    return float(total[:count].max(initial=0.0))


def _right(held: NDArray[np.int8], lam: Any) -> NDArray[np.bool_]:
    """Which rows have a multiplier that they may have."""
    out: NDArray[np.bool_] = (held == 2) | (lam * held > 0.0)
    return out


def _forces(
    qp: QP, factor: Factor, rows: ActiveRows, held: NDArray[np.int8], x: Wide, multipliers: Array
) -> tuple[Array, Array]:
    """Stationarity at x with the multipliers that fit it best, and a bound on the rounding in it [n], [n]."""
    lam, still = multipliers.astype(np.longdouble), np.zeros(rows.index.size)
    for _ in range(_FITS):
        force = factor.stationarity(qp, x, lam).astype(np.float64)
        fitted = lam.copy()
        fitted[rows.index] -= rows.solve(factor.inverse.T @ force, still)[1]
        lam = np.where(_right(held, fitted), fitted, 0.0)
    force = factor.stationarity(qp, x, lam).astype(np.float64)
    sizes = _magnitudes(qp, x.astype(np.float64), lam.astype(np.float64))
    rounding = WIDE_ROUNDOFF * (qp.n + qp.m + 3) * sizes
    # the multiplier of an active bound takes all of its residual, whatever that is, if it keeps its sign
    own, at = lam[: qp.n] - force, held[: qp.n]
    taken = _right(at, np.where(np.abs(own) > rounding, own, 0.0))
    return np.where(taken, 0.0, force), np.where(taken, 0.0, rounding)


def _within_equalities(factor: Factor, rows: ActiveRows, held: NDArray[np.int8]) -> tuple[Array, float]:
    """R^-1 (I - Q Q'), Q a basis of the equality rows seen through R, and by how much its plane may be tilted."""
    count = int((held[rows.index] == 2).sum())
    inverse, Q, T = factor.inverse, rows.Q[:, :count], rows.T[:count, :count]
    if count == 0:
        return inverse, 0.0
    for _ in range(2):
        inverse = inverse - (inverse @ Q) @ Q.T
    lengths = factor.norms[rows.index[:count]]
    steepest = float(np.linalg.norm(np.linalg.solve(T.T, np.diag(lengths))))
    return inverse, _TILT * factor.R.shape[0] * ROUNDOFF * steepest


def _magnitudes(qp: QP, x: Array, lam: Array) -> Array:
    """|H| |x| + |g| + [1; |A|]' |lam|, the size of the terms whose sum is the stationarity."""
    absolute = np.abs(lam)
    out: Array = np.abs(qp.H) @ np.abs(x) + np.abs(qp.g) + absolute[: qp.n] + np.abs(qp.A).T @ absolute[qp.n :]
    return out
