"""Every row of the table: loads (or says why not), with limits, neutral configuration and frames that hold."""

from __future__ import annotations

import functools
import pathlib
import xml.etree.ElementTree as ElementTree

import numpy as np
import pinocchio as pin
import pytest

import wbc.robots
from tests.models import placement
from tests.robots.files import example
from wbc.errors import RobotFileError, WbcError
from wbc.robot import Recipe, Robot
from wbc.robot.sources.files import example_data_folder, listed_data_folder
from wbc.robot.sources.table import read_robot
from wbc.robots import catalogue

TABLE = {recipe.name: recipe for recipe in wbc.robots.table()}
CASSIE = "cassie_description/robots/cassie"
LOADABLE = [name for name, recipe in TABLE.items() if not recipe.problem]


@functools.cache
def bare(name: str) -> Robot:
    """A robot without shapes, loaded once."""
    return wbc.robots.load(name, shapes="none")


def test_every_description_of_the_wheel_has_one_row() -> None:
    """69 URDF files, of which one has no link, and Cassie's SDF; the folder is that of the wheel's own list."""
    folder = example_data_folder()
    assert folder == listed_data_folder()
    files = sorted(str(p.relative_to(folder)) for p in folder.rglob("*.urdf"))
    assert sorted(recipe.file for recipe in TABLE.values()) == sorted([*files, f"{CASSIE}_v2.sdf"])
    folders = {p.name for p in folder.iterdir() if p.is_dir()}
    assert {recipe.file.split("/")[0] for recipe in TABLE.values()} == folders
    assert (len(files), len(folders)) == (69, 39)
    assert [recipe.file for name, recipe in TABLE.items() if name not in LOADABLE] == ["ur_description/urdf/ur3.urdf"]
    assert not list(ElementTree.parse(example("ur_description/urdf/ur3.urdf")).getroot())


@pytest.mark.parametrize("name", [name for name, recipe in TABLE.items() if recipe.problem])
def test_rows_with_a_problem_are_listed_and_refused(name: str) -> None:
    assert name not in wbc.robots.names()
    with pytest.raises(RobotFileError) as caught:
        wbc.robots.load(name)
    reason = {"ur3_xacro": "the robot has no name"}[name]
    assert reason in str(caught.value)


@pytest.mark.parametrize("name", [*TABLE, "pand", "a]\n[panda"])
def test_a_row_read_alone_is_that_of_the_table(name: str) -> None:
    assert read_robot(pathlib.Path(catalogue.__file__).parent, name) == TABLE.get(name)


#: Files of the wheel that are no row -> why they do not load; "": they do
OTHERS = {
    f"{CASSIE}.sdf": "is of type 'gearbox'",
    f"{CASSIE}_reduced.sdf": "no configuration was found that closes it",
    f"{CASSIE}_simple.sdf": "no configuration was found that closes it",
    f"{CASSIE}_wo_gearbox_spring.sdf": "",
    "hector_description/robots/quadrotor_base.urdf.xacro": "the robot has no name",
    "hector_description/robots/quadrotor_base.xacro": "cannot be expanded",
}


@pytest.mark.parametrize("file", OTHERS)
def test_other_files_of_the_wheel_load_or_say_why(file: str) -> None:
    folder = example_data_folder()
    there = [path for kind in ("sdf", "xacro") for path in folder.rglob(f"*.{kind}")]
    assert {str(path.relative_to(folder)) for path in there} == {*OTHERS, f"{CASSIE}_v2.sdf"}
    if not OTHERS[file]:
        assert wbc.robots.load(folder / file, shapes="none").nv > 0
        return
    with pytest.raises(WbcError, match=OTHERS[file]):
        wbc.robots.load(folder / file, shapes="none")


@pytest.mark.parametrize("name", LOADABLE)
def test_robot_loads_as_its_row_says(name: str) -> None:
    recipe: Recipe = TABLE[name]
    robot = wbc.robots.load(name)
    assert (robot.name, robot.base) == (name, recipe.base)
    assert robot.source == str(example(recipe.file))
    assert robot.notes["acceleration"]
    assert len(set(robot.frame_names)) == len({str(f.name) for f in robot.model.frames} | {"world"})
    assert len({str(f.name) for f in robot.model.frames}) == robot.model.nframes
    for frame in robot.frames.values():
        assert np.isfinite(placement(robot, frame, robot.neutral).homogeneous).all()


@pytest.mark.parametrize("name", LOADABLE)
def test_base_is_unlimited_and_neutral_is_within_limits(name: str) -> None:
    robot = bare(name)
    for array in (robot.limits.position_upper, -robot.limits.position_lower, robot.limits.velocity):
        assert np.isinf(array[: robot.base_nv]).all()
    assert pin.isNormalized(robot.model, robot.neutral)
    for dof in np.flatnonzero(robot.position_index >= 0):
        q = robot.neutral[robot.position_index[dof]]
        assert robot.limits.position_lower[dof] <= q <= robot.limits.position_upper[dof], robot.dof_names[dof]


@pytest.mark.parametrize("name", [n for n in LOADABLE if not TABLE[n].acceleration])
def test_unknown_accelerations_are_unlimited_and_said_so(name: str) -> None:
    robot = bare(name)
    assert np.isinf(robot.limits.acceleration).all()
    assert robot.notes["acceleration"] == "none known: unlimited"


def test_published_accelerations() -> None:
    panda = wbc.robots.load("panda", shapes="none")
    np.testing.assert_array_equal(panda.limits.acceleration, [15, 7.5, 10, 12.5, 15, 20, 20])
    assert "Franka" in panda.notes["acceleration"]
    np.testing.assert_array_equal(wbc.robots.load("xarm7").limits.acceleration, np.full(7, 20.0))


@pytest.mark.parametrize("name", [n for n in LOADABLE if TABLE[n].state])
def test_neutral_configuration_is_the_srdf_state(name: str) -> None:
    robot = bare(name)
    tree = ElementTree.parse(example(TABLE[name].srdf))
    (state,) = (g for g in tree.getroot().findall("group_state") if g.get("name") == TABLE[name].state)
    followers = {robot.dof_names[c.follower] for c in robot.couplings}
    compared = 0
    for element in state.findall("joint"):
        joint, values = str(element.get("name")), [float(x) for x in element.get("value", "").split()]
        index = robot.position_index[robot.dofs(joint)] if joint in robot.joint_names else []
        put_elsewhere = joint in robot.notes["neutral"] or joint in followers
        if len(values) == 1 and len(index) == 1 and index[0] >= 0 and not put_elsewhere:
            assert robot.neutral[index[0]] == values[0]
            compared += 1
        elif joint == "root_joint" and robot.base == "floating" and len(values) == 7:
            np.testing.assert_allclose(robot.neutral[:7], values, atol=1e-5)
    assert compared >= 2
