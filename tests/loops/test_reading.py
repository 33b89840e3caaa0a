"""Loops of SDF files, of files beside a URDF, and of MJCF: each as its own format has it."""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.loops.mechanisms import body, four_bar, hinge, mjcf, numbers
from tests.loops.test_loops import OPEN, opened
from wbc.errors import RangeError, RobotFileError, UnknownNameError
from wbc.robot import LoopError
from wbc.robot.sources.files import example_data_folder
from wbc.validation import Array

CASSIE = example_data_folder() / "cassie_description" / "robots"

LINK = "<link name='{}'><pose>{} 0 {} 0 0 0</pose><inertial><mass>2</mass></inertial></link>"
SDF = f"""<sdf version="1.6"><model name="bars">{LINK.format("ground", 0, 0)}{LINK.format("crank", 0, 0)}
    {LINK.format("coupler", 0, 0.2)}{LINK.format("rocker", 0.5, 0)}
    <joint name="fixing" type="fixed"><parent>world</parent><child>ground</child></joint>
    <joint name="motor" type="revolute"><parent>ground</parent><child>crank</child><axis><xyz>0 1 0</xyz>
      <limit><lower>-2</lower><upper>2</upper><velocity>3</velocity></limit></axis></joint>
    <joint name="knee" type="revolute"><parent>crank</parent><child>coupler</child><axis><xyz>0 1 0</xyz></axis></joint>
    <joint name="heel" type="revolute"><parent>ground</parent><child>rocker</child><axis><xyz>0 1 0</xyz></axis></joint>
    <joint name="pin" type="revolute"><pose>-0.05 0 0.3 0.3 0.2 0.1</pose><parent>coupler</parent><child>rocker</child>
      <axis><xyz>{numbers(pin.rpy.rpyToMatrix(0.3, 0.2, 0.1)[1])}</xyz></axis></joint></model></sdf>"""


def axes(q: Array, robot: wbc.robot.Robot, name: str) -> Array:
    """z axes of both ends of a loop."""
    return np.array([robot.pose(q, f"{name}:{side}").rotation[:, 2] for side in "ab"])


def test_a_four_bar_of_sdf_is_that_of_mjcf(tmp_path: Path) -> None:
    (tmp_path / "bars.sdf").write_text(SDF)
    robot = wbc.robots.load(tmp_path / "bars.sdf")
    assert robot.base == "fixed"
    assert [loop.kind for loop in robot.loops.loops] == ["hinge"]  # type: ignore[union-attr]
    assert len(robot.loops.rows) == 2
    text = four_bar()
    for seed in range(5):
        q = robot.random(seed)
        assert opened(robot, text, [q]) < OPEN
        assert robot.pose(q, "coupler").isApprox(wbc.robots.load(text).pose(q, "coupler"), 1e-9)
    assert robot.limits.velocity[0] == 3.0
    assert robot.model.inertias[1].mass == 2.0


@pytest.mark.parametrize("name", ["cassie_v2", "cassie_wo_gearbox_spring"])
def test_cassie_is_closed_where_its_file_draws_it(name: str) -> None:
    """Of a spanning tree the frames at both ends of each loop come from links that the file places by themselves."""
    robot = wbc.robots.load(CASSIE / f"{name}.sdf", shapes="none")
    zero = pin.neutral(robot.model)
    kinds = {loop.name: loop.kind for loop in robot.loops.loops}  # type: ignore[union-attr]
    assert len(kinds) == 4
    for loop, kind in kinds.items():
        a, b = (robot.pose(zero, f"{loop}:{side}") for side in "ab")
        assert a.isApprox(b, 1e-9)
        for q in (robot.neutral, robot.random(1)):
            a, b = (robot.pose(q, f"{loop}:{side}") for side in "ab")
            assert np.abs(a.translation - b.translation).max() < 1e-6
            if kind == "hinge":
                assert np.abs(np.diff(axes(q, robot, loop), axis=0)).max() < 1e-6


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda s: s.replace('type="revolute"><parent>crank', 'type="universal"><parent>crank'), "'knee'.*universal"),
        (lambda s: s.replace("<child>rocker", "<child>rockr"), "'heel'.*'rockr'"),
        (lambda s: s.replace("<xyz>0 1 0", "<xyz>0 1"), "axis of motor.*3 numbers"),
        (lambda s: s.replace("<joint", "<link name='lost'/><joint", 1), "no joint ties.*lost"),
        (lambda s: s.replace("<mass>2", "<mass>-2"), "-2 kg"),
        (lambda s: s.replace("</model>", "</model><model name='b'/>"), "2 models"),
        (lambda s: s.replace("</model>", "<include/></model>"), "include"),
        (lambda s: s.replace("<pose>-0.05", "<pose relative_to='nothing'>-0.05"), "'nothing'"),
    ],
)
def test_sdf_that_cannot_be_held_is_refused_by_name(tmp_path: Path, change: Callable[[str], str], words: str) -> None:
    (tmp_path / "bars.sdf").write_text(change(SDF))
    with pytest.raises(RobotFileError, match=words):
        wbc.robots.load(tmp_path / "bars.sdf")


def test_a_link_hangs_on_a_joint_of_which_it_is_the_parent(tmp_path: Path) -> None:
    """Swapped ends turn the joint round, and nothing else."""
    knee = "<parent>crank</parent><child>coupler</child>"
    turned = SDF.replace(knee, "<parent>coupler</parent><child>crank</child>").replace(
        'name="knee" type="revolute">', 'name="knee" type="revolute"><pose relative_to="coupler"/>'
    )
    assert turned != SDF
    robots = []
    for name, text in (("one", SDF), ("other", turned)):
        (tmp_path / f"{name}.sdf").write_text(text)
        robots.append(wbc.robots.load(tmp_path / f"{name}.sdf", loops=False))
    q = np.array([0.3, 0.5, -0.2])
    back = q * [1, -1, 1]
    for link in ("coupler", "rocker"):
        assert robots[0].pose(q, link).isApprox(robots[1].pose(back, link), 1e-12)


def test_loops_of_a_file_beside_a_urdf(tmp_path: Path) -> None:
    tree = """<robot name="bars"><link name="ground"/><link name="crank"/><link name="coupler"/><link name="rocker"/>
      <link name="tip"/><joint name="motor" type="continuous"><parent link="ground"/><child link="crank"/>
      <axis xyz="0 1 0"/></joint><joint name="knee" type="continuous"><parent link="crank"/><child link="coupler"/>
      <origin xyz="0 0 0.2"/><axis xyz="0 1 0"/></joint><joint name="end" type="fixed"><parent link="coupler"/>
      <child link="tip"/><origin xyz="0.45 0 0.1"/></joint><joint name="heel" type="continuous">
      <parent link="ground"/><child link="rocker"/><origin xyz="0.5 0 0"/><axis xyz="0 1 0"/></joint>
      <link name="top"/><joint name="up" type="fixed"><parent link="rocker"/><child link="top"/>
      <origin xyz="-0.05 0 0.3"/></joint></robot>"""
    (tmp_path / "bars.urdf").write_text(tree)
    file = tmp_path / "loops.csv"
    file.write_text("first,second,kind,name\n# the coupler's pin\ntip, top, hinge, pin\n")
    robot = wbc.robots.load(tmp_path / "bars.urdf", loops=file)
    assert [loop.name for loop in robot.loops.loops] == ["pin"]
    q = robot.random(2)
    assert np.abs(robot.pose(q, "tip").translation - robot.pose(q, "top").translation).max() < OPEN
    for text, error, words in (
        ("tip, tap, hinge", UnknownNameError, "top"),
        ("tip, top, hing", UnknownNameError, "hinge"),
        ("tip", RobotFileError, "line 1"),
        ("ground, top, weld", LoopError, "open by"),
        ("tip, tip", RangeError, "with itself"),
        ("# none", RobotFileError, "no row"),
    ):
        file.write_text(text)
        with pytest.raises(error, match=words):
            wbc.robots.load(tmp_path / "bars.urdf", loops=str(file))


#: An equality between two chains of a free ball and a slide, and bodies that it may be between
CHAINS = """<mujoco><compiler angle="radian"/><worldbody><site name="base" pos="0.1 0.2 0.3" quat="0.9 0.1 0.3 -0.2"/>
  <body name="a" pos="0.1 0 0.2" quat="0.8 0.2 -0.4 0.1"><joint name="ball" type="ball"/><joint name="out" type="slide"
  axis="1 2 3"/><geom size="0.1"/><site name="sa" pos="0.2 -0.1 0.1" quat="0.7 0.3 0.2 0.1"/></body>
  <body name="b" pos="-0.2 0.3 0.1" euler="0.3 -0.2 0.5"><joint name="turn" ref="0.2"/><joint name="lift" type="slide"
  axis="0 1 1" ref="-0.1"/><geom size="0.1"/><body name="c" pos="0.1 0.1 0.2"><joint name="x" type="slide"/>
  <joint name="y" type="slide" axis="0 1 0"/><joint name="z" type="slide" axis="0 0 1"/><joint name="free" type="ball"/>
  <geom size="0.1"/><site name="sc" pos="0.1 0.2 0"/></body></body></worldbody><equality>{}</equality></mujoco>"""


@pytest.mark.parametrize(
    "equality",
    [
        '<connect body1="a" body2="c" anchor="0.1 0.2 -0.1"/>',
        '<connect body1="c" anchor="0.1 0.2 -0.1"/>',
        '<connect site1="sa" site2="sc"/>',
        '<weld body1="a" body2="c"/>',
        '<weld body1="c"/>',
        '<weld body1="a" body2="c" anchor="0.1 0.3 -0.2"/>',
        '<weld body1="a" body2="c" relpose="0.1 0.2 0.3 0.9 0.1 -0.2 0.3" anchor="0.2 0.1 0" torquescale="0.5"/>',
        '<weld body1="c" relpose="0.1 0.2 0.3 0.9 0.1 -0.2 0.3"/>',
        '<weld site1="sa" site2="sc"/>',
        '<weld site1="base" site2="sc"/>',
        '<joint joint1="turn" joint2="out" polycoef="0.1 0.5 -0.3 0.2 0.7"/>',
        '<joint joint1="lift" joint2="turn" polycoef="0.1 0.5 0 0 0.7"/>',
        '<joint joint1="lift" joint2="turn" polycoef="0 0 1 0 0"/>',
        '<joint joint1="turn" polycoef="0.4 0 0 0 0"/>',
    ],
)
def test_an_equality_of_mjcf_is_what_mujoco_compiles(equality: str) -> None:
    """Where the loop is closed MuJoCo's own residual is 0, and with the same rank."""
    text = CHAINS.format(equality)
    robot, model = wbc.robots.load(text, shapes="none"), mujoco.MjModel.from_xml_string(text)
    configurations = [robot.neutral, *(robot.random(seed) for seed in range(4))]
    assert opened(robot, text, configurations) < OPEN
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert len(robot.loops.rows) == np.linalg.matrix_rank(data.efc_J.reshape(-1, model.nv)[: data.ne])


def test_an_equality_that_is_not_active_closes_nothing(caplog: pytest.LogCaptureFixture) -> None:
    robot = wbc.robots.load(CHAINS.format('<weld body1="a" body2="c" active="false"/>'), shapes="none")
    assert not robot.loops


@pytest.mark.parametrize("motors", ["", '<actuator><motor joint="turn"/></actuator>'])
def test_a_free_body_that_loops_hold_is_part_of_the_robot(motors: str) -> None:
    arm = body("arm", np.zeros(3), hinge("turn", np.array([0.0, 1.0, 0.0])))
    bodies = arm + body("between", np.ones(3), "<freejoint/>") + body("load", np.ones(3), '<freejoint name="load"/>')
    # The load hangs on what hangs on the arm
    ties = '<weld body1="between" body2="load"/><weld body1="arm" body2="between"/>'
    text = mjcf("carried", bodies, ties).replace("</mujoco>", motors + "</mujoco>")
    robot = wbc.robots.load(text, shapes="none")
    assert len(robot.loops.loops) == 2
    assert robot.motors == tuple(range(robot.nv)[robot.dofs("turn")])
    assert not robot.locked_dofs
    assert len(wbc.robots.load(text, shapes="none", loops=False).locked_dofs) == 12
    controller = wbc.Stack(robot, 0.005).add(wbc.tasks.Posture(("turn",)), name="posture").compile()
    target = robot.neutral.copy()
    target[robot.position_index[robot.dofs("turn")]] = 0.3
    controller["posture"].target = target
    step = controller.step(robot.neutral)
    later = robot.integrate(robot.neutral, step.v, 0.005)
    assert step.status == "solved"
    assert max(robot.loop_gaps(later).values()) < OPEN
    assert np.linalg.norm(robot.pose(later, "load").translation - robot.pose(robot.neutral, "load").translation) > 1e-3


def test_a_loop_that_closes_only_beyond_limits_says_whose(caplog: pytest.LogCaptureFixture) -> None:
    text = four_bar().replace('name="heel"', 'name="heel" range="2.5 2.6"')
    with caplog.at_level(logging.WARNING), pytest.raises(LoopError, match=r"limits of .*heel"):
        wbc.robots.load(text)


def test_neutral_is_where_it_is_asked_for_or_else_a_loop_that_is_open_is_said(caplog: pytest.LogCaptureFixture) -> None:
    given = wbc.robots.load(four_bar(), neutral={"motor": 0.3})
    assert given.neutral[0] == pytest.approx(0.3, abs=1e-12)
    assert opened(given, four_bar(), [given.neutral]) < OPEN
    assert "knee by" in given.notes["neutral"]
    assert not caplog.records
    with caplog.at_level(logging.WARNING):
        wbc.robots.load(four_bar(), neutral={"motor": 0.3, "knee": 0.0})
    assert "pin is open by 0.12" in caplog.text
