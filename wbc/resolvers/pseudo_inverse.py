"""Weighted and damped pseudo-inverse."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc import validation
from wbc.errors import RangeError, ShapeError
from wbc.resolvers.problem import RateProblem, checked, damped_inverse
from wbc.validation import Array


@dataclass(frozen=True, eq=False)
class PseudoInverse:
    """v = A^-1 J' (J A^-1 J' + damping I)^-1 v_T: the least v'A v, or with damping the least
    |J v - v_T|^2 + damping v'A v. With A the inertia that is the least kinetic energy.

    Attributes:
        weight: A, symmetric and positive definite [m, m], or its diagonal [m]; None: the identity.
        damping: >= 0.

    Source: D. E. Whitney, 1969; damped: C. W. Wampler, 1986, Y. Nakamura and H. Hanafusa, 1986.

    Raises:
        ShapeError, RangeError: a weight that is no such matrix, negative damping.
    """

    weight: Array | None = None
    damping: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "damping", validation.scalar("damping", self.damping, low=0.0))
        if self.weight is None:
            return
        A = validation.ordinary_array("weight", self.weight)
        A = np.diag(A) if A.ndim == 1 else A
        if A.ndim != 2 or A.shape[0] != A.shape[1] or not A.size or not np.allclose(A, A.T):
            raise ShapeError("weight", self.weight, "expected a symmetric matrix, or its diagonal")
        if np.linalg.eigvalsh(A)[0] <= 0.0:
            raise RangeError("weight", self.weight, "expected a positive definite matrix")
        object.__setattr__(self, "weight", A)

    def resolve(self, problem: RateProblem) -> Array:
        """See the class; second rows are not used."""
        checked(problem)
        if self.weight is None:
            return np.asarray(damped_inverse(problem.task, self.damping) @ problem.wanted)
        if self.weight.shape[0] != problem.joints:
            raise ShapeError("weight", self.weight.shape, f"expected {problem.joints} joints")
        # With A = L L' and u = L' v it is the plain one of J L'^-1
        back = np.linalg.inv(np.linalg.cholesky(self.weight).T)
        return np.asarray(back @ damped_inverse(problem.task @ back, self.damping) @ problem.wanted)
