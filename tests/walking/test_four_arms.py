"""A body with four arms is planned for and walks as one with three."""

from __future__ import annotations

import pathlib

import wbc
from wbc.walking import Structure
from wbc.walking.body_path import grid_path
from wbc.walking.checker import check_walk
from wbc.walking.loop.stack import WalkStack
from wbc.walking.loop.walk import Walk
from wbc.walking.planner.grips.table import grip_slices
from wbc.walking.planner.planner import plan_walk
from wbc.walking.planner.slices import drained
from wbc.walking.planner.stances.body import BodySearch
from wbc.walking.planner.starts import NOTHING, _candidates, stances
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


def test_hands_that_have_one_grip_each_are_a_start(structure: Structure) -> None:
    """Of four arms that are told their holds, and have one branch there."""
    machine = wbc.robots.walker(4, 16 * INCH)
    path = grid_path([(13, 9), (13, 9.2)], 4 * INCH)
    grips = drained(grip_slices(machine, structure, path))
    search = BodySearch(machine, structure, path, grips)
    found = stances(machine, structure, search, NOTHING)[0]
    only = [(grip,) for grip in found]
    assert list(_candidates(grips, search, only, 0)) == [found]
