"""Irreducible conflicts and least slacks, with linear programs as the referee."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linprog

from wbc.qp import QP
from wbc.qp.conflict import RowBound, diagnose


def problem(seed: int) -> QP:
    """Random rows on a box; most of them contradict."""
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(2, 9)), int(rng.integers(1, 9))
    A = rng.normal(size=(m, n)) * (rng.random((m, n)) < 0.8)
    centre = A @ rng.uniform(-1, 1, n) + rng.normal(size=m) * rng.choice([0.0, 0.5, 5.0])
    width = rng.choice([0.0, 0.3], m)
    lower = np.concatenate((np.full(n, -1.0), np.where(rng.random(m) < 0.3, -np.inf, centre - width)))
    upper = np.concatenate((np.full(n, 1.0), np.where(np.isinf(lower[n:]) | (rng.random(m) < 0.6), centre, np.inf)))
    if seed % 6 == 0:
        A[0] = 0.0
    return QP(np.eye(n), np.zeros(n), lower, np.maximum(upper, lower), A)


def gap(qp: QP, sides: list[RowBound], soft: list[RowBound]) -> float:
    """Least s >= 0 with which all sides hold, each of ``soft`` being allowed s; inf: there is none."""
    C = np.vstack((np.eye(qp.n), qp.A))
    rows = [(C[i], qp.upper[i]) if up else (-C[i], -qp.lower[i]) for i, up in sides]
    ease = np.array([-1.0 if side in soft else 0.0 for side in sides])
    matrix = np.column_stack((np.array([row for row, _ in rows]), ease))
    free = [(None, None)] * qp.n + [(0, None)]
    found = linprog(np.append(np.zeros(qp.n), 1.0), matrix, [b for _, b in rows], bounds=free)
    return float(found.fun) if found.status == 0 else np.inf


def every(qp: QP) -> list[RowBound]:
    finite = (np.isfinite(qp.lower), np.isfinite(qp.upper))
    return [RowBound(int(i), bool(up)) for up in (0, 1) for i in np.flatnonzero(finite[up])]


@pytest.mark.parametrize("seed", range(40))
def test_conflicts_are_irreducible_and_slacks_are_least(seed: int) -> None:
    qp = problem(seed)
    sides, found = every(qp), diagnose(qp)
    general = [side for side in sides if side.row >= qp.n]
    least = gap(qp, sides, general)
    assert bool(found.conflicts) == (least > 1e-7)
    if not found.conflicts:
        assert found.slack.max(initial=0.0) < 1e-8
        return
    # the Euclidean norm of the least squares lies between the largest entry of least maximum and its sqrt(m) fold
    norm = np.linalg.norm(found.slack)
    assert least - 1e-8 <= norm <= np.sqrt(qp.m) * least + 1e-8
    shifted = QP(qp.H, qp.g, qp.lower - found.slack, qp.upper + found.slack, qp.A)
    assert gap(shifted, sides, general) < 1e-7
    for conflict in found.conflicts:
        members = list(conflict.bounds)
        assert gap(qp, members, members) > 1e-9
        for k, side in enumerate(members):
            others = [s for s in members if s != side]
            assert not others or gap(qp, others, others) < 1e-7
            row = [s for s in sides if s.row == side.row]
            assert conflict.alone[k] == pytest.approx(gap(qp, sides, row), abs=1e-7)
            assert conflict.within[k] == pytest.approx(gap(qp, members, [side]), abs=1e-7)
    # Without the rows that are named nothing contradicts
    gone = {side.row for conflict in found.conflicts for side in conflict.bounds if side.row >= qp.n}
    left = [side for side in sides if side.row not in gone]
    assert len(found.conflicts) == 4 or gap(qp, left, left) < 1e-6


def test_two_rows_that_name_each_other() -> None:
    """x + y >= 3 on the unit box: all three sides are needed, and only the row is worth giving."""
    qp = QP(np.eye(2), np.zeros(2), np.array([-1, -1, 3.0]), np.array([1, 1, np.inf]), np.array([[1.0, 1.0]]))
    found = diagnose(qp)
    assert [c.bounds for c in found.conflicts] == [(RowBound(0, True), RowBound(1, True), RowBound(2, False))]
    assert found.conflicts[0].alone == pytest.approx([1.0, 1.0, 1.0], abs=1e-8)
    assert found.slack == pytest.approx([0, 0, 1.0], abs=1e-8)
