"""Classical rate resolution: pseudo-inverse, gradient projection, given joints, two tasks by priority or exactly."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from wbc import validation
from wbc.errors import RangeError, ShapeError
from wbc.resolvers.problem import RateProblem, checked, damped_inverse, solved
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


@dataclass(frozen=True, eq=False)
class GradientProjection:
    """v = J# v_T + (J# J - I) z: the task, and within it down the gradient z of a criterion h(q).

    Attributes:
        gradient: z [m] at the present configuration.

    Source: A. Liegeois, 1977.

    Raises:
        ShapeError, NotFiniteError: no vector.
    """

    gradient: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "gradient", validation.ordinary_array("gradient", self.gradient))

    def resolve(self, problem: RateProblem) -> Array:
        """See the class; second rows are not used."""
        checked(problem)
        z = validation.ordinary_array("gradient", self.gradient, (problem.joints,))
        inverse = damped_inverse(problem.task, 0.0)
        out: Array = inverse @ (problem.wanted + problem.task @ z) - z
        return out


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
