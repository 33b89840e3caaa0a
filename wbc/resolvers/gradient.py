"""Gradient projection."""

from __future__ import annotations

from dataclasses import dataclass

from wbc import validation
from wbc.resolvers.problem import RateProblem, checked, damped_inverse
from wbc.validation import Array


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
