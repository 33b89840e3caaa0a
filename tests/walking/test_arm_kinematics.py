"""The arm in closed form against Pinocchio, whose model is built from the same rows by other code."""

from __future__ import annotations

import time
from math import pi, radians

import numpy as np
import pinocchio as pin
import pytest

from wbc.errors import NotFiniteError, ShapeError
from wbc.robots import walker
from wbc.walking import ArmKinematics
from wbc.walking.arms.puma import LIMIT_NAMES

MACHINE = walker()
ARM = MACHINE.arms[1]
KINEMATICS = ArmKinematics()
LIMITS = np.array(KINEMATICS.data.position_limits)
EVERY = {"elbows": (-1, 1), "shoulders": (1, -1), "limits": False}


def referee(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(hand pose in the arm's base, its Jacobian along the base's axes) by Pinocchio."""
    model = MACHINE.robot.model
    data = model.createData()
    whole = pin.neutral(model)
    whole[ARM.q] = q
    pin.computeJointJacobians(model, data, whole)
    pin.updateFramePlacements(model, data)
    base, hand = (data.oMf[model.getFrameId(frame)] for frame in (ARM.base_frame, ARM.hand))
    jacobian = pin.getFrameJacobian(model, data, model.getFrameId(ARM.hand), pin.LOCAL_WORLD_ALIGNED)[:, ARM.v]
    turn = np.kron(np.eye(2), base.rotation.T)
    return base.actInv(hand).homogeneous, turn @ jacobian


def turns(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Differences of angles within half a turn."""
    return np.arctan2(np.sin(a - b), np.cos(a - b))


@pytest.fixture(scope="module")
def postures() -> np.ndarray:
    return np.random.default_rng(1).uniform(-LIMITS, LIMITS, (200, 6))


@pytest.fixture(scope="module")
def poses(postures: np.ndarray) -> np.ndarray:
    return np.array([referee(q)[0] for q in postures])


def test_forward_kinematics(postures: np.ndarray, poses: np.ndarray) -> None:
    found = KINEMATICS.forward(postures)
    np.testing.assert_allclose(found, poses, atol=1e-12)
    np.testing.assert_array_equal(KINEMATICS.forward(postures.reshape(10, 20, 6)), found.reshape(10, 20, 4, 4))
    wrist = poses[:, :3, 3] - KINEMATICS.data.hand_length * poses[:, :3, 2]
    np.testing.assert_allclose(KINEMATICS.wrist(postures), wrist, atol=1e-12)
    np.testing.assert_allclose(KINEMATICS.wrist_of(poses[:, :3, 3], poses[:, :3, 2]), wrist, atol=1e-15)


def test_all_eight_branches_reach_the_pose_and_one_is_the_posture(postures: np.ndarray, poses: np.ndarray) -> None:
    q, valid = KINEMATICS.inverse(poses, **EVERY)
    assert q.shape == (200, 8, 6)
    assert valid.all()
    for k in range(0, 200, 10):
        for branch in q[k]:
            np.testing.assert_allclose(referee(branch)[0], poses[k], atol=1e-12)
    np.testing.assert_allclose(KINEMATICS.forward(q), np.repeat(poses[:, None], 8, axis=1), atol=1e-12)
    away = np.abs(turns(q, postures[:, None])).max(axis=-1).min(axis=1)
    assert away.max() < 1e-9
    assert ((q[..., [0, 3, 5]] > -pi) & (q[..., [0, 3, 5]] <= pi)).all()


def test_the_walking_branches_bend_the_elbow_and_flip_the_wrist(poses: np.ndarray) -> None:
    q, valid = KINEMATICS.inverse(poses, limits=False)
    assert q.shape == (200, 2, 6)
    assert valid.all()
    assert (q[..., 2] <= 0).all()
    assert (q[:, 0, 4] >= 0).all()
    assert (q[:, 1, 4] <= 0).all()
    # r > 0: the arm reaches forwards
    data = KINEMATICS.data
    reach = np.sin(q[..., 1]) * data.upper_arm_length + np.sin(q[..., 1] + q[..., 2]) * data.forearm_length
    assert (reach >= 0).all()


def test_limits_decide_what_is_valid(poses: np.ndarray) -> None:
    q, valid = KINEMATICS.inverse(poses)
    kept = (np.abs(q) <= LIMITS + 1e-12).all(axis=-1)
    kept &= (q[..., 2] <= radians(-1)) & (q[..., 1] >= -q[..., 2] / 2 + radians(1))
    np.testing.assert_array_equal(valid, kept)
    assert 20 < valid.sum() < 400
    margins = KINEMATICS.margins(q)
    assert margins.shape == (200, 2, 8)
    np.testing.assert_array_equal((margins >= -1e-12).all(axis=-1), valid)
    names = [LIMIT_NAMES[k] for k in KINEMATICS.limiting([[0, 1.5, -1.5, 0, 1.82, 0], [0, 0.4, -0.7, 0, 0, 0]])]
    assert names == ["joint 5 limit", "shoulder limit"]


def test_out_of_reach_is_not_valid_and_finite() -> None:
    far = np.eye(4)
    far[:3, 3] = (0.0, 2.0, 1.0)
    on_axis = np.eye(4)
    on_axis[:3, 3] = (0.05, 0.0, 1.2)
    q, valid = KINEMATICS.inverse([far, on_axis], **EVERY)
    assert not valid.any()
    assert np.isfinite(q).all()


def test_axis_only(postures: np.ndarray, poses: np.ndarray) -> None:
    q, valid = KINEMATICS.inverse_axis(poses[:, :3, 3], poses[:, :3, 2], **EVERY)
    assert valid.all()
    assert (q[..., 5] == 0).all()
    found = KINEMATICS.forward(q)
    np.testing.assert_allclose(found[..., 2:4], np.repeat(poses[:, None], 8, axis=1)[..., 2:4], atol=1e-12)
    full, _ = KINEMATICS.inverse(poses, **EVERY)
    np.testing.assert_allclose(turns(q[..., :5], full[..., :5]), 0.0, atol=1e-12)


@pytest.mark.parametrize("theta5", [0.0, 1e-11, -1e-11])
def test_an_aligned_wrist_keeps_the_chosen_joint_4(theta5: float) -> None:
    q = np.array([0.2, 1.4, -1.3, 0.6, theta5, 0.5])
    pose = KINEMATICS.forward(q)
    for chosen in (0.0, 0.4, np.array([-0.7])):
        found, valid = KINEMATICS.inverse(pose[None], theta4=chosen)
        assert valid.all()
        np.testing.assert_array_equal(found[0, :, 3], np.full(2, chosen))
        np.testing.assert_allclose(found[0, :, 3] + found[0, :, 5], 1.1, atol=1e-12)
        np.testing.assert_allclose(KINEMATICS.forward(found[0]), np.repeat(pose[None], 2, axis=0), atol=1e-10)


@pytest.mark.parametrize("forearm", [17.0, 15.0])
def test_reach_of_the_wrist_is_what_the_first_three_joints_allow(forearm: float) -> None:
    """Point by point, by inverse kinematics, with joints 1 and 2 left unlimited."""
    arm = ArmKinematics(KINEMATICS.data.read(forearm_length=forearm * 0.0254))
    rng = np.random.default_rng(4)
    points = rng.uniform(-1.1, 1.1, (20000, 3)) * [0.3, 0.3, 1.0] + [0.0, 0.0, arm.data.neck_length]
    near = points[:5000, :2]  # where the shoulder limit is
    near *= rng.uniform(0.150, 0.156, (5000, 1)) / np.linalg.norm(near, axis=1, keepdims=True)
    margin = arm.wrist_reach(points)
    axes = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    q, valid = arm.inverse_axis(points + arm.data.hand_length * axes, axes, limits=False)
    q[..., 1] %= 2 * pi  # an unlimited joint 2 goes on past half a turn
    free = arm.margins(q)[:, 0]
    allowed = valid[:, 0] & (free[:, [2, 6, 7]] >= 0).all(axis=-1)
    np.testing.assert_array_equal(margin >= 0, allowed)
    assert 2000 < allowed.sum() < 18000
    assert (valid[:, 0] & (free[:, 7] < 0)).sum() > 20


def test_nearest_branch_turns_joint_6_and_counts_time() -> None:
    q = np.array([0.1, 1.5, -1.4, 0.3, 0.5, 3.0])
    found, valid = KINEMATICS.inverse(KINEMATICS.forward(q)[None])
    reference = q + [0.0, 0.0, 0.0, 0.0, 0.0, 0.6]
    chosen, branch, seconds = KINEMATICS.nearest(found, valid, reference)
    np.testing.assert_allclose(chosen[0], q, atol=1e-12)
    assert branch[0] == 0
    assert seconds[0] == pytest.approx(0.6 / KINEMATICS.data.joint_rates[5])
    beyond = found.copy()
    beyond[..., 5] -= 2 * pi
    np.testing.assert_allclose(KINEMATICS.nearest(beyond, valid, reference)[0][0], q, atol=1e-12)
    # 4.8 rad would be nearer, and is beyond the limit of 270 degrees
    assert KINEMATICS.unwound(4.8, 4.7) == pytest.approx(4.8 - 2 * pi)
    nothing, none, infinite = KINEMATICS.nearest(found, np.zeros_like(valid), reference)
    np.testing.assert_array_equal(nothing[0], reference)
    assert none[0] == -1
    assert np.isinf(infinite[0])


def test_rates_are_the_inverse_of_the_jacobian(postures: np.ndarray) -> None:
    twists = np.random.default_rng(5).normal(size=(200, 6))
    rates, exact = KINEMATICS.rates(postures, twists)
    np.testing.assert_array_equal(exact, np.abs(np.sin(postures[:, 4])) >= 1e-2)
    for q, twist, rate in zip(postures[exact], twists[exact], rates[exact], strict=True):
        np.testing.assert_allclose(referee(q)[1] @ rate, twist, atol=1e-9)


def test_rates_at_an_aligned_wrist_give_what_can_be_given() -> None:
    q, twist = np.array([0.3, 1.3, -1.2, 0.4, 0.0, 0.2]), np.array([0.1, -0.2, 0.05, 0.3, 0.1, -0.2])
    rates, exact = KINEMATICS.rates(q, twist)
    assert not exact
    got = referee(q)[1] @ rates
    lost = got - twist
    # Only one direction of rotation is lost: across the common axis of joints 4 and 6 and the axis of joint 5
    hand = referee(q)[0]
    fifth = KINEMATICS.forward(np.r_[q[:4], pi / 2, 0.0])[:3, 1]
    assert np.abs(lost).max() > 0.01
    np.testing.assert_allclose([lost[3:] @ hand[:3, 2], lost[3:] @ fifth], 0.0, atol=1e-12)
    assert rates[3] == 0.0
    straight, exact = KINEMATICS.rates([0.3, 1.3, 0.0, 0.4, 0.5, 0.2], twist)
    assert np.isfinite(straight).all()
    assert not exact


def test_other_lengths_are_followed() -> None:
    data = KINEMATICS.data.read(forearm_length=0.3, shoulder_offset=0.1, hand_length=0.2)
    other = ArmKinematics(data)
    q = np.random.default_rng(6).uniform(-1.5, 1.5, (100, 6))
    found, valid = other.inverse(other.forward(q), **EVERY)
    assert valid.all()
    np.testing.assert_allclose(other.forward(found), np.repeat(other.forward(q)[:, None], 8, axis=1), atol=1e-12)
    machine = walker(data=data)
    model = machine.robot.model
    model_data = model.createData()
    pin.framesForwardKinematics(model, model_data, np.r_[0, 0, 0, 0, 0, 0, 1, q[:3].ravel()])
    arm = machine.arms[2]
    base, hand = (model_data.oMf[model.getFrameId(frame)] for frame in (arm.base_frame, arm.hand))
    np.testing.assert_allclose(base.actInv(hand).homogeneous, other.forward(q[2]), atol=1e-12)


def test_a_hundred_thousand_poses_take_little_time() -> None:
    q = np.random.default_rng(7).uniform(-LIMITS, LIMITS, (100_000, 6))
    poses = KINEMATICS.forward(q)
    start = time.process_time()
    KINEMATICS.inverse(poses)
    assert time.process_time() - start < 1.0


def test_bad_input_is_refused() -> None:
    with pytest.raises(ShapeError, match="q"):
        KINEMATICS.forward([1.0, 2.0])
    with pytest.raises(NotFiniteError, match="poses"):
        KINEMATICS.inverse(np.full((1, 4, 4), np.nan))
    with pytest.raises(ShapeError, match="poses"):
        KINEMATICS.inverse(np.eye(3))
    with pytest.raises(ShapeError, match="axes"):
        KINEMATICS.inverse_axis([[0.0, 0.0, 1.0]], [[0.0, 0.0, 2.0]])
    with pytest.raises(ShapeError, match="elbows"):
        KINEMATICS.inverse(np.eye(4)[None], elbows=(0,))
    with pytest.raises(ShapeError, match="theta4"):
        KINEMATICS.inverse(np.eye(4)[None], theta4=[0.0, 1.0])
    with pytest.raises(ShapeError, match="valid"):
        KINEMATICS.nearest(np.zeros((1, 2, 6)), [True], np.zeros(6))


def test_points_of_the_arm(postures: np.ndarray) -> None:
    found = KINEMATICS.points(postures)
    assert found.shape == (200, 6, 3)
    model = MACHINE.robot.model
    data = model.createData()
    for q, points in zip(postures[:10], found, strict=False):
        whole = pin.neutral(model)
        whole[ARM.q] = q
        pin.framesForwardKinematics(model, data, whole)
        base = data.oMf[model.getFrameId(ARM.base_frame)]
        for link, first, radius in zip(ARM.links, (0, 2, 3, 4), KINEMATICS.radii, strict=True):
            (placed,) = MACHINE.robot.shapes[link]
            frame = base.actInv(data.oMf[model.getFrameId(link)])
            ends = [frame.act(end) for end in placed.ends()]
            np.testing.assert_allclose(points[first : first + 2], ends, atol=1e-12)
            assert placed.shape.radius == radius  # type: ignore[union-attr]
    wrists = np.linalg.norm(found[:, 4] - found[:, 1], axis=1)
    straight = KINEMATICS.points([0.0, 1.0, KINEMATICS.data.elbow_limit, 0.0, 0.0, 0.0])
    assert np.linalg.norm(straight[4] - straight[1]) == pytest.approx(KINEMATICS.wrist_span, abs=1e-12)
    assert (wrists[postures[:, 2] < KINEMATICS.data.elbow_limit] < KINEMATICS.wrist_span).all()
