"""Poses proven out of reach: none that a configuration has, and most that are far away."""

from __future__ import annotations

import numpy as np
import pytest

import wbc
from wbc.errors import ShapeError, WbcError
from wbc.ik.reach import beyond_reach
from wbc.robot import Robot
from wbc.tasks import EndEffector, JointLimits


def entry_of(robot: Robot, **more: object) -> object:
    stack = wbc.Stack(robot, dt=0.01)
    stack.add(EndEffector(robot.frames["tip"], **more), name="hand")  # type: ignore[arg-type]
    return stack.entries[0]


def numbers(robot: Robot, q: np.ndarray) -> np.ndarray:
    pose = robot.pose(q, robot.frames["tip"])
    return np.concatenate([pose.rotation.T.ravel(), pose.translation])


@pytest.mark.parametrize("name", ["panda", "ur5", "ssrms", "kinova"])
def test_no_pose_of_a_configuration_is_called_out_of_reach(name: str) -> None:
    """At random configurations and at stretched ones, whose joints are at multiples of a quarter turn."""
    robot = wbc.robots.load(name)
    beyond = beyond_reach(robot, entry_of(robot), 1e-5)  # type: ignore[arg-type]
    assert beyond is not None
    rng = np.random.default_rng(3)
    turns = [robot.integrate(robot.neutral, rng.integers(-2, 3, robot.nv) * np.pi / 2) for _ in range(60)]
    poses = np.array([numbers(robot, q) for q in [*turns, *(robot.random(seed) for seed in range(60))]])
    assert not beyond(poses).any()
    far = poses.copy()
    far[:, 9:] *= 30.0 / np.linalg.norm(far[:, 9:], axis=1, keepdims=True)
    assert beyond(far).all()


def test_the_bound_of_the_panda_is_the_sum_of_its_three_links() -> None:
    """From the shoulder: 0.316 m up and 0.0825 aside, 0.384 and 0.0825, 0.088; the hand is 0.2104 m beyond."""
    robot = wbc.robots.load("panda")
    beyond = beyond_reach(robot, entry_of(robot), 1e-9)  # type: ignore[arg-type]
    assert beyond is not None
    reach = np.hypot(0.316, 0.0825) + np.hypot(0.384, 0.0825) + 0.088
    for far, expected in ((reach - 1e-6, False), (reach + 1e-6, True)):
        # The hand points down, so that its point of the last axis is 0.2104 m above it
        pose = np.array([1, 0, 0, 0, -1, 0, 0, 0, -1, far, 0, 0.333 - 0.2104], float)
        assert beyond(pose[None])[0] == expected


def test_nothing_is_claimed_where_nothing_is_known() -> None:
    panda, g1 = wbc.robots.load("panda"), wbc.robots.load("talos")
    assert beyond_reach(panda, entry_of(panda, kind="position"), 1e-5) is None  # type: ignore[arg-type]
    assert beyond_reach(panda, entry_of(panda, weights=(1, 1, 1, 1, 1, 0)), 1e-5) is None  # type: ignore[arg-type]
    stack = wbc.Stack(g1, dt=0.01)
    stack.add(EndEffector("gripper_left_joint"), name="hand")
    assert beyond_reach(g1, stack.entries[0], 1e-5) is None


def test_leaving_out_what_is_out_of_reach_changes_no_other_answer() -> None:
    robot = wbc.robots.load("ur5")
    stack = wbc.Stack(robot, dt=0.01)
    stack.add(EndEffector(robot.frames["tip"]), name="hand")
    stack.add(JointLimits())
    kinematics = stack.inverse_kinematics()
    rng = np.random.default_rng(5)
    targets = [robot.pose(rng.uniform(-2, 2, 6), robot.frames["tip"]).homogeneous for _ in range(12)]
    for target in targets[::3]:
        target[:3, 3] *= 3.0
    both = [
        kinematics.solve_batch(robot.neutral, {"hand": targets}, budget=None, restarts=3, nearest=nearest)
        for nearest in (True, False)
    ]
    assert both[0].statuses == both[1].statuses
    sought = both[1].descents > 0.0
    assert sought.sum() < 12
    assert (both[0].q[sought] == both[1].q[sought]).all()
    assert (both[1].q[~sought] == robot.neutral).all()
    nothing = kinematics.solve_batch(robot.neutral, {"hand": targets[:1]}, nearest=False)
    assert not nothing.solved.any()
    kinematics["hand"].mask = [True] * 3 + [False] * 3
    assert kinematics.solve_batch(robot.neutral, {"hand": targets[:1]}, budget=None, nearest=False).descents[0] > 0.0
    with pytest.raises(WbcError, match="nearest"):
        kinematics.solve_batch(robot.neutral, {"hand": targets}, nearest="no")  # type: ignore[arg-type]
    with pytest.raises(ShapeError):
        kinematics.solve_batch(robot.neutral, {"hand": targets, "other": []})
