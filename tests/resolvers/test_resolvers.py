"""Classical resolvers against stacks, where theory says that they are one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import wbc
from wbc.coordinates import CoordinatePair, FollowRows, JointRows, PairController, expressions, parts
from wbc.errors import NotFiniteError, RangeError, ShapeError
from wbc.resolvers import (
    ExtendedJacobian,
    GradientProjection,
    PseudoInverse,
    RankReduction,
    RateProblem,
    TaskPriority,
    VirtualArms,
)

PARTS = parts("spherical_4r")
ROBOT, ARM = PARTS.robot, PARTS.arms[0]
assert ARM.alpha is not None
assert ARM.middle is not None
TIP, ALPHA, ELBOW = ARM.tip, ARM.alpha, ARM.middle
Q = np.array([0.3, 0.5, -0.7, 1.1])
COMMAND = np.array([0.05, -0.02, 0.03])


def rows(*declared: Any) -> np.ndarray:
    return np.asarray(expressions.rate_function(ROBOT, declared)(Q).full())


def stack_rates(*items: tuple[wbc.tasks.Task, int, Any], damping: float = 1e-12) -> np.ndarray:
    """Rates of a plain stack at Q: (task, level, its speed, or None) each; metres count as radians."""
    stack = wbc.Stack(ROBOT, dt=0.02, damping=damping, length=1.0, calm=False)
    for k, (task, level, _) in enumerate(items):
        stack.add(task, name=f"t{k}", level=level)
    controller = stack.compile(backend="vm")
    controller.reset(Q)
    for k, (_, _, speed) in enumerate(items):
        if speed is not None:
            controller[f"t{k}"].speed = speed
    return controller.step(Q).v


def pair_rates(pair: CoordinatePair, command: np.ndarray) -> np.ndarray:
    control = PairController(ROBOT, pair, limits=False, length=1.0, backend="vm")
    control.reset(Q)
    control.command(command)
    return control.step(Q).v


def test_least_rates_are_the_stack_with_a_task_alone() -> None:
    found = PseudoInverse().resolve(RateProblem(rows(TIP), COMMAND))
    np.testing.assert_allclose(found, np.linalg.pinv(rows(TIP)) @ COMMAND, atol=1e-14)
    np.testing.assert_allclose(found, stack_rates((FollowRows(TIP), 0, COMMAND), damping=1e-8), atol=1e-8)


@pytest.mark.parametrize("damping", [1e-2, 1e-4])
def test_damped_rates_are_the_stack_with_that_damping(damping: float) -> None:
    found = PseudoInverse(damping=damping).resolve(RateProblem(rows(TIP), COMMAND))
    np.testing.assert_allclose(found, stack_rates((FollowRows(TIP), 0, COMMAND), damping=damping), atol=1e-12)


def test_weighted_rates_are_the_stack_with_a_weighted_level_below() -> None:
    weight = np.array([4.0, 1.0, 0.5, 2.0])
    found = PseudoInverse(weight).resolve(RateProblem(rows(TIP), COMMAND))
    below = wbc.tasks.Damping(weights=tuple(weight))
    np.testing.assert_allclose(found, stack_rates((FollowRows(TIP), 0, COMMAND), (below, 1, None)), atol=1e-8)
    matrix = np.diag(weight) + 0.1
    full, A = PseudoInverse(matrix).resolve(RateProblem(rows(TIP), COMMAND)), np.linalg.inv(matrix)
    J = rows(TIP)
    np.testing.assert_allclose(full, A @ J.T @ np.linalg.solve(J @ A @ J.T, COMMAND), atol=1e-12)
    damped, d = PseudoInverse(matrix, 0.01).resolve(RateProblem(J, COMMAND)), 0.01 * np.eye(3)
    np.testing.assert_allclose(damped, A @ J.T @ np.linalg.solve(J @ A @ J.T + d, COMMAND), atol=1e-12)


def test_gradient_projection_is_a_level_that_wants_the_descent() -> None:
    gradient = np.array([0.1, -0.2, 0.3, 0.05])
    found = GradientProjection(gradient).resolve(RateProblem(rows(TIP), COMMAND))
    wishes = [(FollowRows(JointRows(f"joint{k + 1}")), 1, [-g]) for k, g in enumerate(gradient)]
    np.testing.assert_allclose(found, stack_rates((FollowRows(TIP), 0, COMMAND), *wishes), atol=1e-8)
    np.testing.assert_allclose(rows(TIP) @ found, COMMAND, atol=1e-13)


def test_task_priority_is_two_levels() -> None:
    problem = RateProblem(rows(TIP), COMMAND, rows(ELBOW), np.array([0.0, 0.04, 0.02]))
    found = TaskPriority().resolve(problem)
    levels = (FollowRows(TIP), 0, COMMAND), (FollowRows(ELBOW), 1, (0.0, 0.04, 0.02))
    np.testing.assert_allclose(found, stack_rates(*levels), atol=1e-8)
    damped = TaskPriority(damping=0.1).resolve(problem)
    np.testing.assert_allclose(rows(TIP) @ damped, COMMAND, atol=1e-12)
    assert np.linalg.norm(damped) < np.linalg.norm(found)


def test_extended_jacobian_is_a_pair() -> None:
    problem = RateProblem(rows(TIP), COMMAND, rows(ALPHA))
    wanted = pair_rates(CoordinatePair(TIP, ALPHA), COMMAND)
    np.testing.assert_allclose(ExtendedJacobian().resolve(problem), wanted, atol=1e-9)
    np.testing.assert_allclose(ExtendedJacobian(1e-12).resolve(problem), wanted, atol=1e-9)


def test_rank_reduction_is_a_pair_with_locks() -> None:
    problem = RateProblem(rows(TIP), COMMAND)
    wanted = pair_rates(CoordinatePair(TIP, JointRows("joint2")), COMMAND)
    np.testing.assert_allclose(RankReduction((1,)).resolve(problem), wanted, atol=1e-9)
    moved = RankReduction((1,), np.array([0.1])).resolve(problem)
    assert moved[1] == 0.1
    np.testing.assert_allclose(rows(TIP) @ moved, COMMAND, atol=1e-13)
    # Of its own accord it gives the joint without which the rest is best conditioned
    least = [np.linalg.svd(np.delete(rows(TIP), k, axis=1), compute_uv=False)[-1] for k in range(4)]
    assert RankReduction().resolve(problem)[int(np.argmax(least))] == 0.0


def test_virtual_arms_one_at_a_time_are_an_over_determined_pair() -> None:
    elbow = np.array([0.0, 0.1, 0.0])
    found = VirtualArms().resolve(RateProblem(rows(ELBOW), elbow, rows(TIP)))
    np.testing.assert_allclose(found, pair_rates(CoordinatePair(ELBOW, TIP), elbow), atol=1e-9)
    moving = VirtualArms().resolve(RateProblem(rows(ELBOW), elbow, rows(TIP), COMMAND))
    np.testing.assert_allclose(rows(TIP) @ moving, COMMAND, atol=1e-12)


@pytest.mark.parametrize(
    ("make", "error"),
    [
        (lambda: RateProblem(np.eye(3)[0], (1, 2, 3)), ShapeError),
        (lambda: RateProblem(np.eye(3), (1, 2)), ShapeError),
        (lambda: RateProblem(np.eye(3), (1, 2, np.nan)), NotFiniteError),
        (lambda: RateProblem(np.eye(3), (1, 2, 3), np.eye(2)), ShapeError),
        (lambda: PseudoInverse(damping=-1.0), RangeError),
        (lambda: PseudoInverse(-np.eye(3)), RangeError),
        (lambda: PseudoInverse(np.eye(2)).resolve(RateProblem(np.eye(3), (1, 2, 3))), ShapeError),
        (lambda: GradientProjection((1, 2)).resolve(RateProblem(np.eye(3), (1, 2, 3))), ShapeError),
        (lambda: TaskPriority().resolve(RateProblem(np.eye(3), (1, 2, 3))), RangeError),
        (lambda: ExtendedJacobian().resolve(RateProblem(np.eye(3)[:2], (1, 2))), RangeError),
        (lambda: ExtendedJacobian().resolve(RateProblem(np.eye(2), (1, 2), None)), None),
        (lambda: ExtendedJacobian().resolve(RateProblem(np.eye(3)[:2], (1, 2), np.eye(3)[:1])), RangeError),
        (lambda: RankReduction((0, 1)).resolve(RateProblem(np.eye(3)[:2], (1, 2))), RangeError),
        (lambda: RankReduction((0,)).resolve(RateProblem(np.eye(3)[:2], (1, 2))), RangeError),
        (lambda: VirtualArms().resolve(RateProblem(np.eye(3), (1, 2, 3))), RangeError),
    ],
)
def test_bad_problems(make: Any, error: type[wbc.WbcError] | None) -> None:
    if error is None:
        np.testing.assert_array_equal(make(), (1.0, 2.0))
        return
    with pytest.raises(error):
        make()
