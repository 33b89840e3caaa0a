"""Shared linear algebra of polish and certificate: the factor of H, the rows seen through it, exact residuals.

With H = R'R and y = R x the Hessian becomes the identity, and row i of [1; A] becomes M_i = C_i R^-1. All
distances between rows, and between a point and a row, are measured in y. Residuals are summed in the
widest hardware type (``numpy.longdouble``), because in double they would drown in their own rounding
where H has weights of 1 beside weights of 1e-6.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbc.qp.problem import QP, QPSolution
from wbc.validation import Array

Wide = NDArray[np.longdouble]

#: Unit roundoff of the residual arithmetic (5e-20 where long double has 64 bits) and of double
WIDE_ROUNDOFF = float(np.finfo(np.longdouble).eps) / 2.0
ROUNDOFF = float(np.finfo(np.float64).eps) / 2.0

#: A row closer than this (relative, in y) to the span of the rows before it counts as dependent on them
DEPENDENT = 1e-9


class Factor:
    """R^-1 and the rows M = [1; A] R^-1 of a QP.

    Attributes:
        definite: False if the Cholesky factorisation of H broke down; then nothing else is set.
        R: upper triangular, H = R'R [n, n].
        inverse: R^-1 [n, n].
        rows: M [n + m, n].
        norms: Euclidean norms of the rows of M [n + m].
        wide_H, wide_C: H and [1; A] as long double, for residuals.
    """

    def __init__(self, qp: QP) -> None:
        try:
            self.R: Array = np.linalg.cholesky(qp.H).T.astype(np.float64, copy=False)
        except np.linalg.LinAlgError:
            self.definite = False
            return
        self.definite = bool(np.isfinite(self.R).all())
        if not self.definite:
            return
        self.inverse: Array = _upper_solve(self.R, np.eye(qp.n))
        self.rows: Array = np.vstack((self.inverse, qp.A @ self.inverse))
        self.norms: Array = np.sqrt(np.einsum("ij,ij->i", self.rows, self.rows))
        self.wide_H: Wide = qp.H.astype(np.longdouble)
        self.wide_A: Wide = qp.A.astype(np.longdouble)

    def stationarity(self, qp: QP, x: Any, multipliers: Any) -> Wide:
        """H x + g + [1; A]' lam in long double [n]."""
        lam = multipliers.astype(np.longdouble)
        n = qp.n
        out: Wide = self.wide_H @ x.astype(np.longdouble) + qp.g + lam[:n] + self.wide_A.T @ lam[n:]
        return out

    def rows_at(self, x: Any) -> Wide:
        """[1; A] x in long double [n + m]."""
        wide = x.astype(np.longdouble)
        return np.concatenate((wide, self.wide_A @ wide))


def active_bounds(qp: QP, factor: Factor, solution: QPSolution) -> NDArray[np.int8]:
    """The guessed active set: +1 at the upper bound, -1 at the lower, +2 equality, 0 inactive [n + m].

    Seen through the factor, dropping the multiplier of row i moves y by |lam_i| |M_i|, and moving the
    point onto the row moves it by slack_i / |M_i|. The row counts as active if the second is the smaller
    step: lam_i |M_i|^2 > slack_i. A violated row (slack < 0) is active.
    """
    at = qp.rows_at(solution.x)
    push = solution.multipliers * factor.norms**2
    out = np.zeros(at.size, dtype=np.int8)
    out[push > qp.upper - at] = 1
    out[-push > at - qp.lower] = -1
    out[qp.lower == qp.upper] = 2
    return out


class ActiveRows:
    """QR of the active rows: M_S' = Q T; rows that depend on earlier ones are left out.

    Rows enter in a stated order: equalities, then by falling |lam| |M|, ties by index.

    Attributes:
        index: the independent active rows, in their order [k].
        dependent: active rows left out.
        Q: orthonormal columns [n, k]; T: upper triangular [k, k].
    """

    def __init__(self, factor: Factor, held: NDArray[np.int8], multipliers: Array) -> None:
        active = np.flatnonzero(held)
        order = np.lexsort((active, -np.abs(multipliers[active]) * factor.norms[active], held[active] != 2))
        index = active[order]
        empty = factor.norms[index] == 0.0
        self.dependent = index[empty]
        index = index[~empty]
        while True:
            self.Q, self.T = np.linalg.qr(factor.rows[index].T)
            diagonal = np.abs(np.diagonal(self.T))
            weak = np.ones(index.size, dtype=np.bool_)
            weak[: diagonal.size] = diagonal <= DEPENDENT * factor.norms[index[: diagonal.size]]
            if not weak.any():
                break
            self.dependent = np.concatenate((self.dependent, index[weak]))
            index = index[~weak]
        self.index = index

    def solve(self, force: Array, offset: Array) -> tuple[Array, Array]:
        """(dy, mu) with dy + M_S' mu = force and M_S dy = offset: one step of the active-set KKT system."""
        if self.index.size == 0:
            return force, np.zeros(0)
        along = _upper_solve(self.T.T[::-1, ::-1], offset[::-1])[::-1]
        inside = self.Q.T @ force
        dy = force + self.Q @ (along - inside)
        mu = _upper_solve(self.T, inside - along)
        return dy, mu

    def inverse_norm(self) -> float:
        """Frobenius norm of T^-1, at least 1 / (smallest singular value of M_S)."""
        if self.index.size == 0:
            return 0.0
        return float(np.linalg.norm(_upper_solve(self.T, np.eye(self.index.size))))


def _upper_solve(T: Array, b: Array) -> Array:
    """T^-1 b for an upper triangular T [n, n] without a zero on its diagonal.

    The elimination of such a matrix exchanges no rows and its other factor is the identity, so what numpy does is
    the substitution; a solver for triangular matrices would be scipy's, whose import takes longer than most sessions.
    """
    return np.linalg.solve(T, b).astype(np.float64, copy=False)
