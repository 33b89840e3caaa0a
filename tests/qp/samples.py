"""Random QPs shaped like those of a whole-body tick, for tests and for the survey of solvers.

Every problem has a feasible point by construction. Units are those of a tick: variables of 0.01 to 1
rad/s, task rows of order 1, posture weights between 1 and 1e-6 against task weights of 1.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from wbc.qp.problem import QP

#: Weights of the posture task against task rows of weight 1
WEIGHTS = (1.0, 1e-2, 1e-4, 1e-6)

#: (variables, task rows, equality rows, inequality rows) of the sample sets
SIZES = ((7, 6, 0, 0), (7, 4, 2, 4), (12, 9, 3, 6), (25, 15, 6, 10), (38, 27, 6, 12), (40, 24, 12, 20))


def whole_body(
    rng: np.random.Generator, n: int, tasks: int, equalities: int, inequalities: int, weight: float, reach: float = 1.0
) -> QP:
    """One sample: H = J'J + weight 1, g = -J'e - weight p, bounds and rows about a feasible point.

    ``reach`` scales the wishes e and p against the bounds: at 1 about a third of the bounds is active.
    """
    J = rng.normal(size=(tasks, n))
    wish = reach * rng.normal(size=tasks) * 0.1
    posture = reach * rng.normal(size=n) * 0.1
    H = J.T @ J + weight * np.eye(n)
    g = -J.T @ wish - weight * posture
    inside = rng.uniform(-0.01, 0.01, n)
    A = rng.normal(size=(equalities + inequalities, n))
    at = A @ inside
    below, above = (np.abs(rng.normal(size=inequalities)) * 0.02 for _ in range(2))
    one_sided = rng.random(inequalities) < 0.5
    lower = np.concatenate((-0.01 - np.abs(rng.normal(size=n)) * 0.02, at))
    upper = np.concatenate((0.01 + np.abs(rng.normal(size=n)) * 0.02, at))
    lower[n + equalities :] -= below
    upper[n + equalities :] += np.where(one_sided, np.inf, above)
    return QP((H + H.T) / 2.0, g, lower, upper, A)


def sample_set(count: int, seed: int = 0) -> Iterator[tuple[str, QP]]:
    """``count`` problems of every size and weight, each with a label."""
    rng = np.random.default_rng(seed)
    for n, tasks, equalities, inequalities in SIZES:
        for weight in WEIGHTS:
            for _ in range(count):
                reach = float(10.0 ** rng.uniform(-1.0, 1.0))
                qp = whole_body(rng, n, tasks, equalities, inequalities, weight, reach)
                yield f"n={n} m={equalities}+{inequalities} weight={weight:g}", qp
