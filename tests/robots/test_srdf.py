"""Rotors of SRDF files become armatures, and what is not read of such a file is said."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wbc.robots
from tests.robots.files import example
from wbc.errors import RobotFileError
from wbc.robot import Recipe, Robot
from wbc.robot.loading import build

TABLE = {recipe.name: recipe for recipe in wbc.robots.table() if recipe.srdf and not recipe.problem}
GEARED = [name for name, recipe in TABLE.items() if "<rotor_params>" in Path(example(recipe.srdf)).read_text()]

ARM = """<robot name="arm"><link name="l0"/>
{links}
</robot>"""
LINK = """<link name="l{k}"><inertial><mass value="2"/><inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/>
</inertial></link><joint name="j{k}" type="revolute"><parent link="l{p}"/><child link="l{k}"/><origin xyz="0.3 0 0"/>
<axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="30" velocity="3"/>{mimic}</joint>"""


def arm(tmp_path: Path, srdf: str, *, mimic: str = "", base: str | None = None) -> Robot:
    """Three joints and an SRDF file of what is given."""
    links = "".join(LINK.format(k=k, p=k - 1, mimic=mimic if k == 3 else "") for k in (1, 2, 3))
    (tmp_path / "arm.urdf").write_text(ARM.format(links=links))
    (tmp_path / "arm.srdf").write_text(f'<robot name="arm">{srdf}</robot>')
    return build(tmp_path / "arm.urdf", Recipe("arm", srdf=str(tmp_path / "arm.srdf")), base, "none")


def rotors(*texts: str) -> str:
    return f"<rotor_params>{''.join(f'<joint {text}/>' for text in texts)}</rotor_params>"


@pytest.mark.parametrize("name", GEARED)
def test_mass_matrices_are_those_of_pinocchio_with_its_rotors(name: str) -> None:
    robot, rng = wbc.robots.load(name, shapes="none"), np.random.default_rng(0)
    model, srdf = pin.Model(robot.model), str(example(TABLE[name].srdf))
    model.armature, model.rotorInertia, model.rotorGearRatio = np.zeros(model.nv), np.zeros(model.nv), np.ones(model.nv)
    pin.loadRotorParameters(model, srdf, False)
    for field in ("rotorInertia", "rotorGearRatio"):
        np.testing.assert_array_equal(getattr(robot.model, field), getattr(model, field))
    for q in (robot.random(rng) for _ in range(5)):
        ours, its = (pin.crba(each, each.createData(), q) for each in (robot.model, model))
        np.testing.assert_array_equal(np.triu(ours), np.triu(its))
    assert robot.notes["armature"].startswith("rotors of the SRDF file")


@pytest.mark.parametrize("base", [None, "floating"])
def test_rotors_of_random_files(tmp_path: Path, base: str | None) -> None:
    """Joints without a rotor have none, joints that the robot does not have are left out, as of Pinocchio."""
    rng = np.random.default_rng(3)
    for _ in range(10):
        drawn = rng.uniform(0.0, 1e-3, 3), rng.uniform(-150.0, 150.0, 3)
        lines = [f'name="j{k + 1}" mass="{drawn[0][k]:.17g}" gear_ratio="{drawn[1][k]:.17g}"' for k in range(3)]
        kept = sorted(rng.choice(3, rng.integers(1, 4), replace=False).tolist())
        robot = arm(tmp_path, rotors(*(lines[k] for k in kept), 'name="gone" mass="1" gear_ratio="2"'), base=base)
        want = np.zeros(robot.nv)
        want[[k + robot.base_nv for k in kept]] = (drawn[0] * drawn[1] ** 2)[kept]
        np.testing.assert_allclose(robot.model.armature, want, rtol=1e-15)


@pytest.mark.parametrize(
    ("srdf", "words"),
    [
        (rotors('name="j1" mass="-1" gear_ratio="3"'), "rotor of joint j1"),
        (rotors('name="j1" mass="1e-4"'), "rotor of joint j1"),
        (rotors('name="j1" mass="light" gear_ratio="3"'), "light"),
        (rotors('name="j1" mass="1" gear_ratio="inf"'), "inf"),
        (rotors('name="j2" mass="1" gear_ratio="2"', 'name="j2" mass="1" gear_ratio="2"'), "joint j2"),
        (rotors('name="root_joint" mass="1" gear_ratio="2"'), "several degrees of freedom"),
    ],
)
def test_bad_rotors_are_refused_by_name(tmp_path: Path, srdf: str, words: str) -> None:
    with pytest.raises(RobotFileError, match=words) as caught:
        arm(tmp_path, srdf, base="floating")
    assert "arm.srdf" in str(caught.value)


def test_what_is_not_read_is_said(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    srdf = '<group name="g"/><group name="h"/><virtual_joint name="v"/><passive_joint name="j3"/>'
    robot = arm(tmp_path, srdf, mimic='<mimic joint="j2" multiplier="0.5"/>')
    assert robot.notes["srdf"] == "not read of the SRDF file: 2 group, 1 virtual_joint"
    assert not caplog.text  # what follows another joint needs no motor
    robot = arm(tmp_path, srdf)
    assert "j3" in robot.notes["passive"]
    assert robot.notes["passive"] in caplog.text
    robot = arm(tmp_path, rotors('name="j1" mass="0" gear_ratio="1"'))
    assert {"srdf", "armature", "passive"} & set(robot.notes) == {"armature"}
