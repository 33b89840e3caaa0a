"""Polish brings a rough point to rounding level, and says when it cannot."""

from __future__ import annotations

import numpy as np
import pytest

from tests.judges.exact_qp import reference
from tests.qp.samples import whole_body
from wbc.qp import QP, QPSolution, make_solver, polish


@pytest.mark.parametrize("noise", [0.0, 1e-9, 1e-6, 1e-4])
@pytest.mark.parametrize("weight", [1.0, 1e-3, 1e-6])
def test_polish_reaches_rounding_level(weight, noise):
    rng = np.random.default_rng([int(1e6 * weight), int(1e9 * noise)])
    solver = make_solver("daqp", 12, 9)
    for _ in range(8):
        qp = whole_body(rng, 12, 9, 3, 6, weight)
        answer = solver.solve(qp)
        rough = QPSolution(
            answer.x + noise * rng.normal(size=12), answer.multipliers + noise * rng.normal(size=21), "solved"
        )
        polished = polish(qp, rough)
        assert polished.exact
        exact = reference(qp, answer)
        assert np.abs(polished.solution.x - exact.x).max() < 1e-15
        assert np.abs(polished.solution.multipliers - exact.multipliers).max() < 1e-12


def test_polish_from_nothing_finds_the_active_set_of_a_small_problem():
    qp = QP.checked(np.eye(3), [-1.0, 0.5, 2.0], [-0.3] * 3, [0.3] * 3)
    polished = polish(qp, QPSolution(np.zeros(3), np.zeros(3), "solved"))
    assert polished.exact
    assert polished.solution.x == pytest.approx([0.3, -0.3, -0.3], abs=1e-16)


def test_polish_says_so_when_the_rows_contradict_each_other():
    qp = QP.checked(np.eye(2), [0.0, 0.0], [-1.0, -1.0, 5.0], [1.0, 1.0, 6.0], [[1.0, 1.0]])
    polished = polish(qp, QPSolution(np.zeros(2), np.zeros(3), "solved"))
    assert not polished.exact
    assert polished.solution.flag == "failed"
    assert np.isfinite(polished.solution.x).all()


def test_polish_returns_the_input_where_the_hessian_is_singular():
    qp = QP.checked(np.diag([1.0, 0.0]), [0.0, 0.0], [-1.0, -1.0], [1.0, 1.0])
    start = QPSolution(np.array([0.1, 0.2]), np.zeros(2), "solved")
    polished = polish(qp, start)
    assert not polished.exact
    assert np.array_equal(polished.solution.x, start.x)
