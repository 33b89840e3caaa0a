"""Postures of limbs, against Pinocchio's forward kinematics, for poses that random postures have."""

from __future__ import annotations

import numpy as np
import pytest

from tests.repeats import covering, repeats
from wbc.climb.climber import Climber
from wbc.climb.machines import climber
from wbc.climb.reach import LimbReach
from wbc.errors import RangeError, ShapeError
from wbc.validation import Array

#: Robots with legs of three joints, arms of five, six and seven, axes and poses fixed
ROBOTS = ("anymal_c", "hexapod", "wall_climber", "walker", "truss_climber", "hexapod_grips", "three_pandas")


def drawn(robot: Climber, reach: LimbReach, limb: int, count: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Random angles within the limits less the margin, and the contact poses that Pinocchio gives for them."""
    low, high = np.maximum(reach.table.lower[limb], -np.pi), np.minimum(reach.table.upper[limb], np.pi)
    angles = rng.uniform(low, high, (count, len(low)))
    return angles, np.array([own_pose(robot, limb, one) for one in angles])


def own_pose(robot: Climber, limb: int, angles: Array) -> Array:
    q = robot.with_limb(robot.rest, limb, angles)
    pose = robot.body_pose(q).actInv(robot.contact_pose(q, limb))
    return np.concatenate([pose.rotation.ravel(), pose.translation])


@pytest.mark.parametrize(("name", "seed"), covering(ROBOTS, range(repeats(1))))
def test_poses_of_random_postures_are_found(name: str, seed: int) -> None:
    robot, rng = climber(name), np.random.default_rng(seed)
    reach, limb = LimbReach(robot), int(rng.integers(len(robot.limbs)))
    angles, poses = drawn(robot, reach, limb, repeats(1000), rng)
    found, solved = reach.postures(limb, poses)
    assert solved.mean() >= 0.999
    low, high = reach.table.lower[limb], reach.table.upper[limb]
    assert (found[solved] >= low).all()
    assert (found[solved] <= high).all()
    for k in range(0, len(poses), 20):
        if solved[k, 0]:
            at = own_pose(robot, limb, found[k, 0])
            assert np.linalg.norm(at[9:] - poses[k, 9:]) < 1e-8
            if robot.fixed(limb) != "position":
                assert np.linalg.norm((at - poses[k])[[2, 5, 8]]) < 1e-8
            if robot.fixed(limb) == "pose":
                assert np.linalg.norm((at - poses[k])[:9]) < 1e-8
    near, followed = reach.postures(limb, poses, angles + rng.normal(0.0, 1e-3, angles.shape))
    assert followed.mean() >= 0.999
    if len(low) == {"position": 3, "axis": 5, "pose": 6}[robot.fixed(limb)]:
        # Near a fold of the limb a posture is far from another one that is nearly the same
        assert np.median(np.abs(near[:, 0] - angles).max(axis=1)) < 1e-6


def test_branches_are_apart_and_all_solve() -> None:
    robot = climber("anymal_c")
    reach = LimbReach(robot)
    poses = drawn(robot, reach, 0, 50, np.random.default_rng(0))[1]
    found, solved = reach.postures(0, poses, count=4)
    assert (solved.sum(axis=1) >= 2).mean() > 0.9
    for pose, some, good in zip(poses, found, solved, strict=True):
        for k in np.flatnonzero(good):
            assert np.linalg.norm(own_pose(robot, 0, some[k])[9:] - pose[9:]) < 1e-8
            assert all(np.abs(some[k] - some[j]).max() > 0.05 for j in range(k))
        assert not some[~good].any()


def test_what_is_out_of_reach_is_not_solved() -> None:
    robot = climber("hexapod")
    reach = LimbReach(robot)
    far = np.concatenate([np.eye(3).ravel(), [3.0, 0.0, 0.0]])[None]
    found, solved = reach.postures(0, far, count=3)
    assert not solved.any()
    assert not found.any()


def test_bad_poses_are_named() -> None:
    reach = LimbReach(climber("hexapod"))
    with pytest.raises(RangeError, match="limb"):
        reach.postures(6, np.zeros((1, 12)))
    with pytest.raises(ShapeError, match="poses"):
        reach.postures(0, np.zeros((1, 5)))
    with pytest.raises(ShapeError, match="seeds"):
        reach.postures(0, np.zeros((1, 12)), np.zeros((1, 2)))
