"""A body with four arms is planned for and walks as one with three."""

from __future__ import annotations

import pathlib

import wbc
from wbc.walking import Structure
from wbc.walking.body_path import grid_path
from wbc.walking.checker import check_walk
from wbc.walking.loop.stack import WalkStack
from wbc.walking.loop.walk import Walk
from wbc.walking.planner.planner import plan_walk
from wbc.walking.run.recording import WalkRecorder

INCH = 0.0254


def test_four_arms_walk(structure: Structure, tmp_path: pathlib.Path) -> None:
    # At the shoulder radius of three arms there is little room between four
    machine = wbc.robots.walker(4, 16 * INCH)
    plan = plan_walk(machine, structure, grid_path([(13, 9), (13, 12)], 4 * INCH))
    assert plan.complete
    assert len(plan.start) == len(set(plan.start)) == 4
    assert plan.regrasps
    walk = Walk(machine, structure, plan, stack=WalkStack(machine, structure, collisions=False))
    recorder = WalkRecorder(walk)
    assert walk.run(recorder.tick) == "arrived"
    report = check_walk(recorder.log()[0], machine.urdf(tmp_path / "robot.urdf"), structure)
    assert report.ok, str(report)
