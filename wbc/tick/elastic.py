"""A tick in which every row may give at one high price: it has an answer wherever the actuators leave one."""

from __future__ import annotations

import numpy as np

from wbc.qp.problem import QP
from wbc.qp.relax import Relaxed
from wbc.qp.solvers.backend import Prepared
from wbc.qp.solvers.daqp import Daqp
from wbc.stack.declaration import Declaration
from wbc.stack.layout import Layout
from wbc.tick.buffers import BRAKED, RELAXED
from wbc.tick.native import CompiledTick
from wbc.tick.solved import SolvedTick
from wbc.validation import Array

#: Price of a squared slack of one unit, against the largest diagonal entry of H
_PRICE = 1e6
#: Damping of the search for slacks with strict levels, against the same
_STEADY = 1e-3


class ElasticTick(SolvedTick):
    """minimise 1/2 v'Hv + g'v + price/2 |s|^2 over v within its bounds, lower <= A_i v + unit_i s_i <= upper.

    Rows of the class of the actuators have no slack. The order of sacrifice plays no part. The certificate is that of
    the problem whose bounds have been moved by the slack.
    """

    def __init__(self, assembly: CompiledTick, stack: Declaration, layout: Layout) -> None:
        super().__init__(assembly, stack, layout, "daqp")
        self._wide = Prepared(Daqp(layout.with_slacks + layout.general_rows, layout.general_rows))

    def answer(self, qp: QP) -> tuple[int, Array, Relaxed | None]:
        n, m = qp.n, qp.m
        nothing = BRAKED, self.rest(qp), None
        if not self.assembly.usable:
            return nothing
        bounded, crossed = self._uncrossed(qp)
        if crossed[self._orders == 0].any():
            return nothing
        dofs = np.ones(n) if self._dof_scales is None else self._dof_scales
        unit, soft = self._units, self._orders > 0
        H = bounded.H * np.outer(dofs, dofs)
        if self.levels is not None:
            # the first level leaves directions to others, which begin anew within the bounds that are found here
            H[np.diag_indices(n)] += _STEADY * float(np.diag(H).max(initial=1.0))
        # a slack counted in units of 1 / sqrt(_PRICE) costs what v does: the solver sees no other scale
        price = float(np.diag(H).max())
        wide = np.zeros((n + m, n + m))
        wide[:n, :n] = H
        wide[range(n, n + m), range(n, n + m)] = price
        free = np.where(soft, np.inf, 0.0)
        ends = np.concatenate((dofs, unit))
        problem = QP(
            wide,
            np.concatenate((bounded.g * dofs, np.zeros(m))),
            np.concatenate((bounded.lower[:n] / dofs, -free, bounded.lower[n:] / unit)),
            np.concatenate((bounded.upper[:n] / dofs, free, bounded.upper[n:] / unit)),
            np.hstack((bounded.A * dofs / unit[:, None], np.eye(m) / np.sqrt(_PRICE))),
        )
        found = self._wide.solve(problem, warm=False)
        if not found.solved:
            return nothing
        x = np.clip(found.x[:n] * dofs, bounded.lower[:n], bounded.upper[:n])
        at, lower, upper = bounded.A @ x, bounded.lower.copy(), bounded.upper.copy()
        lower[n:], upper[n:] = np.minimum(lower[n:], at), np.maximum(upper[n:], at)
        multipliers = np.concatenate((found.multipliers[:n], found.multipliers[n + m :])) / ends
        zero = np.zeros(m)
        return RELAXED, x, Relaxed(x, multipliers, "relaxed", zero, zero > 0, lower, upper, found.iterations)
