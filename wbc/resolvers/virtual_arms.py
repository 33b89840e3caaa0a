"""Virtual arms, one at a time as the task, the others as constraints."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.errors import RangeError
from wbc.resolvers.problem import RateProblem, checked, solved
from wbc.validation import Array


@dataclass(frozen=True)
class VirtualArms:
    """The least |J_T v - v_T| with J_C v = v_C exactly, by elimination:

        v_1 = J_C1^-1 (v_C - J_C2 v_2),    J_T+ = J_T2 - J_T1 J_C1^-1 J_C2,    v_T+ = v_T - J_T1 J_C1^-1 v_C,
        v_2 = the least squares of J_T+ v_2 = v_T+

    The dependent joints 1 are those that column pivoting finds first, so that J_C1 is well conditioned.

    Source: T. Tsuji, 1990; E. Dupuis, PhD thesis, McGill University, 2001, appendix B, eqs. B.3 to B.15.
    """

    def resolve(self, problem: RateProblem) -> Array:
        """See the class.

        Raises:
            RangeError: no constraint rows, as many as joints, or dependent ones.
        """
        checked(problem)
        held, rates = problem.rows
        p, m = held.shape
        if not 0 < p < m:
            raise RangeError("second", p, f"expected 1 to {m - 1} constraint rows")
        from scipy.linalg import qr

        order = np.asarray(qr(held, mode="r", pivoting=True)[1])
        first, second = order[:p], order[p:]
        through = solved(held[:, first], np.column_stack((rates, held[:, second])), "J_C1")
        free = problem.task[:, second] - problem.task[:, first] @ through[:, 1:]
        left = problem.wanted - problem.task[:, first] @ through[:, 0]
        out = np.zeros(m)
        out[second] = np.linalg.lstsq(free, left, rcond=None)[0]
        out[first] = through[:, 0] - through[:, 1:] @ out[second]
        return out
