"""OSQP: operator splitting (Stellato et al., Math. Prog. Comp. 12, 2020), kept, warm-started and polished.

Splitting alone leaves errors of 1e-5 rad/s in directions of small weight; its answer serves as the guess
of an active set, and :func:`wbc.qp.polishing.polish` brings it to rounding level.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import osqp
from scipy import sparse

from wbc.qp.polishing import polish
from wbc.qp.problem import QP, QPSolution
from wbc.qp.solvers.backend import Backend, refusal

#: Tolerances of the two attempts: the second only if the active set of the first could not be corrected
TOLERANCES = (1e-5, 1e-9)
_SETTINGS: dict[str, Any] = {
    "verbose": False,
    "polishing": False,
    "warm_starting": True,
    "max_iter": 4000,
    "check_termination": 25,
    # a fixed interval in iterations, not in measured time: the same problem gives the same bits
    "adaptive_rho_interval": 50,
    "eps_prim_inf": 1e-9,
    "eps_dual_inf": 1e-9,
}
_SOLVED = {"solved", "solved inaccurate", "maximum iterations reached"}
_INFEASIBLE_STATUSES = {"primal infeasible", "primal infeasible inaccurate"}


class Osqp(Backend):
    """One kept OSQP workspace with full patterns of H and [1; A], values updated in place.

    Cannot do: large sparse problems at their sparsity; the patterns here are those of one tick, dense.
    """

    name = "osqp"

    def __init__(self, n: int, m: int) -> None:
        super().__init__(n, m)
        self._upper_triangle = np.tril_indices(n)[::-1]  # column by column, as OSQP stores it
        H = sparse.csc_matrix(np.triu(np.ones((n, n))))
        H.data[:] = np.eye(n)[self._upper_triangle]
        self._columns = np.empty((n, 1 + m))
        self._columns[:, 0] = 1.0
        starts = np.arange(n + 1) * (1 + m)
        indices = np.column_stack((np.arange(n), np.tile(n + np.arange(m), (n, 1)))).ravel()
        values = np.zeros((n, 1 + m))
        values[:, 0] = 1.0
        C = sparse.csc_matrix((values.ravel(), indices, starts), shape=(n + m, n))
        # Named: looking for other algebras takes longer than all the rest, and theirs would give other bits
        self._solver: Any = osqp.OSQP(algebra="builtin")
        far = np.full(n + m, 1e30)
        self._solver.setup(H, np.zeros(n), C, -far, far, eps_abs=TOLERANCES[0], eps_rel=TOLERANCES[0], **_SETTINGS)
        self._rho = float(self._solver.settings.rho)

    def reset(self) -> None:
        self._solver.warm_start(x=np.zeros(self.n), y=np.zeros(self.n + self.m))
        self._solver.update_settings(rho=self._rho)

    def _solve(self, qp: QP, warm: bool) -> QPSolution:
        if not warm:
            self.reset()
        self._columns[:, 1:] = qp.A.T
        self._solver.update(q=qp.g, l=qp.lower, u=qp.upper)
        self._solver.update(Px=qp.H[self._upper_triangle], Ax=self._columns.ravel())
        iterations = 0
        for tolerance in TOLERANCES:
            self._solver.update_settings(eps_abs=tolerance, eps_rel=tolerance)
            result = self._solver.solve(raise_error=False)
            iterations += int(result.info.iter)
            if result.info.status in _INFEASIBLE_STATUSES:
                self.reset()
                return refusal(qp, "infeasible", iterations)
            if result.info.status not in _SOLVED or not np.isfinite(result.x.sum() + result.y.sum()):
                break
            polished = polish(qp, QPSolution(np.array(result.x), np.array(result.y), "solved"))
            if polished.exact:
                solution = polished.solution
                self._solver.warm_start(x=solution.x, y=solution.multipliers)
                return QPSolution(solution.x, solution.multipliers, "solved", iterations)
        self.reset()
        return refusal(qp, "failed", iterations)
