"""Two tasks in their order."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc import validation
from wbc.errors import RangeError
from wbc.resolvers.problem import RateProblem, checked, damped_inverse
from wbc.validation import Array


@dataclass(frozen=True)
class TaskPriority:
    """v = J_T# v_T + (J_C N)# (v_C - J_C J_T# v_T), N = I - J_T# J_T: the second rows within what the task leaves.

    Attributes:
        damping: of the second pseudo-inverse, >= 0; for problems where J_C N loses rank (algorithmic singularities).

    Source: Y. Nakamura, H. Hanafusa and T. Yoshikawa, 1987; A. A. Maciejewski and C. A. Klein, 1985.
    """

    damping: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "damping", validation.scalar("damping", self.damping, low=0.0))

    def resolve(self, problem: RateProblem) -> Array:
        """See the class.

        Raises:
            RangeError: no second rows.
        """
        checked(problem)
        second, rates = problem.rows
        if not len(second):
            raise RangeError("second", 0, "task priority needs second rows")
        inverse = damped_inverse(problem.task, 0.0)
        first = inverse @ problem.wanted
        left = np.eye(problem.joints) - inverse @ problem.task
        out: Array = first + left @ damped_inverse(second @ left, self.damping) @ (rates - second @ first)
        return out
