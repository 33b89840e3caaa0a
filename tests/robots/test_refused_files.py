"""What is no robot description is refused with a typed error that says why, and with nothing on stderr."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wbc.robots
from tests.refusals import assert_refused
from wbc.errors import BoundsError, RobotFileError, ShapeError, UnknownNameError, UnsupportedJointError
from wbc.robots.operator_arms import OPERATOR_ARMS

LINKS = '<link name="a"/><link name="b"/>'
JOINT = '<joint name="j" type="revolute"><parent link="a"/><child link="{child}"/>{limit}</joint>'
LIMIT = '<limit effort="1" velocity="1"/>'
BAD_URDFS = {
    "no_name": (f"<robot>{LINKS}</robot>", "no name"),
    "no_links": ('<robot name="r"/>', "link"),
    "no_limit": (f'<robot name="r">{LINKS}{JOINT.format(child="b", limit="")}</robot>', "limit"),
    "kind": (
        f'<robot name="r">{LINKS}{JOINT.format(child="b", limit="").replace("revolute", "rotary")}</robot>',
        "rotary",
    ),
    "lost_child": (f'<robot name="r">{LINKS}{JOINT.format(child="c", limit=LIMIT)}</robot>', "does not have"),
    "not_xml": ('<robot name="r">', "not well-formed"),
    "empty": ("", "not well-formed"),
    "html": ("<html><body/></html>", "neither URDF, SDF nor MJCF"),
    "two_roots": ('<robot name="r"><link name="a"/><link name="b"/></robot>', "root"),
}


@pytest.mark.parametrize("name", BAD_URDFS)
def test_broken_descriptions(tmp_path: Path, name: str, capfd: pytest.CaptureFixture[str]) -> None:
    text, reason = BAD_URDFS[name]
    path = tmp_path / "bad.urdf"
    path.write_text(text)
    with pytest.raises(RobotFileError, match=reason) as caught:
        wbc.robots.load(path)
    assert caught.value.value == str(path)
    assert caught.value.field == "robot"
    assert capfd.readouterr() == ("", "")


def test_missing_directory_and_binary(tmp_path: Path) -> None:
    assert_refused(lambda: wbc.robots.load(str(tmp_path / "nothing.urdf")), RobotFileError, "no such file")
    assert_refused(lambda: wbc.robots.load("nothing.urdf"), RobotFileError, "no such file")
    assert_refused(lambda: wbc.robots.load(tmp_path), RobotFileError, "directory")
    (tmp_path / "noise.urdf").write_bytes(bytes(range(128, 256)))
    assert_refused(lambda: wbc.robots.load(tmp_path / "noise.urdf"), RobotFileError, "cannot be read")


def test_limits_upside_down() -> None:
    model = wbc.robots.load("ur5", shapes="none").model
    model.lowerPositionLimit = np.array([*model.lowerPositionLimit[:5], 7.0])
    assert_refused(lambda: wbc.robots.load(model), BoundsError, "position_lower: above position_upper at wrist_3_joint")


def test_unknown_names_list_the_nearest() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'panda'") as caught:
        wbc.robots.load("pandaa")
    assert caught.value.choices[0] == "panda"
    made = {"walker", "two_ended_arm", *OPERATOR_ARMS}
    assert set(caught.value.choices) == {recipe.name for recipe in wbc.robots.table()} | made
    assert_refused(lambda: wbc.robots.load("walkr"), UnknownNameError, "did you mean 'walker'")
    assert_refused(lambda: wbc.robots.load("panda", shapes="fitt"), UnknownNameError, "did you mean 'fit'")


@pytest.mark.parametrize("what", [3, None, 2.5, [], {"a": 1}, np.zeros(3)])
def test_things_that_are_no_robot(what: object) -> None:
    assert_refused(lambda: wbc.robots.load(what), ShapeError, "expected a name, a path")


def test_unsupported_joint_is_refused_unless_locked() -> None:
    model = pin.Model()
    first = model.addJoint(0, pin.JointModelEllipsoid(1.0, 2.0, 3.0), pin.SE3.Identity(), "egg")
    model.addJointFrame(first)
    second = model.addJoint(first, pin.JointModelRX(), pin.SE3.Identity(), "turn")
    model.addJointFrame(second)
    assert_refused(lambda: wbc.robots.load(model), UnsupportedJointError, "egg")
    assert wbc.robots.load(model, lock="egg").joint_names == ("turn",)
