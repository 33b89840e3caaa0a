"""Linear programs by HiGHS, whose answer is one: the least cost, or that there is none."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.optimize import OptimizeResult, linprog

from wbc.errors import SolverError
from wbc.validation import Array

#: An optimum
OPTIMAL = 0
#: Rows and bounds that exclude each other
INFEASIBLE = 2
#: A cost without a least value
UNBOUNDED = 3


def least(
    cost: Array, rows: Array | None, most: Array | None, equal: Any = None, sides: Any = None, bounds: Any = None
) -> OptimizeResult:
    """The answer of ``scipy.optimize.linprog`` to

        min c x    with    A x <= b,  E x = e,  low <= x <= high

    Presolving gives up on some programs (status 4) that are solved without it.

    Args:
        cost: c ``(n)``. rows, most: A ``(m, n)`` and b ``(m)``; None: none. equal, sides: E and e; None: none.
        bounds: of x, a pair of all or one each; None: x is free.

    Returns:
        With status ``OPTIMAL``, ``INFEASIBLE`` or ``UNBOUNDED``.

    Raises:
        SolverError: neither is found.
    """
    for presolve in (True, False):
        found = linprog(
            cost, rows, most, equal, sides, (None, None) if bounds is None else bounds, options={"presolve": presolve}
        )
        if found.status in (OPTIMAL, INFEASIBLE, UNBOUNDED):
            return found
    raise SolverError("cost", np.shape(cost), f"no answer from the linear program: {found.message}")
