"""Compiled MuJoCo models: random machines against MuJoCo itself, scenes, and what must not be silent."""

from __future__ import annotations

import logging
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.refusals import assert_refused
from tests.repeats import repeats
from wbc.errors import RobotFileError, ShapeError, UnknownNameError, UnsupportedJointError
from wbc.extras import MissingPackageError
from wbc.robots import MujocoJoints

KINDS = ("hinge", "hinge", "slide", "ball")


def machine(seed: int) -> str:
    """A random machine: free or fixed, bodies in frames, several joints of a body, ref, geoms that only weigh."""
    rng = np.random.default_rng(seed)

    def numbers(count: int, size: float = 1.0) -> str:
        return " ".join(f"{x:.4f}" for x in rng.uniform(-size, size, count))

    def joints(name: str) -> str:
        out = ""
        for k in range(rng.integers(1, 4)):
            kind = "ball" if k == 0 and rng.random() < 0.2 else str(rng.choice(KINDS[:3]))
            ref = f' ref="{rng.uniform(-0.5, 0.5):.3f}"' if kind != "ball" and rng.random() < 0.4 else ""
            label = f' name="{name}_{k}"' if rng.random() < 0.8 else ""
            limit = ' range="-1 1.5"' if kind != "ball" and rng.random() < 0.5 else ""
            out += (
                f'<joint{label} type="{kind}" axis="{numbers(3)}" pos="{numbers(3, 0.2)}" armature=".02"{ref}{limit}/>'
            )
            if kind == "ball":
                break
        return out

    def body(depth: int, name: str) -> str:
        drawn = ' contype="0" conaffinity="0"' if rng.random() < 0.5 else ""
        geom = f'<geom type="box" size=".1 .2 .05" pos="{numbers(3, 0.1)}" quat="{numbers(4)}"{drawn}/>'
        inner = "".join(body(depth - 1, f"{name}{k}") for k in range(rng.integers(1, 3))) if depth else ""
        text = (
            f'<body name="{name}" pos="{numbers(3, 0.5)}" quat="{numbers(4)}">{joints(name)}{geom}'
            f'<site name="s{name}" pos="{numbers(3, 0.1)}"/>{inner}</body>'
        )
        return f'<frame pos="{numbers(3)}" euler="{numbers(3)}">{text}</frame>' if rng.random() < 0.3 else text

    free = '<freejoint/><geom size=".1"/>' if seed % 2 else '<geom size=".1"/>'
    extra = '<body name="ball" pos="2 0 0"><freejoint/><geom size=".05"/></body><body name="target" mocap="true"/>'
    return (
        f'<mujoco model="machine"><compiler angle="radian"/><worldbody>{extra}<body name="root" pos="{numbers(3)}">'
        f"{free}{body(2, 'a')}</body></worldbody></mujoco>"
    )


@pytest.mark.parametrize("seed", range(repeats(6)))
def test_a_random_machine_moves_and_weighs_as_in_mujoco(seed: int) -> None:
    model = mujoco.MjModel.from_xml_string(machine(seed))
    robot = wbc.robots.load(model, shapes="none")
    assert robot.name == "machine"
    assert (robot.base == "floating") == bool(seed % 2)
    assert "ball" in robot.notes["objects"]
    assert "target" not in robot.frame_names
    joints, data, rng = MujocoJoints(model, robot), mujoco.MjData(model), np.random.default_rng(seed)
    q, v = robot.random(seed), rng.uniform(-1.0, 1.0, robot.nv)
    joints.put_q(data.qpos, q)
    joints.put_v(data.qvel, q, v)
    assert joints.q(data.qpos) == pytest.approx(q)
    assert joints.v(data.qpos, data.qvel) == pytest.approx(v)
    mujoco.mj_forward(model, data)
    for name in (f.name for f in robot.model.frames if f.name.startswith("sa")):
        assert robot.pose(q, name).translation == pytest.approx(data.site(name).xpos, abs=1e-9)
    # The same motion after one small step, and the same energy
    later, dt = robot.integrate(q, v, 1e-4), 1e-4
    mujoco.mj_integratePos(model, data.qpos, data.qvel, dt)
    assert joints.q(data.qpos) == pytest.approx(later, abs=1e-7)
    mass, full = pin.crba(robot.model, robot.model.createData(), q), np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, full)
    rates = np.zeros(model.nv)
    joints.put_v(rates, q, v)
    mass = np.triu(mass) + np.triu(mass, 1).T
    assert v @ mass @ v == pytest.approx(rates @ full @ rates, rel=1e-9)
    assert [float(x) for x in robot.limits.position_upper if np.isfinite(x)] == pytest.approx(
        [float(model.jnt_range[j, 1]) for j in range(model.njnt) if model.jnt_limited[j]]
    )


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


def test_without_mujoco_a_scene_says_what_to_install(cell: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "mujoco", None)
    assert_refused(lambda: wbc.robots.load(cell), MissingPackageError, "pip install 'wbc[mujoco]'")


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
