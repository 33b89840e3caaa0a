"""The declared order of sacrifice: what holds, what gives way, and by how little."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.optimize import lsq_linear

from tests.qp.samples import whole_body
from wbc.errors import BoundsError, ShapeError
from wbc.qp import QP, make_solver
from wbc.qp.relax import Relaxation, relax

FAR = 1e3


def problem(seed: int, conflict: bool) -> tuple[QP, np.ndarray]:
    rng = np.random.default_rng(seed)
    n, equalities, inequalities = int(rng.choice([3, 7, 12])), int(rng.integers(0, 4)), int(rng.integers(1, 9))
    qp = whole_body(rng, n, max(1, n - 2), equalities, inequalities, 10.0 ** rng.uniform(-6, 0))
    m = equalities + inequalities
    if conflict:
        shift = rng.normal(size=m) * rng.choice([0.01, 0.1, 1.0]) * (rng.random(m) < 0.6)
        qp.lower[n:] += shift
        qp.upper[n:] += shift
        if seed % 5 == 0 and m > 1:
            qp.A[-1] = -qp.A[0]
        if seed % 7 == 0:
            qp.A[m // 2] = 0.0
    return qp, rng.integers(1, 4, m)


def least(qp: QP, order: np.ndarray, level: int, slack: np.ndarray) -> float:
    """Least |s| of a class, the lower classes held to their slacks; by bounded least squares, no QP solver."""
    n = qp.n
    unit = np.linalg.norm(qp.A, axis=1)
    unit[unit == 0.0] = 1.0
    held, own = np.flatnonzero(order < level), np.flatnonzero(order == level)
    rows = np.concatenate((held, own))
    heavy = np.where(order[rows] < level, 1e6, 1.0)
    give = np.where(order[rows] < level, slack[rows] / unit[rows], 0.0)
    A = np.hstack((qp.A[rows] / unit[rows, None], -np.eye(rows.size))) * heavy[:, None]
    low = np.concatenate((qp.lower[:n], np.maximum(qp.lower[n:][rows] / unit[rows] - give, -FAR)))
    high = np.concatenate((qp.upper[:n], np.minimum(qp.upper[n:][rows] / unit[rows] + give, FAR)))
    high = np.maximum(high, low + 1e-12)
    found = lsq_linear(A, np.zeros(rows.size), (low, high), method="bvls", tol=1e-15, max_iter=3000)
    return float(np.linalg.norm(found.fun[held.size :]))


@settings(max_examples=25)
@given(st.integers(0, 10**6))
def test_a_class_is_violated_no_more_than_it_must(seed):
    qp, order = problem(seed, conflict=True)
    found = Relaxation(qp.n, qp.m).solve(qp, order)
    assert found.flag in ("solved", "relaxed")
    assert np.isfinite(found.x).all()
    assert not qp.violation(found.x)[: qp.n].any()
    unit = np.linalg.norm(qp.A, axis=1)
    unit[unit == 0.0] = 1.0
    for level in np.unique(order):
        own = order == level
        got = float(np.linalg.norm((found.slack / unit)[own]))
        assert got <= least(qp, order, int(level), found.slack) + 1e-7
    assert found.slack == pytest.approx(qp.violation(found.x)[qp.n :])


@settings(max_examples=20)
@given(st.integers(0, 10**6))
def test_feasible_problems_are_unchanged(seed):
    qp, order = problem(seed, conflict=False)
    found = relax(qp, order)
    plain = make_solver("daqp", qp.n, qp.m).solve(qp)
    assert found.flag == "solved"
    assert not found.relaxed.any()
    assert np.abs(found.x - plain.x).max() < 1e-11


def test_the_higher_class_gives_way_and_the_rest_is_optimised():
    # hold x0 = 0 (class 2) against a margin x0 >= 0.1 (class 3); x1 is free to follow its wish
    qp = QP.checked(np.eye(2), [0.0, -0.4], [-1, -1, 0.0, 0.1], [1, 1, 0.0, np.inf], [[1, 0], [1, 0]])
    found = relax(qp, np.array([2, 3]))
    assert found.flag == "relaxed"
    assert found.x == pytest.approx([0.0, 0.4], abs=1e-8)
    assert found.slack == pytest.approx([0.0, 0.1], abs=1e-8)
    assert list(found.relaxed) == [False, True]
    swapped = relax(qp, np.array([3, 2]))
    assert swapped.x == pytest.approx([0.1, 0.4], abs=1e-8)
    assert list(swapped.relaxed) == [True, False]


def test_simple_bounds_never_give_way():
    qp = QP.checked(np.eye(2), [0.0, 0.0], [-0.5, -0.5, 4.0], [0.5, 0.5, 4.0], [[1, 1]])
    found = relax(qp, np.array([1]))
    assert np.array_equal(found.x, [0.5, 0.5])
    assert found.slack == pytest.approx([3.0])


def test_unit_decides_how_rows_of_one_class_share_a_conflict():
    qp = QP.checked([[1.0]], [0.0], [-1, 0.5, -np.inf], [1, np.inf, 0.2], [[1], [1]])
    order = np.array([1, 1])
    assert relax(qp, order).slack == pytest.approx([0.15, 0.15], abs=1e-8)
    uneven = relax(qp, order, np.array([2.0, 1.0])).slack  # s in units: 0.3 shared as 4 : 1
    assert uneven == pytest.approx([0.24, 0.06], abs=1e-8)


def test_scale_of_a_row_changes_nothing():
    rng = np.random.default_rng(0)
    for seed in range(12):
        qp, order = problem(1000 + seed, conflict=True)
        scaled = qp.copy()
        factor = 10.0 ** rng.uniform(-3, 3, qp.m)
        scaled.A *= factor[:, None]
        scaled.lower[qp.n :] *= factor
        scaled.upper[qp.n :] *= factor
        assert np.abs(relax(qp, order).x - relax(scaled, order).x).max() < 1e-5


def test_row_of_zeros_with_an_impossible_bound():
    qp = QP.checked(np.eye(1), [-0.3], [-1, 2.0], [1, 3.0], [[0.0]])
    found = relax(qp, np.array([1]))
    assert found.x == pytest.approx([0.3], abs=1e-9)
    assert found.slack == pytest.approx([2.0])


def test_a_row_that_holds_nearly_every_joint():
    """A row that asks for more than the bounds give fixes all joints but one, whose part is within rounding of none."""
    rng = np.random.default_rng(0)
    for _ in range(200):
        n = int(rng.integers(3, 12))
        row, bound = rng.uniform(-1.0, 1.0, n), rng.uniform(0.2, 1.0, n)
        row[0] = 10.0 ** rng.uniform(-9.0, -5.0)
        ends = np.concatenate([-bound, [20.0]]), np.concatenate([bound, [np.inf]])
        qp = QP(np.diag(rng.uniform(0.1, 2.0, n)), rng.normal(size=n), *ends, row[None])
        answer = relax(qp, np.array([3]), rng.uniform(0.5, 3.0, 1))
        assert answer.flag == "relaxed"
        assert answer.slack[0] == pytest.approx(20.0 - np.abs(row) @ bound, abs=1e-4)


def test_bad_input():
    qp = QP.checked(np.eye(1), [0.0], [-1, 0.0], [1, 0.0], [[1.0]])
    with pytest.raises(ShapeError):
        relax(qp, np.array([1, 2]))
    with pytest.raises(ShapeError):
        relax(qp, np.array([1]), np.array([1.0, 2.0]))
    qp.lower[0] = 2.0
    with pytest.raises(BoundsError):
        relax(qp, np.array([1]))
