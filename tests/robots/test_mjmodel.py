"""Compiled MuJoCo models: scenes, and what must not be silent; random ones are in test_random_mjcf.py."""

from __future__ import annotations

import logging
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.refusals import assert_refused
from wbc.errors import RobotFileError, ShapeError, UnknownNameError, UnsupportedJointError
from wbc.robots import MujocoJoints

SCENE = """<mujoco model="cell"><include file="arm.xml"/><worldbody><geom name="floor" type="plane" size="1 1 .1"/>
<body name="wall" pos=".5 0 .1"><geom name="wall" type="box" size=".1 .1 .1"/></body>
<body name="cup" pos="1 0 1"><freejoint/><geom type="cylinder" size=".03 .05"/></body>
<body name="target" pos=".5 0 .5" mocap="true"><geom type="box" size=".05 .05 .05" contype="0" conaffinity="0"/></body>
</worldbody><keyframe><key name="home" qpos=".3 -.2 1 0 1 1 0 0 0"/></keyframe></mujoco>"""
ARM = """<mujoco><default><default class="link"><geom type="capsule" size=".04" fromto="0 0 0 0 0 .3"/>
<joint axis="0 1 0" range="-90 90"/></default></default><worldbody><body name="upper" childclass="link">
<joint name="shoulder"/><geom/><frame pos="0 0 .3"><body name="lower"><joint name="elbow"/><geom/>
<site name="tip" pos="0 0 .3"/></body></frame></body></worldbody><actuator>
<position name="shoulder" joint="shoulder" kp="100" forcerange="-40 40"/>
<motor joint="elbow" gear="2" ctrlrange="-3 3"/>
</actuator></mujoco>"""


@pytest.fixture
def cell(tmp_path: Path) -> Path:
    """A scene as mink's examples have: an arm in a file of its own, a wall, a loose cup, a mocap target, a keyframe."""
    (tmp_path / "arm.xml").write_text(ARM)
    (tmp_path / "scene.xml").write_text(SCENE)
    return tmp_path / "scene.xml"


def test_a_scene_is_its_robot(cell: Path) -> None:
    for robot in (wbc.robots.load(cell), wbc.robots.load(mujoco.MjModel.from_xml_path(str(cell)))):
        assert (robot.joint_names, robot.base) == (("shoulder", "elbow"), "fixed")
        assert robot.neutral == pytest.approx([0.3, -0.2])
        assert robot.limits.effort == pytest.approx([40.0, 6.0])
        assert {"wall", "tip", "lower"} <= set(robot.frame_names)
        assert not {"target", "cup"} & set(robot.frame_names)
        assert set(robot.shapes) == {"wall", "upper", "lower"}
        assert "cup" in robot.notes["objects"]
    stack = wbc.Stack(robot, dt=0.01)
    stack.add(wbc.tasks.EndEffector("tip", kind="position"), name="tip").add(wbc.tasks.JointLimits(velocity=False))
    stack.add(wbc.tasks.Obstacle(wbc.shapes.Box((0.2, 0.2, 0.2)), links=("lower",)), name="wall")
    controller = stack.compile(backend="vm")
    controller["wall"].pose = pin.SE3(np.eye(3), np.array([0.5, 0.0, 0.1]))
    assert controller.step(robot.neutral).status == "solved"


def test_other_robots_and_other_weights_are_not_silent(cell: Path, caplog: pytest.LogCaptureFixture) -> None:
    model = mujoco.MjModel.from_xml_path(str(cell))
    robot = wbc.robots.load(model)
    locked = wbc.robots.load(model, lock={"elbow": 0.5})
    assert MujocoJoints(model, locked).q(model.key_qpos[0]) == pytest.approx([0.3])
    bent, heavy = ARM.replace('pos="0 0 .3"><body', 'pos="0 0 .31"><body'), ARM.replace('size=".04"', 'size=".05"')
    other = mujoco.MjModel.from_xml_string(bent)
    assert_refused(lambda: MujocoJoints(other, robot), ShapeError, "another robot")
    assert_refused(lambda: MujocoJoints(other, wbc.robots.load("ur5")), UnknownNameError, "joint")
    slide = mujoco.MjModel.from_xml_string(ARM.replace('name="elbow"/>', 'name="elbow" type="ball" range="0 90"/>'))
    assert_refused(lambda: MujocoJoints(slide, robot), UnsupportedJointError, "elbow")
    with caplog.at_level(logging.WARNING, logger="wbc"):
        MujocoJoints(mujoco.MjModel.from_xml_string(heavy), robot)
    assert "weighs" in caplog.text
    joints = MujocoJoints(model, robot)
    assert_refused(lambda: joints.q(np.zeros(2)), ShapeError, "qpos")
    assert_refused(lambda: wbc.robots.load(mujoco.MjModel.from_xml_string("<mujoco/>")), RobotFileError, "no joint")


def test_a_forgotten_quaternion_order_is_said(caplog: pytest.LogCaptureFixture) -> None:
    xml = '<mujoco><worldbody><body name="b" pos="0 0 1"><freejoint/><geom size=".1"/></body></worldbody></mujoco>'
    model = mujoco.MjModel.from_xml_string(xml)
    robot = wbc.robots.load(model)
    assert robot.neutral == pytest.approx([0, 0, 1, 0, 0, 0, 1])
    with caplog.at_level(logging.WARNING, logger="wbc"):
        robot.pose(robot.neutral, "b")
        assert not caplog.text
        robot.pose(model.qpos0, "b")
    assert "x, y, z, w" in caplog.text
