"""How the minimiser of a QP moves with its data, through its active set.

On the active set S the minimiser obeys H x + g + C_S' lam = 0 and C_S x = b_S. Differentiated:

    H dx + C_S' dlam = -(dH x + dg + dC_S' lam),      C_S dx = db_S - dC_S x.

The derivative is that of the side on which the set stays what it is. Where a multiplier and a distance vanish
together the minimiser has a kink, and other directions have another derivative.
"""

from __future__ import annotations

import numpy as np

from wbc.errors import SolverError
from wbc.qp.factor import ActiveRows, Factor, active_bounds
from wbc.qp.problem import QP, QPSolution
from wbc.validation import Array


class Sensitivity:
    """Derivatives of the minimiser of ``qp``, whose solution is given.

    Attributes:
        active: rows of [1; A] that hold the minimiser and are independent of each other.

    Raises:
        SolverError: H is not positive definite.
    """

    def __init__(self, qp: QP, solution: QPSolution) -> None:
        self._factor = Factor(qp)
        if not self._factor.definite:
            raise SolverError("qp", "H", "is not positive definite, so the minimiser has no derivative")
        self._size = qp.n + qp.m
        self._rows = ActiveRows(self._factor, active_bounds(qp, self._factor, solution), solution.multipliers)
        self.active = self._rows.index

    def change(self, force: Array, offset: Array) -> Array:
        """dx [n, k] for k changes: ``force`` = dH x + dg + dC' lam [n, k], ``offset`` = db - dC x [n + m, k]."""
        factor, rows = self._factor, self._rows
        out = np.zeros(force.shape)
        for k in range(force.shape[1]):
            dy, _ = rows.solve(-factor.inverse.T @ force[:, k], offset[rows.index, k])
            out[:, k] = factor.inverse @ dy
        return out

    def to_bound(self, row: int) -> Array:
        """dx / db of the bound that holds a row of [1; A]; zero for rows that hold nothing [n]."""
        offset = np.zeros((self._size, 1))
        offset[row] = 1.0
        return self.change(np.zeros((self._factor.R.shape[0], 1)), offset)[:, 0]
