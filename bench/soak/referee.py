"""The minimiser by another solver."""

from __future__ import annotations

import numpy as np
import quadprog

from wbc.qp import QP
from wbc.validation import Array

#: Largest difference from the referee [rad/s]
SAME = 1e-6


def referee(qp: QP) -> Array | None:
    """The minimiser by quadprog; None where that gives up."""
    C = np.vstack((np.eye(qp.n), qp.A))
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
        found = quadprog.solve_qp(qp.H, -qp.g, normals.T, sides, rank)
    except ValueError:
        return None
    return np.asarray(found[0])
