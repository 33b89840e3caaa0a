"""Independent equality rows: which are kept, which are dropped, and whether the dropped ones agree."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, strategies as st

from tests.qp.samples import whole_body
from wbc.qp import QP, independent, make_solver
from wbc.qp.equalities import orthonormal, restore


def equality_problem(A, right, fixed=None):
    A = np.asarray(A, dtype=float)
    n = A.shape[1]
    lower, upper = np.full(n + len(A), -np.inf), np.full(n + len(A), np.inf)
    lower[n:] = upper[n:] = right
    for i, value in (fixed or {}).items():
        lower[i] = upper[i] = value
    return QP.checked(np.eye(n), np.zeros(n), lower, upper, A)


@given(st.integers(0, 10**6), st.integers(1, 8), st.integers(0, 4))
def test_rank_and_factorisation(seed, rank, extra):
    rng = np.random.default_rng(seed)
    n = 9
    base = rng.normal(size=(rank, n))
    A = np.vstack((base, rng.normal(size=(extra, rank)) @ base)) * 10.0 ** rng.uniform(-3, 3, (rank + extra, 1))
    A = A[rng.permutation(rank + extra)]
    x = rng.normal(size=n)
    found = independent(equality_problem(A, A @ x))
    assert found.kept.size == rank
    assert sorted([*found.kept, *found.dropped]) == list(range(rank + extra))
    assert found.all_consistent
    assert np.abs(found.basis @ found.basis.T - np.eye(rank)).max() < 1e-12
    assert np.abs(found.triangle @ found.basis - A[found.kept]).max() < 1e-12 * np.abs(A).max()
    assert not np.triu(found.triangle, 1).any()
    assert found.basis @ x == pytest.approx(found.target, abs=1e-9)


@pytest.mark.parametrize(("distance", "kept"), [(1e-6, 3), (1e-5, 3), (1e-8, 2), (0.0, 2)])
def test_threshold(distance, kept):
    A = np.array([[1.0, 0, 0, 0], [0, 2.0, 0, 0], [1.0, 1.0, distance, 0]])
    assert independent(equality_problem(A, [0, 0, 0])).kept.size == kept


def test_inconsistency_is_in_the_units_of_the_dropped_row():
    A = np.array([[1.0, 0.0], [0.0, 1.0], [10.0, 10.0]])
    found = independent(equality_problem(A, [0.1, 0.2, 3.5]))
    assert list(found.dropped) == [2]
    assert found.inconsistency == pytest.approx([0.5])
    assert not found.all_consistent


def test_fixed_variables_are_constants():
    A = np.array([[1.0, 0.0, 1.0], [1.0, 0.0, 2.0], [0.0, 0.0, 3.0]])
    found = independent(equality_problem(A, [0.5, 0.9, 0.6], fixed={2: 0.2}))
    assert found.kept.size == 1
    assert not found.basis[:, 2].any()
    assert found.inconsistency == pytest.approx([0.2, 0.0], abs=1e-15)
    assert list(found.consistent) == [False, True]


def test_class_order_decides_what_is_kept():
    A = np.array([[5.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    problem = equality_problem(A, [1.0, 0.3, 0.0])
    assert list(independent(problem).kept) == [0, 2]
    assert list(independent(problem, order=np.array([3, 1, 2])).kept) == [1, 2]


def test_near_ties_go_to_the_lower_row():
    A = np.eye(3)[[2, 0, 1]] * np.array([[1.0], [1.0 + 1e-12], [1.0]])
    assert list(independent(equality_problem(A, np.zeros(3))).kept) == [0, 1, 2]


def test_no_rows_and_rows_of_zeros():
    assert independent(equality_problem(np.zeros((0, 3)), [])).kept.size == 0
    found = independent(equality_problem(np.zeros((2, 3)), [0.0, 0.1]))
    assert found.kept.size == 0
    assert list(found.consistent) == [True, False]


def test_orthonormal_problem_has_the_same_answer_and_multipliers():
    rng = np.random.default_rng(2)
    plain = make_solver("qpoases", 12, 10, prepared=False)
    for _ in range(10):
        qp = whole_body(rng, 12, 9, 4, 6, 1e-2)
        found = independent(qp)
        answer = restore(qp, found, plain.solve(orthonormal(qp, found)))
        direct = plain.solve(qp)
        assert np.abs(answer.x - direct.x).max() < 1e-12
        assert np.abs(answer.multipliers - direct.multipliers).max() < 1e-9
