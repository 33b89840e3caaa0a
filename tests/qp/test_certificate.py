"""The certificate's bound holds for every answer, and is small for the answers of the supported solvers."""

from __future__ import annotations

import numpy as np
import pytest

from tests.judges.exact_qp import reference
from tests.qp.samples import SIZES, WEIGHTS, whole_body
from tests.repeats import covering, repeats
from wbc.qp import QP, QPSolution, certify, make_solver
from wbc.qp.polishing import polish

COUNT = {7: repeats(12), 12: repeats(5), 25: repeats(2), 38: repeats(1), 40: repeats(1)}


def disturbed(rng: np.random.Generator, answer: QPSolution) -> list[QPSolution]:
    """The answer, and answers with noise on the point, on the multipliers, and on both."""
    out = [answer]
    for size in (1e-14, 1e-11, 1e-8, 1e-5):
        x = answer.x + size * rng.normal(size=answer.x.size)
        lam = answer.multipliers * (1.0 + size * rng.normal(size=answer.multipliers.size))
        out += [
            QPSolution(x, answer.multipliers, "solved"),
            QPSolution(answer.x, lam, "solved"),
            QPSolution(x, lam, "solved"),
        ]
    return out


@pytest.mark.parametrize(("shape", "weight"), covering(SIZES, WEIGHTS), ids=str)
def test_bound_is_never_exceeded(shape, weight):
    rng = np.random.default_rng([shape[0], shape[3], int(1e6 * weight)])
    solver = make_solver("daqp", shape[0], shape[2] + shape[3])
    stated = 0
    for _ in range(COUNT[shape[0]]):
        qp = whole_body(rng, *shape, weight, reach=float(10.0 ** rng.uniform(-1, 1)))
        answer = solver.solve(qp)
        assert answer.solved
        exact = reference(qp, answer)
        # the reference itself is rounded to double
        last = 0.5 * np.spacing(np.abs(exact.x)).max()
        assert certify(qp, answer).error_bound < 1e-6
        for candidate in disturbed(rng, answer)[:: 1 if shape[0] < 20 else 3]:
            bound = certify(qp, candidate).error_bound
            assert np.abs(candidate.x - exact.x).max() <= bound + last
            stated += np.isfinite(bound)
    assert stated > 3 * COUNT[shape[0]]


def test_bound_is_within_a_factor_of_the_error_where_the_worst_direction_is_hit():
    # one weak direction, error put along it: the bound must not be a loose constant
    qp = QP.checked(np.diag([1.0, 1.0, 1e-6]), [-0.1, 0.2, -1e-7], [-1.0] * 3, [1.0] * 3)
    x = np.array([0.1, -0.2, 0.1 + 1e-5])
    bound = certify(qp, QPSolution(x, np.zeros(3), "solved")).error_bound
    assert 1e-5 <= bound <= 1.001e-5


def test_duplicate_active_rows_have_a_finite_bound():
    H, g = np.diag([1.0, 2.0, 1e-4]), np.array([-1.0, -1.0, 1e-5])
    A = np.array([[1.0, 0.0, 0.0], [3.0, 0.0, 0.0], [1.0 / 3.0, 0.0, 0.0]])
    bound = 0.1
    qp = QP.checked(H, g, [-1.0] * 3 + [-np.inf] * 3, [bound, 1.0, 1.0, bound, 3 * bound, bound / 3.0], A)
    answer = make_solver("daqp", 3, 3).solve(qp)
    assert answer.solved
    assert np.abs(answer.x - [0.1, 0.5, -0.1]).max() <= certify(qp, answer).error_bound < 1e-9


def test_bound_at_zero_that_is_touched_only_to_rounding_has_a_certificate():
    qp = QP.checked(np.eye(2), [1.0, -0.5], [0.0, -1.0], [1.0, 1.0])
    for x0 in (-1e-30, 1e-30, 0.0):
        answer = QPSolution(np.array([x0, 0.5]), np.array([-1.0, 0.0]), "solved")
        assert certify(qp, answer).error_bound < 1e-15


def test_no_bound_is_stated_where_none_can_be_had():
    qp = QP.checked(np.diag([1.0, 0.0]), [0.0, 0.0], [-1.0, -1.0], [1.0, 1.0])
    assert certify(qp, QPSolution(np.zeros(2), np.zeros(2), "solved")).error_bound == np.inf
    qp = QP.checked(np.eye(2), [0.0, 0.0], [-1.0, -1.0, 2.0, 3.0], [1.0, 1.0, 2.0, 3.0], [[1.0, 1.0], [1.0, 1.0]])
    assert certify(qp, QPSolution(np.ones(2), np.zeros(4), "solved")).error_bound == np.inf


def test_residuals_are_those_of_the_definition():
    qp = QP.checked(np.eye(2), [-1.0, 0.0], [-1.0, -1.0, 0.5], [0.25, 1.0, 0.5], [[0.0, 2.0]])
    found = certify(qp, QPSolution(np.array([0.5, 0.25]), np.array([0.75, 0.0, -0.25]), "solved"))
    assert found.stationarity == pytest.approx(0.25)
    assert found.violation == pytest.approx(0.25)
    assert found.complementarity == pytest.approx(0.75 * 0.25)


def priced(rng: np.random.Generator, n: int, rows: int, price: float) -> QP:
    """n joints with a damping of 1e-8, a task of weight 1, and soft rows which the joints cannot meet."""
    J, A = rng.normal(size=(2, n)), rng.normal(size=(rows, n))
    H = np.eye(n + rows)
    H[:n, :n] = J.T @ J + 1e-8 * np.eye(n)
    g = np.concatenate((J.T @ rng.normal(size=2), np.zeros(rows)))
    side = rng.normal(0.0, 1.0, rows)
    reach = np.concatenate((rng.uniform(0.1, 1.0, n), np.full(rows, np.inf)))
    whole = np.hstack((A, np.eye(rows) / np.sqrt(price)))
    return QP.checked(H, g, np.concatenate((-reach, side)), np.concatenate((reach, side)), whole)


def test_rows_at_a_price_of_1e7_beside_a_damping_of_1e_8_have_a_certificate():
    rng, strongest = np.random.default_rng(5), 0.0
    for _ in range(12):
        qp = priced(rng, 8, 3, 1e7)
        guess = polish(qp, make_solver("osqp", qp.n, qp.m).solve(qp, warm=False)).solution
        exact = reference(qp, guess)
        strongest = max(strongest, np.abs(exact.multipliers).max())
        assert certify(qp, exact, 8).error_bound < 1e-3
        for candidate in disturbed(rng, exact):
            error = np.abs(candidate.x - exact.x)[:8].max()
            assert error <= certify(qp, candidate, 8).error_bound + 0.5 * np.spacing(np.abs(exact.x[:8])).max()
    assert strongest > 1e6
