"""MJCF files: couplings of joints, meshes beside the file, refusals; random ones are in test_random_mjcf.py."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

import wbc.robots
from tests.refusals import assert_refused
from tests.robots.files import DATA
from wbc.errors import RobotFileError
from wbc.extras import MissingPackageError

CRAWLER = DATA / "crawler.xml"


def write(folder: Path, body: str, head: str = "") -> Path:
    """A model with one body."""
    path = folder / "model.xml"
    path.write_text(f'<mujoco>{head}<worldbody><body name="b">{body}<geom size="0.1"/></body></worldbody></mujoco>')
    return path


def test_joint_equalities_become_couplings(caplog: pytest.LogCaptureFixture) -> None:
    """Two of one follower couple what they follow; a circle that says the same is no more than one of them."""
    arm = '<body pos="{k} 0 0"><joint name="{n}" axis="1 0 0" range="-90 90"/><geom size=".1"/></body>'
    bodies = "".join(arm.format(k=k, n=name) for k, name in enumerate("abcd"))
    equalities = (
        '<joint joint1="b" joint2="a" polycoef="0.1 -2 0 0 0"/><joint joint1="b" joint2="c" polycoef="0 4 0 0 0"/>'
        '<joint joint1="a" joint2="b" polycoef="0.05 -0.5 0 0 0"/>'
        '<joint name="off" joint1="a" joint2="d" active="false"/>'
    )
    robot = wbc.robots.load(f"<mujoco><worldbody>{bodies}</worldbody><equality>{equalities}</equality></mujoco>")
    found = {robot.dof_names[c.follower]: (robot.dof_names[c.leader], c.ratio, c.offset) for c in robot.couplings}
    assert found == {"b": ("c", 4.0, 0.0), "a": ("c", -2.0, pytest.approx(0.05))}
    said = "c has -0.392699 to 0.392699 of its -1.5708 to 1.5708 left, by the limits of {}, which follows it"
    assert caplog.messages == ["MuJoCo Model: " + "; ".join(said.format(name) for name in "ba")]
    more = equalities + '<joint name="curve" joint1="d" joint2="a" polycoef="0 1 1 0 0"/>'
    curved = wbc.robots.load(f"<mujoco><worldbody>{bodies}</worldbody><equality>{more}</equality></mujoco>")
    assert [loop.name for loop in curved.loops.loops] == ["curve"]
    assert caplog.messages[1:] == caplog.messages[:1]


def test_meshes_are_found_from_the_files_own_folder(tmp_path: Path) -> None:
    (tmp_path / "meshes").mkdir()
    corners = np.array([[0, 0, 0], [0.4, 0, 0], [0, 0.1, 0], [0, 0, 0.1]])
    lines = [f"v {x} {y} {z}" for x, y, z in corners] + ["f 1 2 3", "f 1 2 4", "f 1 3 4", "f 2 3 4"]
    (tmp_path / "meshes" / "wedge.obj").write_text("\n".join(lines))
    path = tmp_path / "mesh.xml"
    path.write_text(
        '<mujoco><compiler meshdir="meshes"/><asset><mesh name="wedge" file="wedge.obj"/></asset><worldbody>'
        '<body name="b"><joint name="j"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
        '<geom type="mesh" mesh="wedge"/></body></worldbody></mujoco>'
    )
    (shape,) = wbc.robots.load(path, shapes="fit").shapes["b"]
    a, b = shape.ends()
    t = np.clip((corners - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
    assert (np.linalg.norm(corners - a - t[:, None] * (b - a), axis=1) <= shape.shape.radius + 1e-9).all()


def test_refused_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(RobotFileError, match="MuJoCo refused it: XML Error: invalid keyword: 'spherical'"):
        wbc.robots.load(write(tmp_path, '<joint type="spherical"/>'))
    with pytest.raises(RobotFileError, match=r"opening file .*missing\.stl"):
        wbc.robots.load(write(tmp_path, "<joint/>", '<asset><mesh file="missing.stl"/></asset>'))
    broken = tmp_path / "loop.xml"
    broken.write_text('<mujoco><include file="loop.xml"/></mujoco>')
    assert_refused(lambda: wbc.robots.load(broken), RobotFileError, "include")
    with pytest.raises(RobotFileError, match="no MJCF: the root element is <robot>"):
        wbc.robots.load("<!-- <mujoco> --><robot/>")
    assert_refused(lambda: wbc.robots.load("<mujoco/>"), RobotFileError, "no joint that moves a robot")
    monkeypatch.setitem(sys.modules, "mujoco", None)
    for source in (CRAWLER, "<mujoco/>"):
        with pytest.raises(MissingPackageError, match=r"MuJoCo's compiler reads.*pip install 'wbc\[mujoco\]'"):
            wbc.robots.load(source)
