"""daqp, osqp and qpoases give one answer; none is misled by bad data or by its own past."""

from __future__ import annotations

import numpy as np
import pytest

from bench.measured.solvers import survey
from tests.judges.quadprog_qp import referee as by_quadprog
from tests.qp.problems import RECORDS
from tests.qp.samples import SIZES, WEIGHTS, whole_body
from tests.repeats import covering
from wbc.errors import BoundsError, NotFiniteError, RangeError, ShapeError, SolverError, UnknownNameError
from wbc.qp import QP, available_solvers, certify, make_solver
from wbc.qp.solvers.conic import Conic

SUPPORTED = ("daqp", "osqp", "qpoases")


@pytest.fixture(params=SUPPORTED)
def name(request):
    return request.param


@pytest.mark.parametrize("weight", WEIGHTS)
@pytest.mark.parametrize("robot", RECORDS)
def test_solvers_agree_on_recorded_ticks(robot, weight):
    ticks = RECORDS[robot](weight, 12)
    solvers = [make_solver(name, ticks[0].n, ticks[0].m) for name in SUPPORTED]
    active = 0
    for qp in ticks:
        referee = by_quadprog(qp)
        for solver in solvers:
            answer = solver.solve(qp)
            assert answer.solved, solver.name
            assert np.abs(answer.x - referee).max() < 1e-6, solver.name
            assert certify(qp, answer).error_bound < 1e-6, solver.name
            active += np.count_nonzero(answer.multipliers)
    assert active > 3 * len(ticks)  # the record does exercise bounds


@pytest.mark.parametrize(("shape", "weight"), covering(SIZES, WEIGHTS), ids=str)
def test_solvers_agree_on_samples(shape, weight):
    rng = np.random.default_rng([1, shape[0], shape[3], int(1e6 * weight)])
    solvers = [make_solver(name, shape[0], shape[2] + shape[3]) for name in SUPPORTED]
    for _ in range(6):
        qp = whole_body(rng, *shape, weight, reach=float(10.0 ** rng.uniform(-1, 1)))
        answers = [solver.solve(qp) for solver in solvers]
        assert all(answer.solved for answer in answers)
        assert max(np.abs(answers[0].x - answer.x).max() for answer in answers) < 1e-6
        assert max(certify(qp, answer).error_bound for answer in answers) < 1e-6
        assert np.abs(answers[0].x - by_quadprog(qp)).max() < 1e-6


def test_every_reset_is_as_new(name):
    """Not only the first one: the same bits as a solver that has seen nothing."""
    rng = np.random.default_rng(4)
    problems = [whole_body(rng, 12, 9, 3, 6, 1e-4) for _ in range(8)]
    used = make_solver(name, 12, 9)
    for _ in range(3):
        for qp in problems[:4]:
            used.solve(qp)
        used.reset()
        fresh = make_solver(name, 12, 9)
        assert [used.solve(qp).x.tobytes() for qp in problems[4:]] == [
            fresh.solve(qp).x.tobytes() for qp in problems[4:]
        ]


def test_cold_and_warm_starts_agree(name):
    rng = np.random.default_rng(3)
    warm, cold = make_solver(name, 12, 9), make_solver(name, 12, 9)
    for _ in range(15):
        qp = whole_body(rng, 12, 9, 3, 6, 1e-4)
        assert np.abs(warm.solve(qp).x - cold.solve(qp, warm=False).x).max() < 1e-9


def test_infeasible_problem_is_called_so_and_leaves_the_next_one_alone(name):
    rng = np.random.default_rng(5)
    solver = make_solver(name, 7, 7)
    for k in range(12):
        qp = whole_body(rng, 7, 5, 3, 4, 1e-4)
        good = solver.solve(qp)
        assert good.solved
        row = 7 + k % 7
        bad = qp.copy()
        bad.lower[row], bad.upper[row] = 9.0, 9.0 if k % 7 < 3 else 10.0
        refused = solver.solve(bad)
        assert refused.flag == "infeasible"
        assert np.isfinite(refused.x).all()
        assert not qp.violation(refused.x)[:7].any()
        assert np.abs(solver.solve(qp).x - good.x).max() < 1e-9


def test_not_finite_data_reach_no_output(name):
    qp = whole_body(np.random.default_rng(6), 7, 5, 2, 3, 1e-2)
    solver = make_solver(name, 7, 5)
    good = solver.solve(qp)
    for field in ("H", "g", "lower", "upper", "A"):
        for value in (np.nan, np.inf) if field in ("H", "g", "A") else (np.nan,):
            bad = qp.copy()
            getattr(bad, field).flat[0] = value
            answer = solver.solve(bad)
            assert answer.flag == "failed"
            assert np.isfinite(answer.x).all()
            assert not answer.multipliers.any()
    assert np.abs(solver.solve(qp).x - good.x).max() < 1e-9


def test_crossed_bounds_are_infeasible(name):
    qp = whole_body(np.random.default_rng(6), 7, 5, 0, 3, 1e-2)
    qp.lower[1], qp.upper[1] = 0.2, 0.1
    assert make_solver(name, 7, 3).solve(qp).flag == "infeasible"


@pytest.mark.parametrize("rows", [0, 1])
def test_problems_without_rows_and_with_one_variable(name, rows):
    qp = QP.checked([[2.0]], [-2.0], [-1.0] + [-0.5] * rows, [0.5] + [np.inf] * rows, np.ones((rows, 1)))
    answer = make_solver(name, 1, rows).solve(qp)
    assert answer.x == pytest.approx([0.5], abs=1e-12)
    assert answer.multipliers[0] == pytest.approx(1.0, abs=1e-9)


def test_fixed_variables_and_dependent_equality_rows(name):
    rng = np.random.default_rng(7)
    for _ in range(10):
        qp = whole_body(rng, 12, 9, 4, 3, 1e-4)
        inside = np.linalg.lstsq(qp.A[:4], qp.lower[12:16], rcond=None)[0]
        qp.lower[2] = qp.upper[2] = inside[2] = 0.004
        qp.A[3] = 2.0 * qp.A[0] - qp.A[1]
        qp.A[3, 2] += 5.0  # independent only through a fixed variable
        right = qp.A[:3] @ inside
        qp.lower[12:15] = qp.upper[12:15] = right
        qp.lower[15] = qp.upper[15] = 2.0 * right[0] - right[1] + 5.0 * 0.004
        answer = make_solver(name, 12, 7).solve(qp)
        assert answer.solved
        assert certify(qp, answer).error_bound < 1e-6
        assert answer.multipliers[12 + 3] == 0.0 or answer.multipliers[12] == 0.0 or answer.multipliers[13] == 0.0


def test_weak_directions_do_not_make_equalities_infeasible():
    # the plain solver calls most of these infeasible: rows 1e-3 from dependence, weight 1e-8
    rng = np.random.default_rng(8)
    plain, prepared = make_solver("daqp", 7, 3, prepared=False), make_solver("daqp", 7, 3)
    refused = 0
    for _ in range(30):
        J = rng.normal(size=(5, 7))
        A = rng.normal(size=(3, 7))
        A[2] = A[0] - A[1] + 1e-3 * rng.normal(size=7)
        right = A @ rng.uniform(-0.1, 0.1, 7)
        lower, upper = np.concatenate((np.full(7, -1.0), right)), np.concatenate((np.full(7, 1.0), right))
        qp = QP(J.T @ J + 1e-8 * np.eye(7), rng.normal(size=7), lower, upper, A)
        refused += not plain.solve(qp, warm=False).solved
        answer = prepared.solve(qp)
        assert answer.solved
        assert np.abs(qp.A @ answer.x - right).max() < 1e-12
    assert refused > 0


def test_border_of_the_problem():
    good = {"H": np.eye(2), "g": [0, 0], "lower": [-1, -1, 0], "upper": [1, 1, np.inf], "A": [[1, 1]]}
    assert QP.checked(**good).m == 1
    for change, error in (
        ({"H": [[1, 2], [3, 4]]}, RangeError),
        ({"H": np.ones((2, 3))}, ShapeError),
        ({"H": [[np.nan, 0], [0, 1]]}, NotFiniteError),
        ({"g": [0, 0, 0]}, ShapeError),
        ({"g": ["a", "b"]}, ShapeError),
        ({"lower": [-1, -1, np.nan]}, NotFiniteError),
        ({"lower": [-1, 2, 0]}, BoundsError),
        ({"upper": [1, 1, -np.inf], "lower": [-1, -1, -np.inf]}, BoundsError),
        ({"A": [1, 1]}, ShapeError),
    ):
        with pytest.raises(error):
            QP.checked(**{**good, **change})


def test_unknown_names_and_sizes():
    with pytest.raises(UnknownNameError, match="qpoases"):
        make_solver("qpoasis", 3, 0)
    with pytest.raises(UnknownNameError):
        Conic(3, 0, "none")
    with pytest.raises(SolverError):
        Conic(3, 2, "hpipm")
    with pytest.raises(ShapeError):
        make_solver("daqp", 3, 1).solve(QP.checked(np.eye(2), [0, 0], [-1, -1], [1, 1]))
    assert set(SUPPORTED) <= set(available_solvers())
    assert set(available_solvers()) < set(available_solvers(experimental=True))


def test_supported_solver_passes_and_the_others_are_reported():
    good, refused = survey(["qpoases", "hpipm"], count=1)
    assert "note" not in good
    assert good["solved"] == good["problems"] == 24
    assert good["error"] < good["bound"] < 1e-6
    assert good["refused"] == good["infeasible"] == 20
    assert "hpipm" in refused["note"]


def test_a_hanging_child_is_ended():
    assert survey(["daqp"], count=1, timeout=0.05) == [{"solver": "daqp", "note": "not done after 0.05 s"}]
