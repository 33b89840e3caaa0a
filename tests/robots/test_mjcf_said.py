"""What an MJCF file says and a robot cannot hold: refused, or named in the log; the others are held without a word."""

from __future__ import annotations

import logging
import pickle
import resource
from collections.abc import Iterator

import mujoco
import pytest

import wbc
from tests.refusals import assert_refused
from wbc.errors import RobotFileError
from wbc.robots import LoopError, MujocoJoints


def link(name: str, x: float, joint: str = "", inner: str = "", body: str = "") -> str:
    """A body with a hinge about y and a sphere beside it."""
    return (
        f'<body name="{name}" pos="{x} 0 1"{body}><joint name="{name}" axis="0 1 0"{joint}/>'
        f'<geom size=".1" pos=".3 0 0"/>{inner}</body>'
    )


def document(bodies: str, rest: str = "") -> str:
    return f"<mujoco model='m'><compiler angle='radian'/><worldbody>{bodies}</worldbody>{rest}</mujoco>"


PAIR = link("a", 0.0) + link("b", 1.0)
FREE = '<body><freejoint/><geom size=".1"/></body>'
SHEET = '<flexcomp name="sheet" type="grid" count="3 3 1" spacing=".1 .1 .1" mass="1" dim="2" radius=".01"/>'
#: Where a stiff spring, a mirror, ... is: text -> what the log must say
SAID = {
    "spring": (document(link("a", 0.0, ' stiffness="3"')), "springs on a (up to"),
    "spring of a tendon": (
        document(PAIR, '<tendon><fixed stiffness="2"><joint joint="b" coef="2"/></fixed></tendon>'),
        "springs on b (up to",
    ),
    "gravity": (document(link("a", 0.0, body=' gravcomp="1"')), "compensated gravity on a (up to"),
    "fluid": (document(PAIR, '<option density="1000"/>'), "fluid on a, b (up to"),
    "damping": (document(link("a", 0.0, ' damping="1 2"')), "damping that is not linear on a"),
    "cone": (
        document('<body><joint name="j" type="ball" range="0 1"/><geom size=".1"/></body>'),
        "cone of a ball joint is no limit here: j",
    ),
    "no limits": (
        document(link("a", 0.0, ' range="0 1"'), '<option><flag limit="disable"/></option>'),
        "limits that the file switches off: a",
    ),
    "cord": (
        document(PAIR, '<tendon><fixed name="cord" range="0 1"><joint joint="b" coef="2"/></fixed></tendon>'),
        "ranges of tendons are no limits here: cord",
    ),
    "pull": (
        document(
            PAIR,
            '<tendon><fixed name="cord"><joint joint="b" coef="2"/></fixed></tendon>'
            '<actuator><motor name="pull" tendon="cord"/></actuator>',
        ),
        "not held is what drives tendons, sites or free joints, or as a muscle: pull",
    ),
    "muscle": (
        document(link("a", 0.0, ' range="-1 1"'), '<actuator><muscle name="biceps" joint="a"/></actuator>'),
        "or as a muscle: biceps",
    ),
    "undriven": (document(PAIR, '<actuator><motor joint="a"/></actuator>'), "joints that no actuator drives: b"),
    "uneven": (
        document(link("a", 0.0), '<actuator><motor joint="a" ctrlrange="-1 4" gear="2"/></actuator>'),
        "by the larger of: a (-2 to 8)",
    ),
    "cup": (document(PAIR + FREE), "driven by nothing: body3"),
    "hand": (document(PAIR + '<body name="hand" mocap="true"/>'), "moved by a program (mocap): hand"),
    "cart": (document(f'<body name="cart" mocap="true">{PAIR}</body>'), "fixed here, and moved by a program"),
    "two robots": (
        document(PAIR + '<body name="c"><freejoint name="f"/><geom size=".1"/>' + link("d", 0.0) + "</body>"),
        "nothing drives f, which is no base: its velocity must stay 0",
    ),
    "door": (
        document(
            link("door", 0.0) + '<body name="c"><freejoint/><geom size=".1"/>' + link("d", 0.0) + "</body>",
            '<actuator><motor joint="d"/></actuator>',
        ),
        "driven by nothing: door",
    ),
    "sheet": (document(PAIR + SHEET), "deformable: sheet_0"),
    "rotor": (
        document('<body><joint type="free" name="f" armature="1"/><geom size=".1"/></body>'),
        "along the world's in MuJoCo, of: f",
    ),
    "length": (
        document(
            PAIR,
            '<tendon><fixed name="t"><joint joint="a" coef="1"/></fixed></tendon>'
            '<equality><tendon name="c" tendon1="t"/></equality>',
        ),
        "tendon 'c' (opens by up to",
    ),
    "compiler": (document(PAIR, '<compiler settotalmass="3"/>'), "MuJoCo on m: compiler attribute 'settotalmass'"),
}


@pytest.mark.parametrize("case", SAID)
def test_what_a_robot_cannot_hold_is_in_the_log(case: str, caplog: pytest.LogCaptureFixture) -> None:
    text, words = SAID[case]
    with caplog.at_level(logging.WARNING, logger="wbc"):
        wbc.robots.load(text, shapes="none")
    assert words in caplog.text


def test_what_it_holds_is_no_word_in_the_log(caplog: pytest.LogCaptureFixture) -> None:
    joint = ' range="-1 2" armature=".1" damping=".3" frictionloss=".2" ref=".4" actuatorfrcrange="-3 3"'
    rest = (
        '<equality><joint joint1="b" joint2="a" polycoef=".1 2"/><weld body1="a" active="false"/></equality>'
        '<actuator><motor joint="a" ctrlrange="-2 2" gear="-4"/></actuator><keyframe><key qpos="1 2"/></keyframe>'
        '<option gravity="0 1 -3"/><option><flag spring="disable"/></option><default><joint stiffness="2"/></default>'
        "<sensor><jointpos joint='a'/></sensor>"
    )
    with caplog.at_level(logging.DEBUG, logger="wbc"):
        robot = wbc.robots.load(document(link("a", 0.0, joint) + link("b", 1.0), rest))
    assert not caplog.text
    model = robot.model
    assert (model.armature[0], model.damping[0], model.upperDryFrictionLimit[0]) == (0.1, 0.3, 0.2)
    assert robot.limits.effort[0] == 3.0
    assert list(model.gravity.linear) == [0.0, 1.0, -3.0]
    assert len(robot.couplings) == 1


@pytest.mark.parametrize(("length", "angle"), [(0.125, 0.3), (0.25, 1.4)])
def test_a_loop_that_ranges_keep_open_is_refused_by_how_far(
    length: float, angle: float, caplog: pytest.LogCaptureFixture
) -> None:
    joints = (
        f'<joint name="s" type="slide" axis="1 0 0" range="{length} {length + 1e-6}"/>'
        f'<joint name="h" axis="0 0 1" range="{angle} {angle + 1e-6}"/>'
    )
    bodies = f'<body name="a">{joints}<geom size=".1"/></body>'
    text = document(bodies, '<equality><weld name="glue" body1="a" torquescale="7"/></equality>')
    assert_refused(lambda: wbc.robots.load(text), LoopError, f"open by {max(length, angle):.3g}")
    assert not wbc.robots.load(text, loops=False).loops
    assert "not kept closed, as load(loops=False) asked: glue" in caplog.text


@pytest.fixture
def little_memory() -> Iterator[None]:
    """At most 6 GB more of addresses than now."""
    before = resource.getrlimit(resource.RLIMIT_AS)
    with open("/proc/self/statm") as file:
        now = int(file.read().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (now + 6 * 2**30, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_AS, before)


@pytest.mark.usefixtures("little_memory")
def test_a_hundred_free_bodies_are_refused_or_left_out() -> None:
    many = "".join(f'<body name="f{k}"><freejoint name="f{k}"/><geom size=".1"/></body>' for k in range(125))
    assert_refused(
        lambda: wbc.robots.load(document(many)),
        RobotFileError,
        "nothing: f0, f1, f2, f3, f4, f5, f6, f7 and 117 more",
    )
    motors = "".join(f'<motor joint="f{k}"/>' for k in range(125))
    pushed = document(many, f"<actuator>{motors}</actuator>")
    assert_refused(lambda: wbc.robots.load(pushed), RobotFileError, "750 degrees of freedom in 125 trees")
    assert wbc.robots.load(document(many + PAIR)).joint_names == ("a", "b")


def test_names_are_found_whatever_shares_them() -> None:
    """One name for a body, its joint and a site; none for others; names that are made up are taken; reserved ones."""
    inner = (
        '<site name="a"/><site name="a_site"/><body pos="0 0 1"><joint axis="1 0 0"/><joint axis="0 1 0"/>'
        '<geom size=".1"/><body name="body2"><joint name="universe"/><geom size=".1" pos=".1 0 0"/><site name="body2"/>'
        '<body name="universe"><joint name="body2_joint0"/><geom size=".1" pos=".1 0 0"/></body></body></body>'
    )
    model = mujoco.MjModel.from_xml_string(document(link("a", 0.0, inner=inner)))
    robot = wbc.robots.load(model)
    assert robot.joint_names == ("a", "body2__joint0", "body2__joint1", "universe_joint", "body2_joint0")
    assert {"a", "a_joint", "a_site", "a_site_", "body2", "body2_", "body2_site", "universe_body"} <= set(
        robot.frame_names
    )
    joints, data, q = MujocoJoints(model, robot), mujoco.MjData(model), robot.random(1)
    joints.put_q(data.qpos, q)
    mujoco.mj_forward(model, data)
    assert joints.q(data.qpos) == pytest.approx(q)
    for frame, place in (("body2_", data.xpos[2]), ("body2", data.xpos[3]), ("universe_body", data.xpos[4])):
        assert robot.pose(q, frame).translation == pytest.approx(place, abs=1e-12)
    assert robot.pose(q, "a_site_").translation == pytest.approx(data.site("a").xpos, abs=1e-12)


def test_a_robot_of_a_text_is_pickled_locked_and_put_on_a_base() -> None:
    text = document(link("a", 0.5, inner=link("b", 0.5)), '<option gravity="0 0 -1.62"/>')
    text = text.replace('body name="', 'body name="link_')
    robot = wbc.robots.load(text)
    again = pickle.loads(pickle.dumps(robot))
    assert (again.fingerprint, again.name, again.source) == (robot.fingerprint, "m", "")
    assert wbc.robots.load(text, lock={"b": 0.3}).joint_names == ("a",)
    based = wbc.robots.load(text, base="floating")
    assert (based.nv, based.base) == (8, "floating")
    assert set(based.shapes) == {"link_a", "link_b"}
