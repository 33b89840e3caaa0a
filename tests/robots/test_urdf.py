"""URDF files: bases of their own, joints that nothing drives, couplings of joints that turn without end, faults."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wbc
import wbc.robots
from wbc.errors import CommandError, DuplicateNameError, RangeError, RobotFileError
from wbc.simulation import mujoco_spec

BODY = (
    '<link name="{}"><inertial><origin xyz="0 0 0.1"/><mass value="1"/>'
    '<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>'
)
LIMIT = '<limit lower="-2" upper="2" effort="10" velocity="2"/>'


def joint(name: str, kind: str, parent: str, child: str, more: str = LIMIT, axis: str = "0 1 0") -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0.1 0 0.3" rpy="0.2 0 0"/><axis xyz="{axis}"/>{more}</joint>'
    )


def write(folder: Path, *joints: str) -> Path:
    """A file of these joints, with the links a, b, c and d as far as they occur."""
    links = [name for name in "abcd" if any(f'"{name}"' in one for one in joints)]
    path = folder / "made.urdf"
    path.write_text(f'<robot name="made">{"".join(BODY.format(n) for n in links)}{"".join(joints)}</robot>')
    return path


@pytest.mark.parametrize("base", ["floating", "planar"])
def test_a_joint_may_have_the_name_that_bases_have(base: str, tmp_path: Path) -> None:
    joints = [joint(name, "revolute", *ends) for name, ends in (("root_joint", "ab"), ("knee", "bc"))]
    others = [one.replace("root_joint", "hip") for one in joints]
    robot, other = (wbc.robots.load(write(tmp_path, *some), base=base) for some in (joints, others))
    assert robot.joint_names == ("root_joint_", "root_joint", "knee")
    q = other.random(3)
    assert np.array_equal(robot.pose(q, "c").homogeneous, other.pose(q, "c").homogeneous)
    masses = [pin.crba(one.model, one.model.createData(), q) for one in (robot, other)]
    assert np.array_equal(*masses)


def test_names_that_cannot_say_which_joint_is_meant_are_refused(tmp_path: Path) -> None:
    with pytest.raises(DuplicateNameError, match=r"name of the world.*'universe'"):
        wbc.robots.load(write(tmp_path, joint("universe", "revolute", "a", "b")))
    model = pin.Model()
    for parent in (0, 1):
        model.addJoint(parent, pin.JointModelRX(), pin.SE3.Identity(), "hip")
    with pytest.raises(DuplicateNameError, match=r"two joints have this name.*'hip'"):
        wbc.robots.load(model)


def test_an_axis_whose_length_is_no_number_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RobotFileError, match=r"no direction: its axis is 1e\+200"):
        wbc.robots.load(write(tmp_path, joint("hip", "revolute", "a", "b", axis="1e200 1e200 0")))


@pytest.fixture
def free(tmp_path: Path) -> Path:
    return write(tmp_path, joint("free", "floating", "a", "b", ""), joint("hip", "revolute", "b", "c"))


@pytest.fixture
def loose(tmp_path: Path) -> Path:
    return write(
        tmp_path,
        joint("hip", "revolute", "a", "b"),
        joint("slot", "floating", "b", "c", ""),
        joint("toe", "revolute", "c", "d"),
    )


def test_a_floating_root_is_a_base_without_motors(free: Path) -> None:
    robot = wbc.robots.load(free)
    assert (robot.base, robot.nv, robot.joint_names) == ("floating", 7, ("free", "hip"))
    stack = wbc.Stack(robot, dt=0.01)
    stack.add(wbc.tasks.Posture(), name="posture")
    controller = stack.compile(command="torque", backend="vm")
    controller.reset(robot.neutral)
    step = controller.step(robot.neutral, np.zeros(robot.nv))
    np.testing.assert_allclose(step.torque[:6], 0.0, atol=1e-9)
    fall = pin.aba(robot.model, robot.model.createData(), robot.neutral, np.zeros(7), np.array(step.torque))
    assert np.linalg.norm(fall[:3]) == pytest.approx(9.81, abs=1e-6)


def test_a_base_over_a_base_is_the_same_or_refused(free: Path, tmp_path: Path) -> None:
    again = wbc.robots.load(free, base="floating")
    assert again.model == wbc.robots.load(free).model
    assert wbc.robots.load(free, base="fixed").joint_names == ("hip",)
    with pytest.raises(RobotFileError, match="floating base of its own") as caught:
        wbc.robots.load(free, base="planar")
    assert str(free) in str(caught.value)
    two = write(tmp_path, joint("free", "floating", "a", "b", ""), joint("hip", "revolute", "a", "c"))
    assert wbc.robots.load(two).base == "fixed"
    with pytest.raises(RobotFileError, match="'free' at the root of the description moves freely already"):
        wbc.robots.load(two, base="floating")


def test_a_joint_that_nothing_drives_stands_still_and_has_no_torques(loose: Path) -> None:
    robot = wbc.robots.load(loose)
    assert robot.locked_dofs == tuple(range(1, 7))
    stack = wbc.Stack(robot, dt=0.01)
    hand = stack.add(wbc.tasks.EndEffector("d"), name="hand")
    controller = stack.compile(backend="vm")
    controller["hand"].target = robot.pose(robot.neutral, "d") * pin.SE3(np.eye(3), np.array([0.1, 0.2, 0.0]))
    step = controller.step(robot.neutral)
    assert hand is not None
    np.testing.assert_allclose(step.v[1:7], 0.0, atol=1e-9)
    assert np.abs(step.v[[0, 7]]).max() > 1e-3
    with pytest.raises(CommandError, match=r"nothing drives slot\.x"):
        stack.compile(command="torque", backend="vm")
    assert wbc.robots.load(loose, lock="slot").locked_dofs == ()
    assert wbc.robots.load(loose, base="floating").locked_dofs == tuple(range(7, 13))


def test_a_plane_that_stands_upright_has_no_motors_to_hold_a_weight(tmp_path: Path) -> None:
    upright = write(tmp_path, joint("plane", "planar", "a", "b", ""), joint("hip", "revolute", "b", "c"))
    stack = wbc.Stack(wbc.robots.load(upright), dt=0.01)
    stack.add(wbc.tasks.Posture(), name="posture")
    with pytest.raises(CommandError, match=r"nothing holds the planar base of 'made' against 1\d\.\d+ N"):
        stack.compile(command="torque", backend="vm")


ENDLESS = '<limit effort="7" velocity="3"/>'


@pytest.mark.parametrize(
    ("leads", "follows"), [("revolute", "continuous"), ("continuous", "revolute"), ("continuous",) * 2]
)
def test_joints_that_turn_without_end_are_coupled_by_angle(tmp_path: Path, leads: str, follows: str) -> None:
    kinds = {"revolute": LIMIT, "continuous": ENDLESS}
    mimic = '<mimic joint="lead" multiplier="-0.3" offset="0.2"/>'
    rows = joint("lead", leads, "a", "b", kinds[leads]), joint("rod", follows, "b", "c", kinds[follows] + mimic)
    path = write(tmp_path, *rows, joint("last", "continuous", "c", "d", ""))
    robot = wbc.robots.load(path)
    assert (robot.nq, robot.nv) == (4, 3)  # what is not coupled has its point on the circle
    assert robot.limits.effort[0] == {"revolute": 10.0, "continuous": 7.0}[leads]
    plain = pin.buildModelFromXML(path.read_text())
    rng = np.random.default_rng(1)
    for angle in (1.3, *(() if leads == "revolute" else (25.0, -400.0))):
        q = robot.neutral.copy()
        q[0], q[1] = angle, -0.3 * angle + 0.2
        there, at = plain.createData(), pin.neutral(plain)
        for name, value in (("lead", q[0]), ("rod", q[1])):
            j = plain.getJointId(name)
            at[plain.idx_qs[j] : plain.idx_qs[j] + plain.nqs[j]] = (
                [value] if plain.nqs[j] == 1 else [np.cos(value), np.sin(value)]
            )
        pin.framesForwardKinematics(plain, there, at)
        pose = there.oMf[plain.getFrameId("d")].homogeneous
        np.testing.assert_allclose(robot.pose(q, "d").homogeneous, pose, atol=1e-12)
    for one in (robot, pickle.loads(pickle.dumps(robot))):
        q = one.random(rng)
        assert q[1] == pytest.approx(-0.3 * q[0] + 0.2, abs=1e-12)
    stack = wbc.Stack(robot, dt=0.01)
    stack.add(wbc.tasks.EndEffector("c", "position"), name="hand")
    controller = stack.compile(backend="vm")
    controller["hand"].target = robot.pose(q, "c").translation
    at = robot.neutral
    for _ in range(30):
        step = controller.step(at)
        assert step.v[1] == pytest.approx(-0.3 * step.v[0] - 5.0 * (at[1] + 0.3 * at[0] - 0.2), abs=1e-9)
        at = robot.integrate(at, step.v, 0.01)
    spec = mujoco_spec(robot).compile()
    assert spec.neq == 1
    held = wbc.robots.load(path, lock={"rod": -0.4})
    np.testing.assert_allclose(held.pose(held.neutral, "b").homogeneous, robot.pose([2.0, 0, 1, 0], "b").homogeneous)


def test_a_follower_of_a_fixed_joint_is_locked(tmp_path: Path) -> None:
    mimic = '<mimic joint="weld" multiplier="-1" offset="0.3"/>'
    chain = '<mimic joint="rod" multiplier="2" offset="0.1"/>'
    path = write(
        tmp_path,
        joint("weld", "fixed", "a", "b", ""),
        joint("rod", "revolute", "b", "c", LIMIT + mimic),
        joint("tip", "continuous", "c", "d", chain),
    )
    robot = wbc.robots.load(path)
    assert robot.nv == 0
    twice = robot.pose(np.zeros(0), "c").inverse() * robot.pose(np.zeros(0), "d")
    np.testing.assert_allclose(twice.rotation, pin.utils.rotate("x", 0.2) @ pin.utils.rotate("y", 0.7), atol=1e-12)
    with pytest.raises(RangeError, match=r"it follows a fixed joint, which puts it at 0\.3"):
        wbc.robots.load(path, lock={"rod": 0.5})


def test_inertias_that_no_motion_has_are_refused_where_torques_are_asked_for(tmp_path: Path) -> None:
    path = write(tmp_path, joint("turn", "revolute", "a", "b"))
    path.write_text(path.read_text().replace('iyy="0.01"', 'iyy="-0.05"'))
    stack = wbc.Stack(wbc.robots.load(path), dt=0.01)
    stack.add(wbc.tasks.Posture(), name="posture")
    stack.compile(backend="vm")
    with pytest.raises(
        CommandError, match=r"negative eigenvalue, -0.04: the body on joint 'turn' has a moment of -0.05"
    ):
        stack.compile(command="torque", backend="vm")


def test_links_with_an_incomplete_inertial_weigh_nothing(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = write(tmp_path, joint("turn", "revolute", "a", "b"))
    path.write_text(path.read_text().replace('izz="0.01"', 'izz="nan"'))
    wbc.robots.load(path)
    assert "weighs nothing" in caplog.text


SAID = [
    ('<orign xyz="1 0 0"/>', "not read: <orign> of joint 'j' (did you mean origin?)"),
    ('<origin xyz="1 0 0"/>', "<origin> of joint 'j' is there 2 times, the first counts"),
    ('<dynamics dampng="1" friction="0"/>', "not read: dampng in <dynamics> of joint 'j' (did you mean damping?)"),
    (LIMIT.replace("/>", ' jerk="30"/>'), "limits of jerk are not held: j"),
    (LIMIT.replace("/>", ' deceleration="0"/>'), "an acceleration of j is not above 0: unlimited"),
]


@pytest.mark.parametrize(("more", "said"), SAID)
def test_what_is_not_read_of_a_file_is_said(
    more: str, said: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    robot = wbc.robots.load(
        write(tmp_path, joint("j", "revolute", "a", "b", more if "limit" in more else LIMIT + more))
    )
    assert said in caplog.text
    assert any(said in note for note in robot.notes.values())
    assert np.isinf(robot.limits.acceleration).all()


def test_limits_of_acceleration_are_the_lesser_and_soft_limits_a_note(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    both = LIMIT.replace("/>", ' acceleration="7" deceleration="6"/>')
    soft = LIMIT + '<safety_controller k_velocity="1" soft_lower_limit="-1" soft_upper_limit="2"/>'
    chain = (joint("j", "revolute", "a", "b", both), joint("k", "revolute", "b", "c", soft))
    robot = wbc.robots.load(write(tmp_path, *chain, '<loop_joint name="l"/>'))
    np.testing.assert_array_equal(robot.limits.acceleration, [6.0, np.inf])
    assert robot.notes["soft limits"].endswith("with_limits gives them: k -1 to 2")
    assert "soft" not in caplog.text
    assert "not read: <loop_joint>" in caplog.text
