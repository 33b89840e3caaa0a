"""Gradients backwards are those of each tick's derivative."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import wbc
from tests.refusals import assert_refused
from tests.repeats import repeats
from wbc.errors import ShapeError, SolverError, UnknownNameError
from wbc.multibody import pin

pytestmark = pytest.mark.compiled


def stack_of(seed: int) -> tuple[wbc.Stack, str]:
    rng = np.random.default_rng(seed)
    # Slow enough that joints are at their limits
    robot = wbc.robots.load(["panda", "ur5", "solo8"][seed % 3]).with_limits(velocity=0.3)
    frame = [str(f.name) for f in robot.model.frames if f.type == pin.FrameType.BODY][-1]
    stack = wbc.Stack(robot, dt=0.02, calm=False).add(wbc.tasks.EndEffector(frame), name="hand")
    stack.add(wbc.tasks.Posture(), name="posture", weight=float(rng.uniform(1e-3, 1.0)))
    stack.add(wbc.tasks.JointLimits())
    if rng.random() < 0.7:
        here = robot.pose(robot.neutral, frame).translation
        stack.add(wbc.tasks.WorkspaceBox(frame, lower=here - 0.1, upper=here + 0.1), name="box")
    return stack, frame


@pytest.mark.parametrize("seed", range(repeats(3)))
def test_gradients_are_those_of_the_derivative(seed: int) -> None:
    stack, frame = stack_of(seed)
    robot, rng, n = stack.robot, np.random.default_rng(seed), 70
    controller = stack.compile(backend="native")
    batch = controller.batch(n, threads=2)
    q = np.array([robot.integrate(robot.neutral, 0.03 * rng.normal(size=robot.nv)) for _ in range(n)])
    for k, one in enumerate(q):
        ends = robot.limits.position_lower, robot.limits.position_upper
        if robot.nq == robot.nv:
            q[k] = np.clip(one, *ends)
    targets = np.array([(robot.pose(one, frame) * pin.exp6(0.3 * rng.normal(size=6))).homogeneous for one in q])
    batch.set(hand=targets)
    step = batch.step(q)
    weights = rng.normal(size=(n, robot.nv))
    pulled, good = step.pull(weights), step.solved
    assert good.sum() > n // 2
    assert not pulled.by("q")[~good].any()
    bound = 0
    for k in np.flatnonzero(good)[:25].tolist():
        bound += bool(step[k].binding)
        by_hand = weights[k] @ step[k].derivative("hand", "target")
        found = pulled.by("hand", "target")[k]
        matrix, rotation = found[:9].reshape(3, 3, order="F"), targets[k][:3, :3]
        turn = matrix @ rotation.T
        turned = [turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]
        scale = 1e-5 * (1.0 + np.abs(by_hand).max())
        assert np.allclose([*found[9:], *turned], by_hand, atol=scale)
        if robot.nq == robot.nv:
            by_q = weights[k] @ step[k].derivative("q")
            assert np.allclose(pulled.by("q")[k], by_q, atol=1e-5 * (1.0 + np.abs(by_q).max()))
            by_posture = weights[k] @ step[k].derivative("posture", "target")
            assert np.allclose(pulled.by("posture", "target")[k], by_posture, atol=scale)
    assert bound or robot.base_nv
    assert_refused(lambda: pulled.by("foot", "target"), UnknownNameError, "hand")
    assert_refused(lambda: step.pull(weights[0][:-1]), ShapeError, "weights")
    step.keep()
    batch.step(q)
    assert np.array_equal(step.pull(weights).by("q"), pulled.by("q"))


def test_stacks_without_a_backward_pass_say_why() -> None:
    def pull(declared: wbc.Stack) -> Any:
        batch = declared.compile(backend="native").batch(2)
        return batch.step(declared.robot.neutral).pull(np.ones((2, declared.robot.nv)))

    robot = wbc.robots.load("panda")

    def stack(**options: Any) -> wbc.Stack:
        return wbc.Stack(robot, dt=0.02, **options).add(wbc.tasks.Posture(), name="posture")

    assert pull(stack(calm=False)).by("q").shape == (2, 7)
    assert_refused(lambda: pull(stack()), SolverError, "calm=False")
    two = stack(calm=False).add(wbc.tasks.Damping(), level=1)
    assert_refused(lambda: pull(two), SolverError, "strict levels")
