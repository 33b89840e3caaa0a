"""``wbc ik`` as a user types it; Pinocchio judges what it prints and writes."""

from __future__ import annotations

import csv
import functools
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

import wbc
from tests.cli.test_commands import run as wbc_command
from tests.models import placement

DOWN = "0.4,0.2,0.5,1,0,0,0"
GOAL = pin.SE3(np.diag([1.0, -1.0, -1.0]), np.array([0.4, 0.2, 0.5]))

run = functools.partial(wbc_command, "ik")


def place(name: str, q: Any, frame: str) -> pin.SE3:
    return placement(wbc.robots.load(name), frame, np.array(q, dtype=float))


def printed(out: str, label: str) -> list[float]:
    """The configuration that a line of the output has."""
    line = next(line for line in out.splitlines() if line.startswith(f"q {label} "))
    return [float(x) for x in line.split()[2].split(",")]


def test_a_pose_is_reached() -> None:
    code, out, err = run("ur5", "--target", DOWN)
    assert (code, err) == (0, "")
    assert "solved" in out
    assert "elbow_joint" in out
    assert place("ur5", printed(out, "1"), "tool0").isApprox(GOAL, 1e-6)


def test_all_branches_of_a_pose(tmp_path: Path) -> None:
    file = tmp_path / "q.csv"
    code, out, err = run("ur5", "--target", DOWN, "--branches", "--out", file, "--seed", "3", "--budget", "60")
    assert (code, err) == (0, "")
    rows = list(csv.DictReader(file.open()))
    assert [row["branch"] for row in rows] == [str(k) for k in range(1, 9)]
    names = wbc.robots.load("ur5").dof_names
    found = np.array([[float(row[name]) for name in names] for row in rows])
    assert all(place("ur5", q, "tool0").isApprox(GOAL, 1e-5) for q in found)
    assert {row["status"] for row in rows} == {"solved"}
    assert max(float(row["position_error"]) for row in rows) < 2e-5
    np.testing.assert_allclose(printed(out, "1.8"), found[7], atol=1e-7)
    assert min(np.abs(a - b).max() for k, a in enumerate(found) for b in found[:k]) > 0.01


#: Joints that turn without end on both sides of a slide
CHAIN = """<robot name="chain"><link name="a"/><link name="b"/><link name="c"/><link name="d"/><link name="tool"/>
<joint name="turn" type="continuous"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/></joint>
<joint name="slide" type="prismatic"><parent link="b"/><child link="c"/><origin xyz="0.4 0 0"/><axis xyz="1 0 0"/>
<limit lower="0" upper="0.3" effort="1" velocity="1"/></joint>
<joint name="wrist" type="continuous"><parent link="c"/><child link="d"/><axis xyz="0 0 1"/></joint>
<joint name="end" type="fixed"><parent link="d"/><child link="tool"/><origin xyz="0.1 0 0"/></joint></robot>"""


def test_the_end_of_a_chain_is_its_tip_and_angles_without_end_are_printed(tmp_path: Path) -> None:
    file = tmp_path / "chain.urdf"
    file.write_text(CHAIN)
    code, out, err = run(file, "--target", "0,0.6,0,0,0,1,0", "--backend", "vm")
    assert (code, err) == (0, "")
    robot, q = wbc.robots.load(str(file)), np.array(printed(out, "1"))
    assert robot.pose(q, "tool").isApprox(pin.SE3(np.diag([-1.0, -1.0, 1.0]), np.array([0.0, 0.6, 0.0])), 1e-4)
    values = {
        line.split()[0]: float(line.split()[2]) for line in out.splitlines() if line.split()[1:2] in (["rad"], ["m"])
    }
    turned = (
        pin.rpy.matrixToRpy(robot.pose(q, "b").rotation)[2],
        pin.rpy.matrixToRpy(robot.pose(q, "d", "c").rotation)[2],
    )
    np.testing.assert_allclose(
        [values["turn"], values["slide"], values["wrist"]], [turned[0], q[2], turned[1]], atol=1e-5
    )


def test_targets_from_files_and_positions(tmp_path: Path) -> None:
    text = tmp_path / "way.csv"
    text.write_text("# two poses\nt,x,y,z,qx,qy,qz,qw\n0,0.4,0.2,0.5,1,0,0,0\n\n1,0.4,-0.2,0.5,1,0,0.0002,0\n")
    poses, positions, out = tmp_path / "a.npz", tmp_path / "b.npz", tmp_path / "out.npz"
    np.savez(poses, poses=np.array([GOAL.homogeneous]))
    np.savez(positions, positions=np.array([[0.4, 0.0, 0.5]]))
    assert run("ur5", "--targets", text, "--out", out)[0] == 0
    with np.load(out) as found:
        assert found["target"].tolist() == [1, 2]
        assert found["names"].tolist() == list(wbc.robots.load("ur5").dof_names)
        ends = [place("ur5", q, "tool0").translation for q in found["q"]]
    np.testing.assert_allclose(ends, [[0.4, 0.2, 0.5], [0.4, -0.2, 0.5]], atol=1e-5)
    code, said, _ = run("ur5", "--targets", poses, "--target", "0.3,0.3,0.4")
    assert code == 0
    np.testing.assert_allclose(place("ur5", printed(said, "1"), "tool0").translation, [0.3, 0.3, 0.4], atol=1e-5)
    assert place("ur5", printed(said, "2"), "tool0").isApprox(GOAL, 1e-6)
    code, said, _ = run("ur5", "--targets", positions, "--frame", "tool0")
    assert code == 0
    np.testing.assert_allclose(place("ur5", printed(said, "1"), "tool0").translation, [0.4, 0.0, 0.5], atol=1e-5)


def test_out_of_reach_is_exit_code_1_with_the_reason(tmp_path: Path) -> None:
    file = tmp_path / "q.csv"
    code, out, err = run("ur5", "--target", "3,0,0", "--target", DOWN, "--out", file, "--branches")
    assert code == 1
    assert "unreachable" in out
    assert err.startswith("target 1: unreachable after 101 descents; off by 2.")
    assert "out of reach of the robot itself by 2." in err
    assert "no constraint is to blame" in err
    assert "binding" not in err
    assert "rad" not in err
    rows = list(csv.DictReader(file.open()))
    assert [row["status"] for row in rows] == ["unreachable"] + ["solved"] * 8


def test_obstacles_take_part() -> None:
    """A ball where the hand shall be; a floor above the robot; both out of the way."""
    code, _, err = run("ur5", "--target", "0.4,0.2,0.5", "--sphere", "0.4,0.2,0.5,0.1", "--floor", "-0.2")
    assert code == 1
    assert "target 1: unreachable" in err
    assert "sphere1/" in err.split("binding: ")[1]
    assert "within reach without sphere1;" in err
    code, _, err = run("ur5", "--target", DOWN, "--sphere", "0.4,0.6,0.5,0.1", "--floor", "1.5")
    assert code == 1
    assert "contradictory" in err
    assert "cannot be kept: floor/" in err
    code, out, _ = run("ur5", "--target", DOWN, "--sphere", "0.4,0.6,0.5,0.1", "--floor", "-0.2")
    assert code == 0
    assert place("ur5", printed(out, "1"), "tool0").isApprox(GOAL, 1e-5)


def test_the_search_begins_where_it_is_told(tmp_path: Path) -> None:
    near = wbc.robots.load("ur5").neutral + 0.05
    start = ",".join(str(x) for x in near)
    goal = place("ur5", near + 0.01, "tool0")
    numbers = ",".join(f"{x:.17g}" for x in pin.SE3ToXYZQUAT(goal))
    code, out, _ = run("ur5", "--target", numbers, "--start", start)
    assert code == 0
    np.testing.assert_allclose(printed(out, "1"), near + 0.01, atol=1e-4)


def test_a_file_is_written_over_where_that_is_asked_for(tmp_path: Path) -> None:
    file = tmp_path / "q.csv"
    file.write_text("old")
    assert run("ur5", "--target", DOWN, "--out", file, "--force")[0] == 0
    assert file.read_text().startswith("target,branch,status")
