"""A climb from request to check and folder; requests that cannot be are refused by name."""

from __future__ import annotations

import contextlib
import json
import pathlib

import numpy as np
import pytest

import wbc.log
from tests.formats.runs import ticks_and_reasons
from wbc.cli.folders import recording
from wbc.cli.output import RECORDED
from wbc.climb import report
from wbc.climb.loop import ClimbOutcome
from wbc.climb.request import ClimbRequest
from wbc.climb.session import climb, climber_of, course_of
from wbc.errors import ShapeError, UnknownNameError, WbcError

#: Two arms of one joint on a body that floats
URDF = """<robot name="two"><link name="body"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>{}</robot>"""
ARM = """<link name="arm{0}"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>
</inertial></link><joint name="joint{0}" type="revolute"><parent link="body"/><child link="arm{0}"/>
<origin xyz="{0} 0 0"/><axis xyz="0 0 1"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint>"""


def test_a_climb_is_planned_carried_out_checked_and_written(tmp_path: pathlib.Path) -> None:
    machine = climber_of(ClimbRequest())
    scene, start, _ = course_of(ClimbRequest(), machine)
    ahead = [np.linalg.norm(one.pose.translation - start.translation - 0.5 * start.rotation[:, 0])
             for one in scene.footholds]  # fmt: skip
    goal = scene.footholds[int(np.argmin(ahead))].id
    with contextlib.ExitStack() as stack:
        begin = recording(stack, tmp_path, mcap=True)
        assert begin is not None
        done = climb(ClimbRequest(goal=goal), backend="vm", compiled=begin)
    ticks, said = ticks_and_reasons(tmp_path / RECORDED[1])
    assert ticks == len(done.run.log) - 1
    assert any(" contact/" in text for text in said)
    assert done.run.outcome is ClimbOutcome.ARRIVED, done.run.reason
    assert done.report is not None
    assert done.report.clean, str(done.report)
    written = report.write(done.run, done.report, done.figures, tmp_path, pictures=False)
    assert {file.name for file in written} == {"log.npz", "check.txt", "figures.json"}
    figures = json.loads((tmp_path / "figures.json").read_text())
    assert figures["outcome"] == "arrived"
    assert figures["violations"] == []
    assert figures["steps"] == len(done.plan.moves) > 0
    log = wbc.log.load(tmp_path)
    assert log.meta["robot_digest"] == machine.robot.fingerprint
    assert log.tables["footholds"].shape == (len(scene.footholds), 8)


def test_requests_that_cannot_be_are_refused(tmp_path: pathlib.Path) -> None:
    file = tmp_path / "two.urdf"
    file.write_text(URDF.format(ARM.format(1) + ARM.format(2)))
    refused: list[tuple[dict[str, object], type[WbcError], str]] = [
        ({"robot": "hexapot"}, UnknownNameError, "hexapod"),
        ({"limbs": ("a", "b")}, ShapeError, "has limbs of its own"),
        ({"robot": str(file)}, ShapeError, "two limbs or more"),
        ({"robot": str(file), "limbs": ("arm1,arn2",)}, UnknownNameError, "arm2"),
        ({"robot": str(file), "limbs": ("arm1,body",)}, ShapeError, "no chain"),
    ]
    for options, error, text in refused:
        with pytest.raises(error, match=text):
            climber_of(ClimbRequest(**options))  # type: ignore[arg-type]  # what a command line gives
    machine = climber_of(ClimbRequest())
    with pytest.raises(UnknownNameError, match="stairs"):
        course_of(ClimbRequest(scene="stair"), machine)
    with pytest.raises(UnknownNameError, match="foothold"):
        course_of(ClimbRequest(goal="nowhere"), machine)
    assert len(climber_of(ClimbRequest(robot=str(file), limbs=("arm1, arm2",), hold="grip")).limbs) == 2
