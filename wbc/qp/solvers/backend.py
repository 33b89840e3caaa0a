"""What every solver back end is: an object built once for n variables and m rows, then called each tick."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from wbc.errors import ShapeError
from wbc.qp.equalities import independent, orthonormal, restore
from wbc.qp.problem import QP, Flag, Solution
from wbc.validation import Array


class Backend(ABC):
    """A kept solver for QPs with ``n`` variables and ``m`` general rows.

    The answer depends on the problem and, with ``warm``, on nothing but the previous answer of the same
    object: the same sequence of problems gives the same sequence of bits.
    """

    name: str = ""

    def __init__(self, n: int, m: int) -> None:
        self.n = n
        self.m = m

    def solve(self, qp: QP, warm: bool = True) -> Solution:
        """Solve ``qp``; with ``warm`` start from the previous answer.

        Not-finite data give the flag ``failed``, crossed bounds ``infeasible``; neither changes the
        warm start. No answer contains NaN.

        Raises:
            ShapeError: the sizes are not those that the object was built for.
        """
        if qp.H.shape != (self.n, self.n) or qp.A.shape != (self.m, self.n):
            raise ShapeError("qp", (qp.n, qp.m), f"this solver was built for n = {self.n}, m = {self.m}")
        # one sum a block is the cheapest test for NaN and inf
        total = qp.H.sum() + qp.g.sum() + (qp.A.sum() if self.m else 0.0)
        if not np.isfinite(total) or np.isnan(qp.lower).any() or np.isnan(qp.upper).any():
            return refusal(qp, "failed")
        if (qp.lower > qp.upper).any():
            return refusal(qp, "infeasible")
        return self._solve(qp, warm)

    @abstractmethod
    def _solve(self, qp: QP, warm: bool) -> Solution:
        """Solve a problem with finite data and ordered bounds."""

    @abstractmethod
    def reset(self) -> None:
        """Forget the previous answer."""


def refusal(qp: QP, flag: Flag, iterations: int = 0) -> Solution:
    """An answer without a minimiser: the point of the box nearest to zero, zero multipliers."""
    n = qp.g.size
    with np.errstate(invalid="ignore"):
        x = np.minimum(np.maximum(0.0, qp.lower[:n]), qp.upper[:n])
    return Solution(np.where(np.isfinite(x), x, 0.0), np.zeros(qp.lower.size), flag, iterations)


def answer(qp: QP, x: Array, multipliers: Array, iterations: int) -> Solution:
    """A ``solved`` answer, or ``failed`` if any number in it is not finite."""
    if not np.isfinite(x.sum() + multipliers.sum()):
        return refusal(qp, "failed", iterations)
    return Solution(x, multipliers, "solved", iterations)


class Prepared(Backend):
    """Makes equality rows independent and orthonormal, calls ``inner``, and translates the multipliers back.

    A right side that contradicts other equality rows gives the flag ``infeasible`` without a call.
    """

    def __init__(self, inner: Backend) -> None:
        super().__init__(inner.n, inner.m)
        self.inner = inner
        self.name = inner.name

    def reset(self) -> None:
        self.inner.reset()

    def _solve(self, qp: QP, warm: bool) -> Solution:
        n = self.n
        if not np.any(qp.lower[n:] == qp.upper[n:]):
            return self.inner.solve(qp, warm)
        equalities = independent(qp)
        if not equalities.all_consistent:
            return refusal(qp, "infeasible")
        return restore(qp, equalities, self.inner.solve(orthonormal(qp, equalities), warm))
