"""Extended Jacobian."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc import validation
from wbc.errors import RangeError
from wbc.resolvers.problem import RateProblem, checked, damped_inverse, solved
from wbc.validation import Array


@dataclass(frozen=True)
class ExtendedJacobian:
    """[J_T; J_C] v = [v_T; v_C], as many rows as joints; with damping in the least-squares sense.

    Attributes:
        damping: >= 0; 0 refuses algorithmic singularities.

    Source: S. Y. Oh, D. Orin and M. Bach, 1984; J. Baillieul, 1985; damped: O. Egeland, 1991.
    """

    damping: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "damping", validation.scalar("damping", self.damping, low=0.0))

    def resolve(self, problem: RateProblem) -> Array:
        """See the class.

        Raises:
            RangeError: not as many rows as joints, or a singular matrix without damping.
        """
        checked(problem)
        second, rates = problem.rows
        J, right = np.vstack((problem.task, second)), np.concatenate((problem.wanted, rates))
        if J.shape[0] != problem.joints:
            raise RangeError("second", len(second), f"expected {problem.joints} rows in all, not {J.shape[0]}")
        if self.damping > 0.0:
            return np.asarray(damped_inverse(J, self.damping) @ right)
        return solved(J, right, "extended Jacobian")
