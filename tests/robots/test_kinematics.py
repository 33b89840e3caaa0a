"""What a robot says of a configuration, against Pinocchio's own calls, and values as users write them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.random_robots import random_inertia, random_pose
from tests.refusals import assert_refused
from wbc.errors import NotFiniteError, RangeError, RotationError, ShapeError, UnknownNameError

ROBOTS = ("panda", "tiago", "talos")


@pytest.mark.parametrize("name", ROBOTS)
def test_poses_jacobians_and_steps_are_those_of_pinocchio(name: str) -> None:
    robot = wbc.robots.load(name)
    rng, frames, data = np.random.default_rng(0), robot.frame_names, robot.model.createData()
    for seed in range(4):
        q, v = robot.random(seed), rng.normal(size=robot.nv)
        frame, base = (str(rng.choice(frames)) for _ in range(2))
        pin.framesForwardKinematics(robot.model, data, q)
        of, at = (data.oMf[robot.model.getFrameId(one)] for one in (frame, base))
        np.testing.assert_allclose(robot.pose(q, frame).homogeneous, of.homogeneous, atol=1e-14)
        np.testing.assert_allclose(robot.pose(q, frame, base).homogeneous, at.actInv(of).homogeneous, atol=1e-13)
        ahead = robot.integrate(q, v, 1e-6)
        moved = robot.pose(ahead, frame)
        twist = [moved.translation - of.translation, pin.log3(moved.rotation @ of.rotation.T)]
        np.testing.assert_allclose(robot.jacobian(q, frame) @ v, np.concatenate(twist) / 1e-6, atol=2e-4)
        np.testing.assert_allclose(robot.difference(q, ahead) / 1e-6, v, atol=1e-8)
        np.testing.assert_array_equal(ahead, robot.configuration("q", ahead))
    np.testing.assert_array_equal(robot.pose(q, "world").homogeneous, np.eye(4))


@pytest.mark.parametrize("kind", [pin.JointModelRZ, pin.JointModelPZ])
def test_a_robot_of_one_joint_has_jacobians_of_one_column_and_torques(kind: type[pin.JointModel]) -> None:
    """Pinocchio gives a Jacobian of one column without its second dimension, CasADi a row where no number is chosen."""
    model, rng = pin.Model(), np.random.default_rng(0)
    model.appendBodyToJoint(model.addJoint(0, kind(), random_pose(rng), "j"), random_inertia(rng), random_pose(rng))
    model.addFrame(pin.Frame("tip", 1, random_pose(rng), pin.FrameType.OP_FRAME))
    robot, q, v = wbc.robots.load(model), np.array([0.3]), np.array([0.4])
    ahead, behind = (robot.pose(robot.integrate(q, [side], 1e-6), "tip") for side in (1.0, -1.0))
    turn = pin.log3(ahead.rotation @ behind.rotation.T)
    twist = np.concatenate((ahead.translation - behind.translation, turn)) / 2e-6
    np.testing.assert_allclose(robot.jacobian(q, "tip"), twist[:, None], atol=1e-8)
    stack = wbc.Stack(robot, dt=0.01).add(wbc.tasks.EndEffector("tip", kind="position"), name="tip")
    stack.add(wbc.tasks.TorqueLimits())  # of no joint: the model has no limits of effort
    controller = stack.add(wbc.tasks.Posture(), name="posture").compile(command="torque", backend="vm")
    controller.reset(robot.neutral)
    step = controller.step(q, v)
    assert step.torque == pytest.approx(pin.rnea(model, model.createData(), q, v, step.a), rel=1e-12)


@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_the_world_stands_still_also_where_a_link_has_its_name(base: str, tmp_path: Path) -> None:
    robot = wbc.robots.load("ur5", base=base)
    assert not robot.jacobian(robot.random(1), "world").any()
    file = tmp_path / "named.urdf"
    file.write_text(
        '<robot name="named"><link name="world"/><link name="arm"/><joint name="j" type="continuous">'
        '<parent link="world"/><child link="arm"/></joint></robot>'
    )
    robot = wbc.robots.load(file, base=base)
    q = robot.integrate(robot.neutral, np.full(robot.nv, 0.5), 1.0)
    np.testing.assert_array_equal(robot.jacobian(q, "world"), np.zeros((6, robot.nv)))
    np.testing.assert_array_equal(robot.pose(q, "world").homogeneous, np.eye(4))
    assert ("nothing names the link" in robot.notes.get("world", "")) == (base == "floating")


@pytest.mark.parametrize("name", ["panda", "ur5", "talos"])
def test_joints_of_one_number_move_by_a_sum(name: str) -> None:
    """To the bits of Pinocchio, whatever the sizes are; what is no number is refused all the same."""
    robot, rng = wbc.robots.load(name), np.random.default_rng(0)
    q, v = robot.neutral, np.zeros(robot.nv)
    for seed in range(40):
        q, v = robot.random(seed), rng.normal(size=robot.nv) * 10.0 ** rng.integers(-9, 9)
        dt = float(rng.normal() * 10.0 ** rng.integers(-6, 3))
        wanted = pin.normalize(robot.model, pin.integrate(robot.model, q, v * dt))
        assert robot.integrate(q, v, dt).tobytes() == np.asarray(wanted).tobytes()
    for given in ((q * np.nan, v, 1.0), (q, v * np.inf, 0.0), (q, v, np.nan), (q, v[:-1], 1.0), (q + 1j, v, 1.0)):
        with pytest.raises(wbc.WbcError):
            robot.integrate(*given)


@pytest.mark.parametrize("name", ROBOTS)
def test_random_configurations_are_within_the_limits_and_repeat(name: str) -> None:
    robot = wbc.robots.load(name)
    at = robot.position_index
    some = np.array([robot.random(seed) for seed in range(50)])
    for k in np.flatnonzero(at >= 0):
        low, high = robot.limits.position_lower[k], robot.limits.position_upper[k]
        if np.isfinite([low, high]).all():
            assert ((some[:, at[k]] >= low) & (some[:, at[k]] <= high)).all()
            assert np.ptp(some[:, at[k]]) > 0.5 * (high - low) or low == high
    np.testing.assert_array_equal(robot.random(7), some[7])
    drawn = np.random.default_rng(7)
    np.testing.assert_array_equal(robot.random(drawn), some[7])
    assert not np.array_equal(robot.random(drawn), some[7])
    for q in some:
        robot.configuration("q", q)


def test_random_configurations_keep_joints_that_follow_where_they_belong() -> None:
    robot = wbc.robots.load("talos_full")
    at, limits = robot.position_index, robot.limits
    for seed in range(20):
        q = robot.random(seed)
        for one in robot.couplings:
            place = q[at[one.follower]]
            assert place == pytest.approx(one.ratio * q[at[one.leader]] + one.offset, abs=1e-12)
            assert limits.position_lower[one.follower] - 1e-9 <= place <= limits.position_upper[one.follower] + 1e-9


def test_bad_values_are_refused() -> None:
    robot = wbc.robots.load("talos")
    assert_refused(lambda: robot.pose(robot.neutral, "hand"), UnknownNameError, "frame")
    assert_refused(lambda: robot.pose(robot.neutral, "world", "hand"), UnknownNameError, "relative_to")
    assert_refused(lambda: robot.jacobian(robot.neutral, "hand"), UnknownNameError, "")
    assert_refused(lambda: robot.integrate(robot.neutral, [1.0]), ShapeError, "")
    assert_refused(lambda: robot.integrate(robot.neutral, np.zeros(robot.nv), np.nan), NotFiniteError, "")
    assert_refused(lambda: robot.difference(robot.neutral, np.zeros(robot.nq)), RotationError, "")
    assert_refused(lambda: robot.random(-1), RangeError, "")


def test_objects_say_in_a_line_what_they_are() -> None:
    robot = wbc.robots.load("panda")
    stack = wbc.Stack(robot, dt=0.01).add(wbc.tasks.Damping(), name="rest")
    assert repr(robot) == "<Robot 'panda': 7 joints, nq 7, nv 7, fixed base>"
    assert repr(stack) == "<Stack of 'panda', dt 0.01 s: rest (Damping)>"


def test_some_joints_of_a_posture_are_written_alone() -> None:
    robot = wbc.robots.load("panda")
    stack = wbc.Stack(robot, dt=0.01)
    stack.add(wbc.tasks.EndEffector("panda_hand_tcp"), name="hand")
    stack.add(wbc.tasks.Posture(joints=("panda_joint6", "panda_joint2")), name="posture")
    controller = stack.compile(backend="vm")
    controller.reset(robot.neutral)
    posture = controller["posture"]
    posture.target = [2.0, -0.5]
    assert posture.target[[5, 1]].tolist() == [2.0, -0.5]
    with pytest.raises(ShapeError, match="expected 2 numbers for panda_joint6, panda_joint2, or 7 for all joints"):
        posture.target = [2.0]
    assert repr(controller).startswith("<Controller, daqp (vm), of <Stack of 'panda', dt 0.01 s: hand (EndEffector),")
    posture.feedforward = [0.3, 0.0]
    assert posture.feedforward.tolist() == [0.0, 0.0, 0.0, 0.0, 0.0, 0.3, 0.0]
    whole = robot.random(1)
    posture.target = whole
    np.testing.assert_array_equal(posture.target, whole)
    for bad in ([1.0], [1.0, 2.0, 3.0], [1.0, np.nan]):
        with pytest.raises((ShapeError, NotFiniteError)):
            posture.target = bad
    np.testing.assert_array_equal(posture.target, whole)
