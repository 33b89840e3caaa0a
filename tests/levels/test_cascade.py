"""Strict levels against an independent hierarchical solver; levels that agree, contradict or lose rank."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.levels.reference import Array, Goal, hierarchy
from wbc.qp.levels.cascade import ONSET, Cascade
from wbc.qp.levels.hierarchy import Hierarchy, Level, LevelsAnswer

THRESHOLD, DAMPING = 1.6e-7, 1e-8
NONE: NDArray[np.intp] = np.zeros(0, dtype=np.intp)


def level(rows: Array, b: Array, weight: Array | None = None, soft: NDArray[np.intp] = NONE) -> Level:
    """A level of wished values b."""
    w = np.ones(len(b)) if weight is None else weight
    return Level(rows, w, rows.T @ (w * b), soft, 1.0)


def goal(of: Level, b: Array) -> Goal:
    """The same for the reference."""
    root = np.sqrt(of.weight)
    return Goal(root[:, None] * of.rows, root * b, of.soft)


def answer(levels: list[Level], bound: float = 10.0, x: Array | None = None) -> LevelsAnswer:
    """Levels within bounds, from x."""
    n = levels[0].rows.shape[1]
    start = np.zeros(n) if x is None else x
    sides = np.full(n, -bound), np.full(n, bound)
    return Cascade(n, 0, THRESHOLD, DAMPING).solve(Hierarchy(start, *sides, np.zeros((0, n)), levels))


def random_problem(rng: np.random.Generator) -> tuple[Hierarchy, list[Goal]]:
    """Two to three levels with weights, repeated rows, equalities, redundant equalities and rows at levels."""
    n, m = int(rng.integers(3, 9)), int(rng.integers(0, 6))
    bound = float(rng.choice([0.3, 0.6, 2.0, 10.0]))
    A, x = rng.normal(size=(m, n)), rng.uniform(-bound, bound, n).clip(-0.5, 0.5)
    lower = np.concatenate((np.full(n, -bound), A @ x - rng.uniform(0, 1, m)))
    upper = np.concatenate((np.full(n, bound), A @ x + rng.uniform(0, 1, m)))
    if m > 1 and rng.random() < 0.4:
        A[1] = 2.0 * A[0]
        lower[n : n + 2] = upper[n : n + 2] = (A @ x)[:2]
    levels: list[Level] = []
    goals: list[Goal] = []
    for place in range(int(rng.integers(2, 4))):
        count = int(rng.integers(1, 5))
        rows, b, weight = rng.normal(size=(count, n)), rng.normal(size=count), 10.0 ** rng.uniform(-2, 0, count)
        if levels and rng.random() < 0.4:
            rows[0] = levels[-1].rows[0]
        soft = NONE
        if m > 3 + place and rng.random() < 0.5:
            soft = np.array([m - 1 - place])
            i = n + m - 1 - place
            lower[i] = A[m - 1 - place] @ x + rng.normal()
            upper[i] = lower[i] + rng.choice([0.0, 0.5])
        levels.append(level(rows, b, weight / weight.max(), soft))
        goals.append(goal(levels[-1], b))
    return Hierarchy(x, lower, upper, A, levels), goals


def test_random_hierarchies_have_the_optimum_of_the_reference() -> None:
    rng = np.random.default_rng(5)
    binding = 0
    for _ in range(90):
        problem, goals = random_problem(rng)
        found = Cascade(problem.x.size, len(problem.A), THRESHOLD, DAMPING).solve(problem)
        wanted = hierarchy(problem.x, problem.lower, problem.upper, problem.A, goals)
        assert all(result.solved for result in found.levels)
        if min(result.singular for result in found.levels) < ONSET:
            continue  # damped on purpose, see below
        assert np.abs(found.x - wanted).max() <= 1e-9
        assert max(result.disturbance for result in found.levels) <= 1e-9
        assert max(result.stationarity for result in found.levels) <= 1e-9
        binding += bool((found.multipliers != 0.0).any())
    assert binding >= 40


def test_redundant_levels_change_nothing() -> None:
    rows, b = np.array([[1.0, 1.0, 0.0], [0.0, 1.0, 1.0]]), np.array([0.3, -0.2])
    once, twice = answer([level(rows, b)]), answer([level(np.vstack((rows, rows)), np.tile(b, 2)), level(rows, b)])
    assert np.abs(once.x - twice.x).max() <= 1e-12
    assert (twice.levels[0].rank, twice.levels[1].rank) == (2, 0)
    assert twice.levels[0].damping == 0.0
    assert (twice.levels[1].share <= 1e-12).all()


def test_no_damping_away_from_rank_loss_and_a_price_near_it() -> None:
    b = np.array([1.0, 0.5])
    for sigma, exact in ((1.0, True), (ONSET, True), (1e-3, False), (1e-5, False)):
        rows = np.array([[1.0, 0.0, 0.0], [0.0, sigma, 0.0]])
        found = answer([level(rows, b)], bound=np.inf)
        off = float(np.linalg.norm(rows @ found.x - b))
        assert found.levels[0].singular == pytest.approx(min(sigma, 1.0), rel=0.5)
        assert (off <= 1e-12) == exact
        assert found.levels[0].damping == pytest.approx(off, abs=1e-12)


def test_the_price_of_damping_is_no_less_than_what_limits_leave_of_it() -> None:
    rows = np.array([[1.0, 0.0], [1.0, 1e-4]])
    found = answer([level(rows, np.array([0.1, 0.1 + 2e-4]))], bound=1.0)
    best = np.array([0.1, 1.0])
    worse = (
        np.linalg.norm(rows @ found.x - [0.1, 0.1 + 2e-4]) ** 2 - np.linalg.norm(rows @ best - [0.1, 0.1 + 2e-4]) ** 2
    )
    assert 0.0 <= np.sqrt(max(worse, 0.0)) <= found.levels[0].damping + 1e-12


def test_a_sweep_of_a_singular_value_through_the_threshold_switches_once() -> None:
    sweep = np.geomspace(1e-1, 1e-9, 400)
    speeds, free = [], []
    for sigma in sweep:
        upper = level(np.array([[1.0, 0.0], [0.0, sigma]]), np.array([0.2, 0.1]))
        lower = level(np.array([[0.0, 1.0]]), np.array([-0.7]))
        found = answer([upper, lower], bound=1.0)
        speeds.append(found.x)
        free.append(found.levels[0].free)
        assert abs(upper.rows[1] @ found.x - upper.rows[1] @ found.levels[0].x) <= 1e-6
    switches = np.flatnonzero(np.diff(free))
    assert len(switches) == 1
    assert sweep[switches[0] + 1] < THRESHOLD <= sweep[switches[0]]
    changes = np.abs(np.diff(np.array(speeds), axis=0)).max(axis=1)
    # all of what a joint may do, once; between neighbours elsewhere no more than the sweep itself
    assert changes[switches[0]] <= 2.0
    assert np.delete(changes, switches).max() <= 0.12
    assert np.abs(np.array(speeds)[-1] - [0.2, -0.7]).max() <= 1e-9


def test_rank_decisions_do_not_depend_on_weights_or_on_faint_noise() -> None:
    rng = np.random.default_rng(3)
    rows = rng.normal(size=(3, 5))
    noise = rows[:1] + 1e-12 * rng.normal(size=(1, 5))
    found = answer([level(rows, np.zeros(3), np.array([1.0, 1e-6, 1e-3])), level(noise, np.array([1.0]))])
    assert (found.levels[0].rank, found.levels[1].rank) == (3, 0)
    assert np.abs(found.x).max() <= 1e-9
