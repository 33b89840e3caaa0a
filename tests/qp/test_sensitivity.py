"""Derivatives of the minimiser against finite differences of solved problems."""

from __future__ import annotations

import numpy as np
import pytest

from tests.qp.samples import whole_body
from wbc.errors import SolverError
from wbc.qp import QP, QPSolution, make_solver
from wbc.qp.sensitivity import Sensitivity

STEP = 1e-6


def solved(qp: QP) -> QPSolution:
    return make_solver("daqp", qp.n, qp.m).solve(qp, warm=False)


def test_minimiser_moves_as_its_derivative_says() -> None:
    compared = 0
    for seed in range(12):
        rng = np.random.default_rng(seed)
        qp = whole_body(rng, 7, 5, 2, 5, 1e-2)
        answer = solved(qp)
        sensitivity = Sensitivity(qp, answer)
        assert sensitivity.active.size
        # well away from kinks: no multiplier and no distance is small
        distance = np.minimum(qp.upper - qp.rows_at(answer.x), qp.rows_at(answer.x) - qp.lower)
        tight = np.isin(np.arange(qp.n + qp.m), sensitivity.active)
        equal = qp.lower == qp.upper
        if distance[~tight].min() < 1e-3 or np.abs(answer.multipliers[tight & ~equal]).min(initial=1.0) < 1e-3:
            continue
        compared += 1
        H, g, A = rng.normal(size=(7, 7)), rng.normal(size=7), rng.normal(size=qp.A.shape)
        b = rng.normal(size=qp.lower.size)
        H = H + H.T
        force = H @ answer.x + g + A.T @ answer.multipliers[qp.n :]
        offset = b - np.concatenate((np.zeros(7), A @ answer.x))
        ends = []
        for sign in (-STEP, STEP):
            moved = QP(qp.H + sign * H, qp.g + sign * g, qp.lower + sign * b, qp.upper + sign * b, qp.A + sign * A)
            ends.append(solved(moved).x)
        difference = (ends[1] - ends[0]) / (2 * STEP)
        assert sensitivity.change(force[:, None], offset[:, None])[:, 0] == pytest.approx(
            difference, rel=1e-4, abs=1e-5
        )
    assert compared >= 4


def test_one_bound() -> None:
    """min (x - 2)^2 / 2 + (y - x)^2 / 2 with x <= 1: both follow the bound."""
    qp = QP(
        np.array([[2.0, -1.0], [-1.0, 1.0]]),
        np.array([-2.0, 0.0]),
        np.full(2, -9.0),
        np.array([1.0, 9.0]),
        np.zeros((0, 2)),
    )
    sensitivity = Sensitivity(qp, solved(qp))
    assert sensitivity.to_bound(0) == pytest.approx([1.0, 1.0])
    assert sensitivity.to_bound(1) == pytest.approx([0.0, 0.0])


def test_a_hessian_that_is_not_definite_is_refused() -> None:
    qp = QP(np.zeros((1, 1)), np.zeros(1), np.array([-1.0]), np.array([1.0]), np.zeros((0, 1)))
    with pytest.raises(SolverError):
        Sensitivity(qp, QPSolution(np.zeros(1), np.zeros(1), "solved"))
