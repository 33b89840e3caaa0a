"""Full Space Parameterization: the space of all solutions, and the best one, against theory and the stack's QP."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from tests.repeats import repeats
from tests.resolvers.given_rows import stack_rates
from wbc.errors import CompileError, InfeasibleError, NotFiniteError, RangeError, ShapeError, UnknownNameError, WbcError
from wbc.native import kernel
from wbc.resolvers import FullSpace, PseudoInverse, RateProblem
from wbc.resolvers.fsp import (
    Consistency,
    Criterion,
    EqualityRow,
    SolutionSpace,
    best,
    blocked,
    compiled,
    joint_row,
    least_acceleration,
    least_power,
    least_torque,
    lost_rows,
    one_shot,
    orthogonal,
    parametric,
    pattern_counts,
    point_row,
)

KINDS = ("plain", "equal rows", "zero column", "parallel columns", "row units", "column units", "sparse", "prismatic")


def system(kind: str, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """A consistent task of a family: any rank, any size up to 12 joints, rates that need not all columns."""
    rng = np.random.default_rng(seed)
    m = int(rng.integers(2, 13))
    n = int(rng.integers(1, m + 2))
    J = rng.normal(size=(n, m))
    if kind == "equal rows":
        J[-1] = 2.0 * J[0]
    if kind == "zero column":
        J[:, rng.integers(m)] = 0.0
    if kind == "parallel columns":
        J[:, -1] = -0.5 * J[:, 0]
    if kind == "row units":
        J *= 10.0 ** rng.uniform(-4, 4, (n, 1))
    if kind == "column units":
        J *= 10.0 ** rng.uniform(-3, 3, m)
    if kind == "sparse":
        J *= rng.random((n, m)) < 0.5
        J[0, 0] = 1.0
    if kind == "prismatic":
        J[:, ::2] *= 0.0254
    v = rng.normal(size=m) * (rng.random(m) < rng.choice([1.0, 0.4]))
    return J, J @ v


def off(space: SolutionSpace, v: np.ndarray) -> float:
    """How far rates are from doing the task, against what their parts do."""
    size = (np.abs(space.J) @ np.abs(v)).max() + 1e-300
    return float((np.abs(space.J @ v - space.x)).max() / size)


@settings(max_examples=30)
@given(st.sampled_from(KINDS), st.integers(0, 10**6))
def test_both_generators_span_the_same_space(kind: str, seed: int) -> None:
    J, x = system(kind, seed)
    smooth, pinned = orthogonal(J, x), blocked(J, x)
    assert smooth.span == pinned.span == J.shape[1] - len(smooth.idle) - smooth.rank + 1
    assert smooth.rank == pinned.rank == np.linalg.matrix_rank(J / np.maximum(np.abs(J).max(axis=1), 1e-300)[:, None])
    assert max(off(space, g) for space in (smooth, pinned) for g in space.vectors) < 1e-9
    for one, other in ((smooth, pinned), (pinned, smooth)):
        for g in one.vectors:
            assert other.coordinates(g)[1] < 1e-7 * max(np.linalg.norm(g), 1e-12)
    for k, block in enumerate(pinned.blocks[: pinned.span - pinned.completed]):
        assert len(block) == J.shape[1] - len(pinned.idle) - pinned.rank
        assert not pinned.vectors[k][[*block, *pinned.idle]].any()


@pytest.mark.parametrize("kind", KINDS)
def test_compiled_and_numpy_are_the_same(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Spaces, with joints held and free, rates that contradict each other, any layout; best rates by any criterion."""
    assert compiled.library() is not None
    for seed in range(repeats(20)):
        J, x = system(kind, seed)
        rng, m = np.random.default_rng(seed), J.shape[1]
        J = (J, np.asfortranarray(J), J[:, ::-1])[seed % 3]
        x = x + (rng.normal(size=len(x)) * np.abs(x).max() if seed % 5 == 0 else 0.0)
        held = np.flatnonzero(rng.random(m) < 0.15) if seed % 2 else ()
        root, r = rng.normal(size=(m, m)), rng.normal(size=m)
        H = (None, np.exp(r), root @ root.T + np.eye(m))[rng.integers(3)]
        criterion = Criterion(H, r if seed % 2 else None)
        rows = [EqualityRow(f"row {k}", rng.integers(-1, 2, m), rng.normal()) for k in range(rng.integers(5))]
        for make in (orthogonal, blocked):
            found = []
            for most in (compiled.MOST, 0):
                monkeypatch.setattr(compiled, "MOST", most)
                try:
                    space = make(J, x, held=held, free=bool(seed % 4), project=seed % 10 > 0)
                except WbcError as error:
                    found.append((type(error), None, None))
                    continue
                state = space.rank, space.idle, space.span, space.status, pytest.approx(space.missed, abs=1e-9)
                found.append((state, space, best(space, criterion, rows, in_order=True)))
            monkeypatch.undo()
            (one, space, v), (other, numpys, u) = found
            assert one == other
            if space is None:
                continue
            for g in numpys.vectors:
                assert space.coordinates(g)[1] < 1e-7 * max(np.linalg.norm(g), 1e-12)
            assert (v.kept, v.redundant, v.left_out) == (u.kept, u.redundant, u.left_out)
            np.testing.assert_allclose(v.v, u.v, rtol=0, atol=1e-7 * max(1.0, np.abs(u.v).max()))


def test_without_a_compiler_numpy_does_it(monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> None:
    """And without a library that was compiled before."""

    def refuse(*sources: Path) -> Path:
        raise CompileError("compiler", None, "none was found")

    monkeypatch.setattr(kernel, "kernel", refuse)
    monkeypatch.setattr(compiled, "_loaded", compiled._loaded.__wrapped__)
    J, x = system("plain", 3)
    np.testing.assert_allclose(best(blocked(J, x)).v, np.linalg.pinv(J) @ x, atol=1e-9)
    assert "made by numpy" in caplog.text


@settings(max_examples=25)
@given(st.sampled_from(KINDS), st.integers(0, 10**6))
def test_exchange_finds_what_every_pattern_finds(kind: str, seed: int) -> None:
    J, x = system(kind, seed)
    quick, all_patterns = blocked(J, x), blocked(J, x, search="exhaustive")
    assert (quick.span, quick.completed) == (all_patterns.span, all_patterns.completed)


@settings(max_examples=30)
@given(st.integers(0, 10**6), st.sampled_from([orthogonal, blocked]))
def test_weights_with_sum_one_are_solutions_and_with_sum_zero_self_motions(seed: int, make: Any) -> None:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 6))
    J, x = rng.normal(size=(n, n + int(rng.integers(1, 6)))), rng.normal(size=n)
    space = make(J, x)
    t = rng.normal(size=space.span)
    still = t - t.mean()
    t[0] += 1.0 - t.sum()
    size = np.abs(space.vectors).max() * np.abs(t).max()
    assert np.abs(J @ space.at(t) - x).max() < 1e-9 * size
    assert np.abs(J @ space.at(still)).max() < 1e-9 * size
    # Any solution has its weights
    v = np.linalg.pinv(J) @ x + (np.eye(J.shape[1]) - np.linalg.pinv(J) @ J) @ rng.normal(size=J.shape[1])
    t, left = space.coordinates(v)
    assert left < 1e-9 * size
    assert t.sum() == pytest.approx(1.0, abs=1e-9 * np.abs(t).max())


@pytest.mark.parametrize(("joints", "rows"), [(4, 2), (4, 3), (7, 3), (7, 6), (10, 3), (10, 6)])
@pytest.mark.parametrize("make", [orthogonal, blocked])
def test_least_norm_is_the_pseudo_inverse(joints: int, rows: int, make: Any) -> None:
    rng = np.random.default_rng(joints * rows)
    for _ in range(50):
        J, x = rng.normal(size=(rows, joints)), rng.normal(size=rows)
        space, wanted = make(J, x), np.linalg.pinv(J) @ x
        bound = 1e-12 * np.linalg.cond(J) * np.abs(space.vectors).max()
        np.testing.assert_allclose(best(space).v, wanted, rtol=0, atol=max(1e-9, bound))
        np.testing.assert_allclose(space.at(parametric(space)), wanted, rtol=0, atol=1e-12 * space.condition())


def test_the_orthogonal_one_is_the_better_conditioned() -> None:
    rng = np.random.default_rng(3)
    for _ in range(100):
        J, x = rng.normal(size=(3, 10)), rng.normal(size=3)
        smooth, pinned = orthogonal(J, x), blocked(J, x)
        # I + |p|^2 e e' has this condition
        p = smooth.vectors[0]
        assert smooth.condition() < 10.0 * max(1.0 + smooth.span * (p @ p), (1.0 + p @ p) * smooth.span / (p @ p))
        assert np.linalg.cond(smooth.directions) == pytest.approx(1.0, abs=1e-9)
        assert np.linalg.cond(pinned.directions) > 2.0
        assert len(pinned.conditions) == pinned.span


def test_patterns_as_the_report_counts_them() -> None:
    assert pattern_counts(4, 2) == (6, 3, 20)
    assert pattern_counts(7, 6) == (7, 2, 21)
    # It prints 840 261 910 994
    assert pattern_counts(10, 3) == (120, 8, 840_261_910_995)


def random_problem(seed: int) -> tuple[Any, ...]:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 5))
    m = n + int(rng.integers(1, 6))
    k = int(rng.integers(0, m - n + 1))
    J, x, A, d = rng.normal(size=(n, m)), rng.normal(size=n), rng.normal(size=(k, m)), rng.normal(size=k)
    root = rng.normal(size=(m, m))
    return J, x, A, d, root @ root.T + np.eye(m), rng.normal(size=m)


@settings(max_examples=40)
@given(st.integers(0, 10**6), st.sampled_from(["plain", "diagonal", "matrix"]), st.booleans())
def test_the_closed_form_is_the_optimum(seed: int, weighting: str, aimed: bool) -> None:
    J, x, A, d, H, r = random_problem(seed)
    weight = {"plain": None, "diagonal": np.diag(H), "matrix": H}[weighting]
    H = np.eye(len(r)) if weight is None else np.diag(weight) if weight.ndim == 1 else weight
    criterion = Criterion(weight, r if aimed else None)
    r = r if aimed else 0.0 * r
    S, b, G = np.vstack((J, A)), np.concatenate((x, d)), np.linalg.inv(H)
    wanted = r + G @ S.T @ np.linalg.solve(S @ G @ S.T, b - S @ r)
    bound = 1e-11 * max(1.0, np.abs(wanted).max()) * np.linalg.cond(S) ** 2
    rows = [EqualityRow(f"row {k}", a, value) for k, (a, value) in enumerate(zip(A, d, strict=True))]
    for make in (orthogonal, blocked):
        found = best(make(J, x), criterion, rows)
        np.testing.assert_allclose(found.v, wanted, rtol=0, atol=bound)
        np.testing.assert_allclose(make(J, x).at(found.t), found.v, rtol=0, atol=bound * max(1, np.abs(found.t).max()))
        assert found.kept == tuple(row.name for row in rows)
        if not aimed:
            space = make(J, x)
            one = space.at(parametric(space, rows, weight=weight))
            np.testing.assert_allclose(one, wanted, rtol=0, atol=1e-13 * space.condition(weight) * bound / 1e-11)
    fused = one_shot(J, x, A, d, criterion)
    assert fused is not None
    np.testing.assert_allclose(fused, wanted, rtol=0, atol=bound)
    problem = RateProblem(J, x, A, d)
    for generator in ("orthogonal", "blocked"):
        np.testing.assert_allclose(FullSpace(criterion, generator).resolve(problem), wanted, rtol=0, atol=bound)


@settings(max_examples=40)
@given(st.integers(0, 10**6), st.sampled_from([orthogonal, blocked]))
def test_planted_loss_of_rank(seed: int, make: Any) -> None:
    """Any rank, in any units, some joints held, any rates: a space of the nearest, or that no joint moves."""
    rng = np.random.default_rng(seed)
    m = int(rng.integers(1, 13))
    n = int(rng.integers(1, m + 3))
    rank = int(rng.integers(1, min(n, m) + 1))
    scale = 10.0 ** rng.uniform(-6, 6)
    J = scale * rng.normal(size=(n, rank)) @ rng.normal(size=(rank, m)) * (rng.random(m) < 0.9)
    x = J @ rng.normal(size=m) + scale * rng.normal(size=n) * (rng.random() < 0.3)
    held = np.flatnonzero(rng.random(m) < 0.1).tolist()
    try:
        space = make(J, x, held=held, project=True)
    except RangeError:
        assert len(held) == m or not np.delete(J, held, axis=1).any()
        return
    active = [k for k in range(m) if k not in space.idle]
    assert space.rank == np.linalg.matrix_rank(J[:, active])
    assert space.span == len(active) - space.rank + 1
    assert not space.vectors[:, held].any()
    norms = np.linalg.norm(J[:, active], axis=1)
    norms[norms == 0.0] = 1.0
    wanted = np.zeros(m)
    wanted[active] = np.linalg.pinv(J[:, active] / norms[:, None], rcond=1e-10) @ (x / norms)
    np.testing.assert_allclose(best(space).v, wanted, rtol=0, atol=1e-7 * max(1.0, np.abs(space.vectors).max()))


@pytest.mark.parametrize("seed", range(12))
def test_equal_to_the_stack_on_equalities(seed: int) -> None:
    """1e-8: the task and the constraints as one level, the criterion as the level below."""
    rng = np.random.default_rng(seed)
    k = (1, 2, 4, 6)[seed % 4]
    J, x, A, d = rng.normal(size=(3, 10)), rng.normal(size=3), rng.normal(size=(k, 10)), rng.normal(size=k)
    inertia = rng.normal(size=(10, 10))
    inertia = inertia @ inertia.T / 10.0 + np.eye(10)
    bias, now, dt = rng.normal(size=10), rng.normal(size=10), 0.1
    exact = np.vstack((J, A)), np.concatenate((x, d))
    problem = RateProblem(J, x, A, d)
    for criterion in (
        Criterion(),
        Criterion(rng.uniform(0.2, 5.0, 10)),
        Criterion(inertia),
        least_acceleration(now),
        least_torque(inertia, bias, now, dt),
        least_power(inertia, bias, now, dt),
    ):
        H = np.ones(10) if criterion.weight is None else criterion.weight
        root = np.linalg.cholesky(np.diag(H) if H.ndim == 1 else H).T
        r = np.zeros(10) if criterion.reference is None else criterion.reference
        scale = np.linalg.norm(root, 2)
        below = root / scale, root @ r / scale
        found = FullSpace(criterion).resolve(problem)
        np.testing.assert_allclose(found, stack_rates(exact, below), rtol=0, atol=1e-8)


def test_criteria_are_what_they_say() -> None:
    rng = np.random.default_rng(5)
    root = rng.normal(size=(6, 6))
    inertia, bias, now, dt = root @ root.T + np.eye(6), rng.normal(size=6), rng.normal(size=6), 0.02
    J, x = rng.normal(size=(3, 6)), rng.normal(size=3)

    def torque(v: np.ndarray) -> np.ndarray:
        return inertia @ (v - now) / dt + bias

    values = {
        "torque": (least_torque(inertia, bias, now, dt), lambda v: torque(v) @ torque(v)),
        "power": (least_power(inertia, bias, now, dt), lambda v: v @ torque(v)),
        "acceleration": (least_acceleration(now), lambda v: (v - now) @ (v - now)),
        "energy": (Criterion(inertia), lambda v: v @ inertia @ v),
    }
    space = orthogonal(J, x)
    for criterion, value in values.values():
        found = best(space, criterion).v
        for _ in range(30):
            other = found + rng.normal(size=space.span - 1) @ space.directions * 0.1
            assert value(found) < value(other)
            # The same differences, so the same function up to a constant
            assert criterion(other) - criterion(found) == pytest.approx(value(other) - value(found), rel=1e-6)


def test_dependent_rows_leave_and_inconsistent_ones_are_refused_or_projected() -> None:
    rng = np.random.default_rng(6)
    J = rng.normal(size=(4, 7))
    J[3] = J[0] - 2.0 * J[1]
    x = J @ rng.normal(size=7)
    for make in (orthogonal, blocked):
        space = make(J, x)
        assert (space.status, space.rank, space.span) == (Consistency.REDUCED, 3, 5)
        with pytest.raises(InfeasibleError, match="contradict each other: row"):
            make(J, x + [0, 0, 0, 0.1])
        near = make(J, x + [0, 0, 0, 0.1], project=True)
        assert near.status is Consistency.INCONSISTENT
        assert near.missed > 0.01
        np.testing.assert_allclose(J @ near.vectors[0], near.x, atol=1e-12)
        norms = np.linalg.norm(J, axis=1)
        left = (near.x - x - [0, 0, 0, 0.1]) / norms
        np.testing.assert_allclose((J / norms[:, None]).T @ left, 0.0, atol=1e-12)
        # With joints at rest the nearest rates are those that the others have
        still = make(J, x, held=range(1, 7), project=True)
        size, sign = np.abs(J[:, 0]), np.sign(J[:, 0])
        np.testing.assert_allclose(still.x / size, sign * (sign @ (x / size)) / len(x), atol=1e-12)
        np.testing.assert_allclose(J @ still.vectors[0], still.x, atol=1e-12)


def test_zero_rows_zero_columns_and_zero_rates() -> None:
    rng = np.random.default_rng(7)
    J = rng.normal(size=(3, 6))
    J[:, 2], J[1] = 0.0, 0.0
    for make in (orthogonal, blocked):
        space = make(J, J @ rng.normal(size=6))
        assert (space.idle, space.rank, space.span) == ((2,), 2, 4)
        assert not space.vectors[:, 2].any()
        loose = make(J, space.x, free=True)
        assert (loose.idle, loose.span) == ((), 5)
        still = make(J, np.zeros(3))
        assert still.span == 4
        np.testing.assert_array_equal(best(still).v, 0.0)
        # Self-motion alone meets a constraint: the second step of the two-step method
        row = joint_row("elbow", 4, 6, 0.02)
        moved = best(still, rows=[row]).v
        assert moved[4] == pytest.approx(0.02, abs=1e-12)
        np.testing.assert_allclose(J @ moved, 0.0, atol=1e-12)
        fixed = make(J, space.x, held=(0, 5))
        assert not fixed.vectors[:, [0, 2, 5]].any()


@pytest.mark.parametrize("make", [orthogonal, blocked])
def test_a_row_of_rounding_is_no_row(make: Any) -> None:
    """A level wrist never pitches, and its row has 1e-17 where algebra has 0."""
    rng = np.random.default_rng(12)
    J = rng.normal(size=(4, 7))
    J[2] = 1e-17 * rng.normal(size=7)
    x = J @ rng.normal(size=7)
    space = make(J, x)
    assert (space.rows, space.span, space.status) == ((0, 1, 3), 5, Consistency.REDUCED)
    assert np.abs(space.vectors).max() < 1e3
    with pytest.raises(InfeasibleError, match="row 2"):
        make(J, x + [0, 0, 0.01, 0])
    problem = RateProblem(J[:3], x[:3], J[3:], x[3:])
    np.testing.assert_allclose(FullSpace().resolve(problem), np.linalg.pinv(J, rcond=1e-12) @ x, atol=1e-9)


def test_blocked_solutions_alone_do_not_always_span() -> None:
    """Joints 2 and 3 move the second row alone, of which no rate is asked: every block leaves them still."""
    J, x = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 1.0]]), np.array([1.0, 0.0])
    space = blocked(J, x)
    assert (space.span, space.completed) == (2, 1)
    np.testing.assert_allclose(J @ space.vectors.T, [[1, 1], [0, 0]], atol=1e-15)


def test_a_row_that_is_nearly_lost_comes_back_as_a_constraint() -> None:
    rng = np.random.default_rng(8)
    J = rng.normal(size=(3, 7))
    J[2] = J[0] + 1e-7 * J[2]
    x = J @ rng.normal(size=7)
    whole = np.linalg.pinv(J) @ x
    reduced = blocked(J[:2], x[:2])
    assert max(reduced.conditions) < 1e3
    v = best(reduced, rows=lost_rows(J, x, [2])).v
    assert np.abs(J @ v - x).max() < 1e-12
    assert np.linalg.norm(v) == pytest.approx(np.linalg.norm(whole), rel=1e-6)


def test_constraints_that_contradict_are_named_and_given_up_in_order() -> None:
    rng = np.random.default_rng(9)
    J, x = rng.normal(size=(3, 7)), rng.normal(size=3)
    rows = [joint_row(f"limit {k}", k, 7, 0.1) for k in range(4)]
    summed = EqualityRow("sum", rows[0].a + rows[2].a, 0.3)
    space = orthogonal(J, x)
    with pytest.raises(InfeasibleError, match="limit 0 and limit 2 and sum contradict each other"):
        best(space, rows=[*rows[:3], summed])
    found = best(space, rows=[*rows[:3], summed, EqualityRow("again", 2.0 * rows[1].a, 0.2)], in_order=True)
    assert (found.kept, found.left_out, found.redundant) == (("limit 0", "limit 1", "limit 2"), ("sum",), ("again",))
    np.testing.assert_allclose(found.v[:3], 0.1, atol=1e-12)
    # One more than there are degrees of redundancy
    five = [*rows, joint_row("limit 4", 4, 7, 0.1)]
    assert best(space, rows=five, in_order=True).left_out == ("limit 4",)
    with pytest.raises(InfeasibleError, match="limit 4"):
        best(space, rows=five)
    with pytest.raises(InfeasibleError, match="row of the task contradicts the task"):
        best(space, rows=[EqualityRow("row of the task", J[0], x[0] + 1.0)])
    assert best(space, rows=[EqualityRow("row of the task", J[0], x[0])]).redundant == ("row of the task",)


def test_an_inequality_asks_for_less() -> None:
    """A constraint that its optimum keeps by itself costs an equality something, and an inequality nothing."""
    rng = np.random.default_rng(10)
    J, x = rng.normal(size=(3, 7)), rng.normal(size=3)
    free = PseudoInverse().resolve(RateProblem(J, x))
    held = best(orthogonal(J, x), rows=[joint_row("limit", 2, 7, free[2] - 0.5)]).v
    assert free[2] >= held[2]
    assert free @ free < held @ held - 0.1


@settings(max_examples=30)
@given(st.sampled_from(KINDS), st.integers(0, 10**6), st.integers(0, 8))
def test_whatever_the_constraints_the_answer_is_finite_or_refused(kind: str, seed: int, count: int) -> None:
    J, x = system(kind, seed)
    rng = np.random.default_rng(seed)
    rows = [EqualityRow(f"row {k}", rng.integers(-1, 2, J.shape[1]), rng.normal()) for k in range(count)]
    space = blocked(J, x, project=True)
    found = best(space, rows=rows, in_order=True)
    assert np.isfinite(found.v).all()
    assert sorted((*found.kept, *found.redundant, *found.left_out)) == sorted(row.name for row in rows)
    size = np.abs(space.vectors).max() * max(1.0, np.abs(found.t).sum())
    for row in rows:
        if row.name in found.kept:
            assert abs(row.a @ found.v - row.value) < 1e-6 * max(1.0, size)


@pytest.mark.parametrize(
    ("call", "error"),
    [
        (lambda: orthogonal([1.0, 2.0], [1.0]), ShapeError),
        (lambda: orthogonal(np.eye(2), [1.0, np.nan]), NotFiniteError),
        (lambda: orthogonal(np.zeros((2, 3)), [0.0, 0.0]), RangeError),
        (lambda: orthogonal(np.ones((1, 3)), [1.0], held=(0, 1, 2)), RangeError),
        (lambda: orthogonal(np.ones((1, 3)), [1.0], held=(3,)), RangeError),
        (lambda: orthogonal([[1.0, 0.0, 0.0]], [1.0], held=(0,)), RangeError),
        (lambda: orthogonal(np.random.default_rng(0).normal(size=(5, 3)), np.ones(5)), InfeasibleError),
        (lambda: blocked(np.random.default_rng(0).normal(size=(5, 3)), np.ones(5)), InfeasibleError),
        (lambda: blocked(np.ones((1, 3)), [1.0], search="quick"), UnknownNameError),
        (lambda: best(orthogonal(np.ones((1, 3)), [1.0]), Criterion(np.ones(2))), ShapeError),
        (lambda: best(orthogonal(np.ones((1, 3)), [1.0]), rows=[EqualityRow("r", np.ones(2), 1.0)]), ShapeError),
        (lambda: orthogonal(np.ones((1, 3)), [1.0]).at([1.0]), ShapeError),
        (lambda: parametric(orthogonal(np.ones((1, 3)), [0.0])), RangeError),
        (lambda: Criterion(-np.ones(3)), RangeError),
        (lambda: Criterion(np.arange(9.0).reshape(3, 3)), ShapeError),
        (lambda: Criterion(None, np.eye(2)), ShapeError),
        (lambda: least_torque(-np.eye(2), [0, 0], [0, 0], 0.1), RangeError),
        (lambda: least_power(np.eye(2), [0, 0], [0, 0], 0.0), RangeError),
        (lambda: point_row("p", np.zeros((3, 4)), [0, 0, 2], 0.1), RangeError),
        (lambda: point_row("p", np.zeros(4), [0, 0, 1], 0.1), ShapeError),
        (lambda: joint_row("j", 4, 4, 0.1), RangeError),
        (lambda: EqualityRow("r", np.eye(2), 0.1), ShapeError),
        (lambda: FullSpace(generator="svd"), UnknownNameError),
        (lambda: FullSpace(np.eye(3)), ShapeError),
    ],
)
def test_bad_input(call: Any, error: type[WbcError]) -> None:
    with pytest.raises(error):
        call()
