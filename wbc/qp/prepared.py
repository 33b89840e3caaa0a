"""A solver behind the preparation of equality rows: what the controller holds."""

from __future__ import annotations

import numpy as np

from wbc.qp.backend import Backend, refusal
from wbc.qp.equalities import independent, orthonormal, restore
from wbc.qp.problem import QP, Solution


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
