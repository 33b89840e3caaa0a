"""How the minimiser of a QP moves with its data, through its active set.

On the active set S the minimiser obeys H x + g + C_S' lam = 0 and C_S x = b_S. Differentiated:

    H dx + C_S' dlam = -(dH x + dg + dC_S' lam),      C_S dx = db_S - dC_S x.

The derivative is that of the side on which the set stays what it is. Where a multiplier and a distance vanish
together the minimiser has a kink, and other directions have another derivative.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.errors import SolverError
from wbc.qp.factor import ActiveRows, Factor, active_bounds
from wbc.qp.problem import QP, QPSolution
from wbc.validation import Array

#: What rounding leaves of a difference, times what it was made of
_NOISE = 32.0 * float(np.finfo(float).eps)


@dataclass(frozen=True, eq=False)
class Squares:
    """H and g of one QP or of several, made of rows: H = J'WJ + rest, g = -J'W d + rest.

    Attributes:
        H: [..., n, n]. g: [..., n]. J: [..., m, n]. weight, desired: diagonal of W, and d [..., m].
    """

    H: Array
    g: Array
    J: Array
    weight: Array
    desired: Array

    def missed(self, x: Array) -> Array:
        """W (J x - d) [..., m]."""
        return np.asarray(self.weight * (_along(self.J, x) - self.desired))

    def rest(self, x: Array) -> tuple[Array, Array]:
        """(what H x + g has beside J'W (J x - d), the size of what it is the difference of) [..., n]."""
        whole, size = np.abs(self.J), np.abs(self.g) + _along(np.abs(self.H), np.abs(x))
        rows = self.weight * (_along(whole, np.abs(x)) + np.abs(self.desired))
        rest = _along(self.H, x) + self.g - _across(self.J, self.missed(x))
        return rest, size + _across(whole, rows)


def force_between(up: Squares, middle: Squares, down: Squares, x: Array) -> Array:
    """Difference of H x + g between two QPs about a third [..., n], by the rows that H and g are made of:

        (J_+ - J_-)' W (J x - d) + J' (W (J x - d)_+ - W (J x - d)_-) + that of the rest

    The second term is in the range of J' whatever step lies between: along directions that no row has, where H is next
    to nothing, differences of H and g themselves are noise and terms of the step's third order.
    """
    (above, large), (below, small) = up.rest(x), down.rest(x)
    rest = above - below
    rest = np.where(np.abs(rest) > _NOISE * np.maximum(large, small), rest, 0.0)
    turned = _across(up.J - down.J, middle.missed(x))
    return np.asarray(turned + _across(middle.J, up.missed(x) - down.missed(x)) + rest)


def _along(rows: Array, x: Array) -> Array:
    return np.asarray((rows @ x[..., None])[..., 0])


def _across(rows: Array, force: Array) -> Array:
    return np.asarray((force[..., None, :] @ rows)[..., 0, :])


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
        return self.changes(force, offset)[0]

    def changes(self, force: Array, offset: Array) -> tuple[Array, Array]:
        """:meth:`change`, and that of the multipliers of [1; C] [n + m, k]."""
        factor, rows = self._factor, self._rows
        out, multipliers = np.zeros(force.shape), np.zeros(offset.shape)
        for k in range(force.shape[1]):
            dy, multipliers[rows.index, k] = rows.solve(-factor.inverse.T @ force[:, k], offset[rows.index, k])
            out[:, k] = factor.inverse @ dy
        return out, multipliers

    def to_bound(self, row: int) -> Array:
        """dx / db of the bound that holds a row of [1; A]; zero for rows that hold nothing [n]."""
        offset = np.zeros((self._size, 1))
        offset[row] = 1.0
        return self.change(np.zeros((self._factor.R.shape[0], 1)), offset)[:, 0]
