"""Equality rows made independent, and then orthonormal, before a solver sees them.

An active-set solver works with the rows seen through the factor of H. There, rows of a well-posed
problem can be nearly parallel: with a posture weight of 1e-8, DAQP called 40 of 40 feasible problems
infeasible whose equality rows were 1e-3 (relative) away from dependence. Two exact changes cure it:

    rows      A_E x = b            ->  Q x = d           Q orthonormal, the same affine set
    Hessian   H, g                 ->  H + rho Q'Q, g - rho Q'd      (a constant on that set)

The set and the minimiser are unchanged; the multipliers of the given rows follow by one triangular solve.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wbc.qp.problem import QP, QPSolution
from wbc.quick_dataclasses import dataclass
from wbc.validation import Array

Index = NDArray[np.intp]

#: A row whose part outside the span of the kept rows is below this share of its length is dropped.
THRESHOLD = 1e-7

#: Rows whose remainder is within this share of the longest are equally good pivots: the lowest index is taken.
_TIE = 1e-6

#: Tolerance of the right side of a dropped row [unit of the row per second]
_TOLERANCE = 1e-9


@dataclass(frozen=True, eq=False, slots=True)
class Equalities:
    """Independent equality rows of a QP. Indices count general rows, 0 to m - 1.

    Attributes:
        kept: indices of the k independent rows, in pivot order.
        dropped: indices of the rows that depend on them.
        inconsistency: for each dropped row, |A_i x - b_i| at the nearest-to-zero point of the kept rows, in
            the row's own units.
        consistent: for each dropped row, whether that is within rounding and threshold.
        basis: orthonormal rows Q over the free variables, zero at fixed ones [k, n].
        target: d with Q x = d on the kept rows (x counted without the fixed variables) [k].
        triangle: lower triangular T, A_kept (free columns) = T Q [k, k].
    """

    kept: Index
    dropped: Index
    inconsistency: Array
    consistent: NDArray[np.bool_]
    basis: Array
    target: Array
    triangle: Array

    @property
    def all_consistent(self) -> bool:
        """True if every dropped row holds where the kept rows hold."""
        return bool(self.consistent.all())


def independent(qp: QP, threshold: float = THRESHOLD, order: NDArray[np.int_] | None = None) -> Equalities:
    """Pivoted modified Gram-Schmidt on the normalised equality rows of ``qp``.

    Variables with lower == upper are constants: their columns move to the right side first; a row of which they leave
    at most ``threshold`` of its length is dropped. Then, class by class of ``order`` (low numbers first; one class if
    None), the row with the longest remainder is taken next, near-ties (within 1e-6) by lowest index, and every
    remaining row is orthogonalised against it twice. Rows whose remainder is at most ``threshold`` of their length are
    dropped. A dropped row is
    consistent if its right side is met within 1e-9 + threshold |A_i| |x|, x the nearest-to-zero point
    of the kept rows: the threshold hides no more than that.
    """
    n = qp.n
    fixed = qp.lower[:n] == qp.upper[:n]
    constant = np.where(fixed, qp.lower[:n], 0.0)
    rows = np.flatnonzero(qp.lower[n:] == qp.upper[n:])
    if not rows.size:
        nothing = np.zeros(0)
        return Equalities(rows, rows, nothing, nothing > 0.0, np.zeros((0, n)), nothing, np.zeros((0, 0)))
    free = np.where(fixed, 0.0, qp.A[rows])
    right = qp.lower[n + rows] - qp.A[rows] @ constant
    length = np.sqrt(np.einsum("ij,ij->i", free, free))
    # what the constants leave of a row may be no direction at all
    whole = np.sqrt(np.einsum("ij,ij->i", qp.A[rows], qp.A[rows]))
    usable = length > threshold * whole
    rest = np.where(usable[:, None], free / np.where(usable, length, 1.0)[:, None], 0.0)
    priority = np.zeros(rows.size, dtype=np.int_) if order is None else np.asarray(order)[rows]

    basis = np.zeros((min(rows.size, n), n))
    coordinates = np.zeros((rows.size, basis.shape[0]))
    chosen: list[int] = []
    for level in np.unique(priority):
        open_rows = (priority == level) & usable
        while len(chosen) < basis.shape[0]:
            sizes = np.where(open_rows, np.sqrt(np.einsum("ij,ij->i", rest, rest)), 0.0)
            pivot = int(np.argmax(sizes >= (1.0 - _TIE) * sizes.max(initial=0.0)))
            if sizes[pivot] <= threshold:
                break
            k = len(chosen)
            basis[k] = rest[pivot] / sizes[pivot]
            coordinates[pivot, k] = sizes[pivot]
            rest[pivot], open_rows[pivot] = 0.0, False
            chosen.append(pivot)
            # twice, so that rounding leaves nothing of the direction behind
            for _ in range(2):
                along = rest @ basis[k]
                rest -= along[:, None] * basis[k]
                coordinates[:, k] += along
    basis, kept = basis[: len(chosen)], np.array(chosen, dtype=np.intp)
    left = np.setdiff1d(np.arange(rows.size), kept)
    triangle = np.ascontiguousarray((coordinates * length[:, None])[kept, : kept.size])
    target = np.zeros(kept.size)
    for k in range(kept.size):
        target[k] = (right[kept[k]] - triangle[k, :k] @ target[:k]) / triangle[k, k]
    point = target @ basis
    inconsistency = np.abs(free[left] @ point - right[left])
    tolerance = _TOLERANCE + threshold * whole[left] * float(np.linalg.norm(point + constant))
    return Equalities(rows[kept], rows[left], inconsistency, inconsistency <= tolerance, basis, target, triangle)


def orthonormal(qp: QP, equalities: Equalities) -> QP:
    """The same problem for a solver: kept rows replaced by Q x = d, dropped rows set free, H strengthened.

    rho is the largest diagonal entry of H, so that H keeps its scale.
    """
    if equalities.kept.size + equalities.dropped.size == 0:
        return qp
    n = qp.n
    out = qp.copy()
    Q, d = equalities.basis, equalities.target
    rho = float(np.max(np.diagonal(qp.H), initial=0.0))
    out.H += rho * (Q.T @ Q)
    out.g -= rho * (d @ Q)
    out.A[equalities.kept] = Q
    out.lower[n + equalities.kept] = out.upper[n + equalities.kept] = d
    out.A[equalities.dropped] = 0.0
    out.lower[n + equalities.dropped], out.upper[n + equalities.dropped] = -np.inf, np.inf
    return out


def restore(qp: QP, equalities: Equalities, solution: QPSolution) -> QPSolution:
    """The solution of :func:`orthonormal` in terms of the rows of ``qp``; dropped rows get multiplier zero."""
    if equalities.kept.size + equalities.dropped.size == 0 or not solution.solved:
        return solution
    n = qp.n
    # where the rows hold only to rounding, the strengthened Hessian has carried part of the force
    rho = float(np.max(np.diagonal(qp.H), initial=0.0))
    gap = equalities.basis @ solution.x - equalities.target
    forces = solution.multipliers[n + equalities.kept] + rho * gap
    lam = solution.multipliers.copy()
    back = np.zeros(forces.size)
    for k in range(forces.size - 1, -1, -1):
        below = equalities.triangle[k + 1 :, k] @ back[k + 1 :]
        back[k] = (forces[k] - below) / equalities.triangle[k, k]
    lam[n + equalities.kept] = back
    lam[n + equalities.dropped] = 0.0
    fixed = np.flatnonzero(qp.lower[:n] == qp.upper[:n])
    if fixed.size:  # the basis has zeros in fixed columns: their multipliers take up the rest
        lam[fixed] = -(qp.H[fixed] @ solution.x + qp.g[fixed] + qp.A[:, fixed].T @ lam[n:])
    return QPSolution(solution.x, lam, solution.flag, solution.iterations)
