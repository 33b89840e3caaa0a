"""The best of all solutions in closed form."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from wbc import validation
from wbc.resolvers.fsp.blocking import blocked
from wbc.resolvers.fsp.closed_form import RateRow, best, one_shot
from wbc.resolvers.fsp.criteria import Criterion
from wbc.resolvers.fsp.space import orthogonal
from wbc.resolvers.problem import RateProblem, checked
from wbc.validation import Array

GENERATORS = ("orthogonal", "blocked")


@dataclass(frozen=True, eq=False)
class FullSpace:
    """The v of all that do the task with the least (v - r)' H (v - r), second rows J_C v = v_C as constraints:

        v = sum t_i g_i,   J_T g_i = v_T,   t = G^-1 C (C' G^-1 C)^-1 c

    Attributes:
        criterion: least norm by default.
        generator: ``orthogonal``, or ``blocked`` as published; the space is the same.

    Source: F. G. Pin and others, Full Space Parameterization; ORNL/TM-13096.
    """

    criterion: Criterion = field(default_factory=Criterion)
    generator: str = "orthogonal"

    def __post_init__(self) -> None:
        validation.instance("criterion", self.criterion, Criterion, "a Criterion")
        validation.one_of("generator", self.generator, GENERATORS)

    def resolve(self, problem: RateProblem) -> Array:
        """See the class. Where all rows are independent the orthogonal way is one factorisation of both.

        Raises:
            InfeasibleError: an inconsistent task, or constraints that contradict it or each other, by number.
            RangeError: no joint moves the task.
        """
        checked(problem)
        make = orthogonal if self.generator == "orthogonal" else blocked
        second, rates = problem.rows
        self.criterion.check(problem.joints)
        if make is orthogonal:
            found = one_shot(problem.task, problem.wanted, second, rates, self.criterion)
            if found is not None:
                return found
        rows = [RateRow(f"second row {k}", a, value) for k, (a, value) in enumerate(zip(second, rates, strict=True))]
        return np.asarray(best(make(problem.task, problem.wanted, free=True), self.criterion, rows).v)
