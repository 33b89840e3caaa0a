"""DAQP: a dual active-set method for small dense problems (Arnstrom, Bemporad, Axehill, IEEE TAC 67(8), 2022).

The tolerances are tight because the default ones leave errors of 1e-4 rad/s in directions of small weight.
"""

from __future__ import annotations

from typing import Any

import daqp
import numpy as np

from wbc.qp.problem import QP, QPSolution
from wbc.qp.solvers.backend import Backend, answer, refusal

#: Settings of the wheel; ``eps_prox`` 0 switches the regularisation off (H is positive definite).
SETTINGS: dict[str, float] = {"primal_tol": 1e-11, "dual_tol": 1e-12, "eps_prox": 0.0, "iter_limit": 2000}

#: State of a row in the library: active at the upper bound
_UPPER = 1
#: State of a row in the library: active at the lower bound
_LOWER = 3
#: State of a row in the library: equality
_EQUALITY = 5
_INFINITE = 1e30


class Daqp(Backend):
    """One kept DAQP workspace; a warm start begins at the active set of the previous answer.

    If a warm start does not end in ``solved`` the problem is solved again from the empty set, so that a
    verdict never depends on the past.
    """

    name = "daqp"

    def __init__(self, n: int, m: int) -> None:
        super().__init__(n, m)
        # the library's update needs at least one general row: without any, one free row of zeros stands in
        size = n + max(m, 1)
        self._rows = np.zeros((max(m, 1), n))
        self._sense = np.zeros(size, dtype=np.int32)
        self._active = np.zeros(size, dtype=np.int32)
        self._lower = np.full(size, -_INFINITE)
        self._upper = np.full(size, _INFINITE)
        self._model: Any = daqp.Model()
        self._model.settings = SETTINGS
        self._model.setup(np.eye(n), np.zeros(n), self._rows, self._upper, self._lower, self._sense)

    def reset(self) -> None:
        self._active[:] = 0

    def _solve(self, qp: QP, warm: bool) -> QPSolution:
        size = self.n + self.m
        np.maximum(qp.lower, -_INFINITE, out=self._lower[:size])
        np.minimum(qp.upper, _INFINITE, out=self._upper[:size])
        rows = qp.A if self.m else self._rows
        equal = np.flatnonzero(qp.lower == qp.upper)
        iterations = 0
        starts = (True, False) if warm and self._active.any() else (False,)
        for from_last in starts:
            np.copyto(self._sense, self._active if from_last else 0)
            self._sense[equal] = _EQUALITY
            exit_flag = self._model.update(qp.H, qp.g, rows, self._upper, self._lower, self._sense)
            if exit_flag < 0:
                continue
            x, _, exit_flag, info = self._model.solve()
            iterations += int(info["iterations"])
            if exit_flag == 1:
                solution = answer(qp, np.array(x), np.array(info["lam"][:size]), iterations)
                if solution.solved:
                    lam = solution.multipliers
                    self._active[:size] = np.where(lam > 0.0, _UPPER, np.where(lam < 0.0, _LOWER, 0))
                return solution
        return refusal(qp, "infeasible" if exit_flag == -1 else "failed", iterations)
