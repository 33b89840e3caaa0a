"""The two-ended arm in closed form against Pinocchio."""

from __future__ import annotations

from math import pi

import numpy as np
import pinocchio as pin
import pytest

from wbc.errors import NotFiniteError, ShapeError
from wbc.robots import walker
from wbc.walking import TwoEndedKinematics

MACHINE = walker(two_ended=True)
KINEMATICS = TwoEndedKinematics()
#: Where the robot's q has the joints 1 to 7
PLACES = [
    int(MACHINE.robot.model.idx_qs[MACHINE.robot.model.getJointId(f"arm{1 + (k > 3)}_joint{k}")]) for k in range(1, 8)
]


@pytest.fixture(scope="module")
def postures() -> np.ndarray:
    return np.random.default_rng(1).uniform(-pi, pi, (200, 7))


def referee(q: np.ndarray) -> np.ndarray:
    """Far hand in the near hand's frame by Pinocchio."""
    model = MACHINE.robot.model
    data = model.createData()
    whole = pin.neutral(model)
    whole[PLACES] = q
    pin.framesForwardKinematics(model, data, whole)
    near, far = (data.oMf[model.getFrameId(arm.hand)] for arm in MACHINE.arms)
    return np.asarray(near.actInv(far).homogeneous)


def test_forward_kinematics(postures: np.ndarray) -> None:
    found = KINEMATICS.forward(postures)
    np.testing.assert_allclose(found, [referee(q) for q in postures], atol=1e-12)
    np.testing.assert_allclose(KINEMATICS.forward(postures[7]), found[7], atol=1e-13)


def test_eight_branches_reach_the_pose_and_one_is_the_posture(postures: np.ndarray) -> None:
    poses = KINEMATICS.forward(postures)
    q, valid = KINEMATICS.inverse(poses, postures[:, 0])
    assert q.shape == (200, 8, 7)
    assert ((q > -pi) & (q <= pi)).all()
    assert valid.any(axis=1).all()
    reached = KINEMATICS.forward(q)
    wanted = np.repeat(poses[:, None], 8, axis=1)
    np.testing.assert_allclose(reached[valid], wanted[valid], atol=1e-9)
    assert np.abs(reached - wanted)[~valid].max(axis=(1, 2)).min() > 1e-6
    away = np.abs(np.arctan2(np.sin(q - postures[:, None]), np.cos(q - postures[:, None]))).max(axis=-1)
    assert away.min(axis=1).max() < 1e-6
    np.testing.assert_array_equal(q[:, :, 0], np.repeat(q[:, :1, 0], 8, axis=1))


def test_the_first_roll_is_free() -> None:
    pose = KINEMATICS.forward([0.0, 0.0, pi / 4, pi / 2, -pi / 4, 0.0, 0.0])
    rolls = np.linspace(-0.5, 0.5, 11)
    q, valid = KINEMATICS.inverse(np.repeat(pose[None], 11, axis=0), rolls)
    # In between, the far wrist is nearer to the yaw axis than the offsets along the pitch axis reach
    assert valid.any(axis=1).tolist() == [True] * 6 + [False] * 2 + [True] * 3
    np.testing.assert_allclose(KINEMATICS.forward(q)[valid], np.repeat(pose[None], valid.sum(), axis=0), atol=1e-9)


def test_out_of_reach_is_not_valid_and_finite() -> None:
    far, near = np.eye(4), np.eye(4)
    far[:3, 3] = (0.0, 30.0, 0.0)
    near[:3, 3] = (0.1, 0.0, -1.0)
    q, valid = KINEMATICS.inverse([far, near])
    assert not valid[0].any()
    assert not valid[1].any()
    assert np.isfinite(q).all()


def test_joints_are_unwound_within_their_limits() -> None:
    q = np.full(7, 3.0)
    np.testing.assert_allclose(KINEMATICS.unwound(q, np.full(7, -3.0)), 3.0 - 2 * pi)
    np.testing.assert_allclose(KINEMATICS.unwound(np.zeros(7), np.full(7, 4.7)), 0.0)  # 2 pi is beyond 270 degrees


def test_bad_input_is_refused() -> None:
    with pytest.raises(ShapeError, match="q"):
        KINEMATICS.forward(np.zeros(6))
    with pytest.raises(NotFiniteError, match="roll"):
        KINEMATICS.inverse(np.eye(4)[None], np.nan)
    with pytest.raises(ShapeError, match="roll"):
        KINEMATICS.inverse(np.eye(4)[None], [0.0, 1.0])
