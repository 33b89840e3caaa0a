"""The exact minimiser of a small QP in decimal arithmetic, for tests and for the survey of solvers.

The active set comes from any solver; the KKT system on it is solved by double-precision steps whose
residuals are computed with 60 decimal digits, and the optimality conditions are then verified with
those digits. A verified answer needs no trust in the solver that proposed the set.
"""

from __future__ import annotations

from decimal import Decimal, localcontext
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbc.errors import SolverError
from wbc.qp.factor import ActiveRows, Factor, active_bounds
from wbc.qp.polishing import polish
from wbc.qp.problem import QP, QPSolution

_DIGITS = 60
_STEPS = 20
_CONVERGED = 1e-32
_TINY = Decimal("1e-25")


def reference(qp: QP, guess: QPSolution) -> QPSolution:
    """The minimiser, rounded to double; errors before rounding are below 1e-20.

    Raises:
        SolverError: the guess leads to no active set that passes the verification.
    """
    start = polish(qp, guess, rounds=400).solution
    factor = Factor(qp)
    held = active_bounds(qp, factor, start)
    with localcontext() as context:
        context.prec = _DIGITS
        for _ in range(40):
            rows = ActiveRows(factor, held, start.multipliers)
            x, lam = _solve(qp, factor, held, rows)
            at = np.concatenate((x, _decimal(qp.A) @ x)) if qp.m else x
            change = _verify(qp, held, rows, at, lam)
            if change is None:
                return QPSolution(x.astype(np.float64), lam.astype(np.float64), "solved")
            held[change[0]] = change[1]
    raise SolverError("qp", "reference", "no active set passes the exact optimality conditions")


def _solve(qp: QP, factor: Factor, held: NDArray[np.int8], rows: ActiveRows) -> tuple[Any, Any]:
    H, g, C = _decimal(qp.H), _decimal(qp.g), _decimal(np.vstack((np.eye(qp.n), qp.A))[rows.index])
    bound = _decimal(np.where(held == -1, qp.lower, qp.upper)[rows.index])
    x, lam = _decimal(np.zeros(qp.n)), _decimal(np.zeros(qp.n + qp.m))
    for _ in range(_STEPS):
        force = -(H @ x + g) - (C.T @ lam[rows.index] if rows.index.size else 0)
        offset = bound - C @ x if rows.index.size else bound
        dy, mu = rows.solve(factor.inverse.T @ force.astype(np.float64), offset.astype(np.float64))
        x = x + _decimal(factor.inverse @ dy)
        lam[rows.index] = lam[rows.index] + _decimal(mu)
        if np.abs(dy).max(initial=0.0) < _CONVERGED and np.abs(mu).max(initial=0.0) < _CONVERGED:
            break
    return x, lam


def _verify(qp: QP, held: NDArray[np.int8], rows: ActiveRows, at: Any, lam: Any) -> tuple[int, int] | None:
    """None if optimal, else one change of the active set: (row, new value of held)."""
    # active rows that depend on the others must hold to the rounding of their data
    for i in rows.dependent:
        bound = qp.lower[i] if held[i] == -1 else qp.upper[i]
        off = abs(at[i] - Decimal(float(bound)))
        if off > Decimal("1e-14") * (1 + abs(Decimal(float(bound)))):
            if held[i] == 2:
                raise SolverError("qp", int(i), "an equality row contradicts the others")
            return int(i), 0
    worst: Decimal = _TINY
    change: tuple[int, int] | None = None
    for i in range(at.size):
        if held[i] in (1, -1) and -lam[i] * int(held[i]) > worst:
            worst, change = -lam[i] * int(held[i]), (i, 0)
    if change is not None:
        return change
    for i in np.flatnonzero(held == 0):
        for bound, sign in ((qp.upper[i], 1), (qp.lower[i], -1)):
            if np.isfinite(bound) and (at[i] - Decimal(float(bound))) * sign > worst:
                worst, change = (at[i] - Decimal(float(bound))) * sign, (int(i), sign)
    return change


def _decimal(array: Any) -> Any:
    return np.array([Decimal(float(v)) for v in np.ravel(array)], dtype=object).reshape(np.shape(array))
