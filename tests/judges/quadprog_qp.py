"""The minimiser by another solver; by verified decimal arithmetic where the two disagree."""

from __future__ import annotations

import numpy as np
import quadprog

from tests.judges.exact_qp import reference
from wbc.errors import SolverError
from wbc.qp import QP, make_solver
from wbc.validation import Array

#: Largest difference from the referee [rad/s]
SAME = 1e-6


def distance(qp: QP, x: Array) -> float | None:
    """How far x, the first variables, is from the minimiser: quadprog's or, if that is further away than :data:`SAME`,
    the exact one of :func:`tests.judges.exact_qp.reference`, verified with 60 digits. None:
    both give up.

    Where the smallest eigenvalue of H is 10^-12 of the largest, as weights of 1e-6 make it, quadprog is off by 1e-5.
    """
    best = referee(qp)
    if best is not None and np.abs(best[: x.size] - x).max() <= SAME:
        return float(np.abs(best[: x.size] - x).max())
    try:
        best = reference(qp, make_solver("daqp", qp.n, qp.m).solve(qp, warm=False)).x
    except SolverError:
        return None if best is None else float(np.abs(best[: x.size] - x).max())
    return float(np.abs(best[: x.size] - x).max())


def referee(qp: QP) -> Array | None:
    """The minimiser by quadprog, in units of rows and columns for its tolerances; None where that gives up."""
    column = 1.0 / np.sqrt(np.diag(qp.H))
    C = np.vstack((np.eye(qp.n), qp.A)) * column
    norms = np.linalg.norm(C, axis=1)
    on = norms > 0.0
    C, lower, upper = C[on] / norms[on, None], qp.lower[on] / norms[on], qp.upper[on] / norms[on]
    equal = lower == upper
    low, high = ~equal & np.isfinite(lower), ~equal & np.isfinite(upper)
    # equality rows that depend on each other are an orthonormal basis of what they say
    U, S, V = np.linalg.svd(C[equal], full_matrices=False)
    rank = int((S > 1e-9).sum())
    normals = np.vstack((V[:rank], C[low], -C[high]))
    sides = np.concatenate(((U.T @ lower[equal])[:rank] / S[:rank], lower[low], -upper[high]))
    try:
        found = quadprog.solve_qp(qp.H * np.outer(column, column), -qp.g * column, normals.T, sides, rank)
    except ValueError:
        return None
    return np.asarray(found[0]) * column
