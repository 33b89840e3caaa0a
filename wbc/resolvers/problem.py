"""What every resolver is given at one configuration, and what it answers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from wbc import validation
from wbc.errors import RangeError, ShapeError
from wbc.validation import Array


@dataclass(frozen=True, eq=False)
class RateProblem:
    """J_T v = v_T, and second rows J_C v = v_C where a resolver uses them.

    Attributes:
        task: J_T [n, m]. wanted: v_T [n]. second: J_C [p, m], by default none. second_rates: v_C [p], zero by default.

    Raises:
        ShapeError, NotFiniteError: matrices and rates that do not fit.
    """

    task: Array
    wanted: Array
    second: Array | None = None
    second_rates: Array | None = None

    def __post_init__(self) -> None:
        put = object.__setattr__
        task = validation.ordinary_array("task", self.task)
        if task.ndim != 2 or not task.size:
            raise ShapeError("task", self.task, "expected a matrix, rows by joints")
        put(self, "task", task)
        put(self, "wanted", validation.ordinary_array("wanted", self.wanted, (task.shape[0],)))
        second = np.zeros((0, task.shape[1]))
        if self.second is not None:
            second = validation.ordinary_array("second", self.second)
        if second.ndim != 2 or second.shape[1] != task.shape[1]:
            raise ShapeError("second", self.second, f"expected a matrix with {task.shape[1]} columns")
        put(self, "second", second)
        rates = np.zeros(len(second))
        if self.second_rates is not None:
            rates = validation.ordinary_array("second_rates", self.second_rates, rates.shape)
        put(self, "second_rates", rates)

    @property
    def joints(self) -> int:
        """m."""
        return int(self.task.shape[1])

    @property
    def rows(self) -> tuple[Array, Array]:
        """J_C and v_C, empty where there are none."""
        assert self.second is not None
        assert self.second_rates is not None
        return self.second, self.second_rates


def checked(problem: Any) -> None:
    """What a resolver is given is a problem.

    Raises:
        ShapeError: something else.
    """
    validation.instance("problem", problem, RateProblem, "a RateProblem")


class Resolver(Protocol):
    """A method of rate resolution."""

    def resolve(self, problem: RateProblem) -> Array:
        """Joint rates [m].

        Raises:
            RangeError: the problem has not the rows that the method needs, or they are singular for it.
        """


def damped_inverse(J: Array, damping: float) -> Array:
    """J' (J J' + damping I)^-1 by singular values; without damping the pseudo-inverse, small ones left out."""
    u, sigma, v = np.linalg.svd(J, full_matrices=False)
    if damping > 0.0:
        gains = sigma / (sigma * sigma + damping)
    else:
        kept = sigma > 1e-12 * max(float(sigma.max(initial=0.0)), 1e-300)
        gains = np.where(kept, 1.0 / np.where(kept, sigma, 1.0), 0.0)
    out: Array = v.T @ (gains[:, None] * u.T)
    return out


def solved(J: Array, right: Array, what: str) -> Array:
    """J^-1 right.

    Raises:
        RangeError: J is singular to working precision.
    """
    if J.shape[0] != J.shape[1] or np.linalg.cond(J) > 1e14:
        raise RangeError(what, J.shape, "expected a regular square matrix")
    return np.asarray(np.linalg.solve(J, right), dtype=np.float64)
