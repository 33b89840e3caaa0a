"""The quadratic program of one tick and what a solver answers.

    minimise 1/2 x'H x + g'x    subject to    lower <= [1; A] x <= upper

The first n entries of ``lower`` and ``upper`` are simple bounds on x, the other m belong to the rows of
A. Infinite entries mean "no bound"; an entry with lower == upper is an equality. With the multipliers
lam (positive where an upper bound pushes, negative where a lower bound pushes) the optimum satisfies

    H x + g + [1; A]' lam = 0.
"""

from __future__ import annotations

from dataclasses import field
from typing import Any, Literal

import numpy as np

from wbc import validation
from wbc.errors import BoundsError, NotFiniteError, RangeError
from wbc.quick_dataclasses import dataclass
from wbc.validation import Array

Flag = Literal["solved", "infeasible", "failed"]


@dataclass(eq=False, slots=True)
class QP:
    """A strictly convex quadratic program; the arrays may be buffers that are filled anew each tick.

    Attributes:
        H: symmetric positive definite [n, n], float64, C-contiguous.
        g: [n].
        lower, upper: [n + m], simple bounds first; +-inf where there is none.
        A: rows [m, n].
        give: of soft rows, by how much they give way per multiplier: lower <= A x - give lam <= upper, at the cost
            give lam^2 / 2; 0 for hard rows, any number for rows without sides [m]. None: all rows are hard.
    """

    H: Array
    g: Array
    lower: Array
    upper: Array
    A: Array
    give: Array | None = None

    @property
    def n(self) -> int:
        """Number of variables."""
        return int(self.H.shape[0])

    @property
    def m(self) -> int:
        """Number of general rows."""
        return int(self.A.shape[0])

    @classmethod
    def checked(cls, H: Any, g: Any, lower: Any, upper: Any, A: Any = None) -> QP:
        """A QP from any array-likes, copied and checked.

        Raises:
            ShapeError, NotFiniteError: wrong shapes; NaN anywhere; infinite entries in H, g or A.
            RangeError: H is not symmetric (to 1e-12 of its largest entry).
            BoundsError: a lower bound above its upper bound, or a bound that is infinite on the wrong side.
        """
        matrix = validation.real_array("H", H)
        n = matrix.shape[0] if matrix.ndim else 0
        matrix = validation.real_array("H", matrix, (n, n))
        if n and np.abs(matrix - matrix.T).max() > 1e-12 * np.abs(matrix).max():
            raise RangeError("H", H, "expected a symmetric matrix")
        rows = np.zeros((0, n)) if A is None else validation.real_array("A", A)
        rows = validation.real_array("A", rows, (rows.shape[0] if rows.ndim else 0, n))
        size = n + rows.shape[0]
        low = validation.real_array("lower", lower, (size,), finite=False)
        high = validation.real_array("upper", upper, (size,), finite=False)
        for name, bound in (("lower", low), ("upper", high)):
            if np.isnan(bound).any():
                raise NotFiniteError(name, bound, "NaN is no bound; use +-inf where there is none")
        bad = np.flatnonzero((low > high) | (low == np.inf) | (high == -np.inf))
        if bad.size:
            i = int(bad[0])
            raise BoundsError(f"lower[{i}]", float(low[i]), f"no value satisfies it together with upper {high[i]:g}")
        return cls(matrix, validation.real_array("g", g, (n,)), low, high, rows)

    def rows_at(self, x: Array) -> Array:
        """[1; A] x, n + m numbers."""
        return np.concatenate((x, self.A @ x))

    def violation(self, x: Array) -> Array:
        """By how much each bound is exceeded at ``x``, >= 0, in the units of its row [n + m]."""
        at = self.rows_at(x)
        return np.asarray(np.maximum(0.0, np.maximum(self.lower - at, at - self.upper)))

    def copy(self) -> QP:
        """Independent copies of all arrays."""
        give = None if self.give is None else self.give.copy()
        return QP(self.H.copy(), self.g.copy(), self.lower.copy(), self.upper.copy(), self.A.copy(), give)

    def with_slacks(self) -> QP:
        """The same problem with hard rows only: each soft row has a variable s at the cost s^2 / 2, after the others.

        lower <= a x + sqrt(give) s <= upper. Its place among the rows, and its multiplier, stay.
        """
        if self.give is None or not self.give.any():
            return QP(self.H, self.g, self.lower, self.upper, self.A)
        soft, n = np.flatnonzero(self.give), self.n
        wide = n + soft.size
        H, A, free = np.eye(wide), np.zeros((self.m, wide)), np.full(soft.size, np.inf)
        H[:n, :n], A[:, :n] = self.H, self.A
        A[soft, n + np.arange(soft.size)] = np.sqrt(self.give[soft])
        lower, upper = (
            np.concatenate((ends[:n], sign * free, ends[n:])) for ends, sign in ((self.lower, -1.0), (self.upper, 1.0))
        )
        return QP(H, np.concatenate((self.g, np.zeros(soft.size))), lower, upper, A)

    def definite(self) -> QP:
        """The same with 16 n u of its diagonal added to H where rounding makes that indefinite; u = 2^-53."""
        H = definite(self.H)
        return self if H is self.H else QP(H, self.g, self.lower, self.upper, self.A, self.give)

    def hard(self) -> QP:
        """The same without the sides of soft rows."""
        if self.give is None:
            return self
        open_ends = np.concatenate((np.zeros(self.n, dtype=np.bool_), self.give > 0.0))
        lower, upper = np.where(open_ends, -np.inf, self.lower), np.where(open_ends, np.inf, self.upper)
        return QP(self.H, self.g, lower, upper, self.A)

    def rows_of(self, wide: Array) -> Array:
        """Of numbers of [1; A] of :meth:`with_slacks` those that this problem has."""
        return np.concatenate((wide[: self.n], wide[wide.size - self.m :]))


def definite(matrix: Array) -> Array:
    """A symmetric matrix, with rounding of its diagonal added until it is positive definite by more than rounding.

    A pivot of the Cholesky factor that is rounding may be an exact zero to another factorisation of the same matrix.
    """
    rounding = len(matrix) * 2.0**-53
    more = 16.0 * rounding
    out = matrix
    for _ in range(8):
        try:
            pivots = np.linalg.cholesky(out).diagonal() ** 2
        except np.linalg.LinAlgError:
            pivots = np.zeros(len(matrix))
        if (pivots > rounding * matrix.diagonal()).all():
            break
        out = out + np.diag(more * matrix.diagonal() + more * 1e-3 * np.abs(matrix).max(initial=0.0))
        more *= 10.0
    return out


@dataclass(frozen=True, eq=False, slots=True)
class QPSolution:
    """What a solver answers; never contains NaN.

    Attributes:
        x: the minimiser [n] if ``flag`` is ``solved``; otherwise the point of the box of simple bounds
            that is nearest to zero.
        multipliers: [n + m], > 0 at an upper bound, < 0 at a lower bound; zeros if not solved.
        flag: ``solved``; ``infeasible``: no x satisfies all rows; ``failed``: no verdict.
        iterations: of the solver, in its own count.
    """

    x: Array
    multipliers: Array
    flag: Flag
    iterations: int = field(default=0)

    @property
    def solved(self) -> bool:
        """True if ``x`` is the minimiser."""
        return self.flag == "solved"
