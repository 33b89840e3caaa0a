"""Rank reduction: some joints are given, the others serve the task."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from wbc import validation
from wbc.errors import RangeError
from wbc.resolvers.problem import RateProblem, checked, solved
from wbc.validation import Array


@dataclass(frozen=True, eq=False)
class RankReduction:
    """v_R = J_R^-1 (v_T - J_A v_A): the joints A have given rates, the others follow.

    Attributes:
        given: indices of the joints A; None: those that leave the best conditioned J_R.
        rates: v_A, zero by default.

    Source: B. Benhabib, A. A. Goldenberg and R. G. Fenton, 1985; V. Lovass-Nagy and R. J. Schilling, 1987.
    """

    given: tuple[int, ...] | None = None
    rates: Array | None = None

    def resolve(self, problem: RateProblem) -> Array:
        """See the class; second rows are not used.

        Raises:
            ShapeError, RangeError: indices that do not leave a square J_R, or a singular one.
        """
        checked(problem)
        m, n = problem.joints, problem.task.shape[0]
        chosen = self._best(problem.task) if self.given is None else self._chosen(m)
        if len(set(chosen)) != m - n or not set(chosen) <= set(range(m)):
            raise RangeError("given", chosen, f"expected {m - n} different joints of 0 to {m - 1}")
        out, rest = np.zeros(m), [k for k in range(m) if k not in chosen]
        if self.rates is not None:
            out[list(chosen)] = validation.ordinary_array("rates", self.rates, (len(chosen),))
        out[rest] = solved(problem.task[:, rest], problem.wanted - problem.task @ out, "J_R")
        return out

    def _chosen(self, joints: int) -> tuple[int, ...]:
        return tuple(
            validation.integer("given", k, high=joints - 1) for k in validation.items("given", self.given, "joints")
        )

    def _best(self, J: Array) -> tuple[int, ...]:
        """Joints without which the least singular value stays largest."""
        n, m = J.shape
        least = {
            chosen: float(np.linalg.svd(np.delete(J, chosen, axis=1), compute_uv=False)[-1])
            for chosen in combinations(range(m), m - n)
        }
        return max(least, key=lambda chosen: least[chosen])
