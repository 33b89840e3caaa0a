"""A few steps on each built-in structure but the cylinder, on compliant holds: walked, and found sound."""

from __future__ import annotations

from pathlib import Path

import pytest

from wbc.robots import Walker
from wbc.walking import cylinder
from wbc.walking.checker import Rules, check_walk
from wbc.walking.loop.stack import WalkStack
from wbc.walking.run import PathRequest, perform_walk


@pytest.fixture(scope="module")
def compliant(machine: Walker) -> WalkStack:
    return WalkStack(machine, cylinder(), collisions=False)


@pytest.mark.parametrize(
    ("name", "start", "goal"), [("plane", "8,8", "8,13"), ("truss", "L2,6", "L2,11"), ("module", "15,4", "15,7")]
)
def test_it_walks_there(
    machine: Walker, compliant: WalkStack, name: str, start: str, goal: str, tmp_path: Path
) -> None:
    run = perform_walk(PathRequest(name, start=start, points=(goal,)), machine, stack=compliant)
    assert run.outcome == "arrived", run.reason
    assert run.plan is not None
    assert run.plan.regrasps
    assert run.log is not None
    report = check_walk(run.log, machine.urdf(tmp_path / "robot.urdf"), run.structure, Rules(sub_samples=1))
    assert report.ok, str(report)
