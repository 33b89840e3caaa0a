"""Obstacles with height of a structure file: hands and arms go round them; the checker sees where they would not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wbc.robots import Walker
from wbc.shapes import Box, Capsule
from wbc.walking import Obstacle, Structure, read_structure, save_structure
from wbc.walking.body_path import grid_path
from wbc.walking.checker import Report, Rules, check_walk
from wbc.walking.holds.built_in import grid_pose
from wbc.walking.loop.stack import WalkStack
from wbc.walking.loop.walk import Walk
from wbc.walking.planner.plan import NoPlanError, Plan
from wbc.walking.planner.planner import plan_walk
from wbc.walking.run.recording import WalkRecorder

INCH = 0.0254
CLEARANCE = "clearance of the structure"


def checked(
    machine: Walker, planned: Plan, on: Structure, stack: WalkStack, folder: Path, foresees: bool = True
) -> Report:
    """A walk, checked against a structure that need not be the one that it was planned for."""
    walk = Walk(machine, on, planned, stack=stack, foresees=foresees)
    recorder = WalkRecorder(walk)
    assert walk.run(recorder.tick) == "arrived"
    return check_walk(recorder.log()[0], machine.urdf(folder / "robot.urdf"), on, Rules(sub_samples=1))


def test_swings_go_round_what_stands_in_their_way(
    machine: Walker, structure: Structure, stack: WalkStack, tmp_path: Path
) -> None:
    path = grid_path([(13, 9), (13, 13)], 4 * INCH)
    plain = plan_walk(machine, structure, path)
    # A post and a box as high as a hand swings, halfway along the first two swings
    obstacles = []
    for step, shape in zip(plain.regrasps, (Capsule(0.03, 0.3), Box((0.1, 0.1, 0.5))), strict=False):
        t, a = np.mean([[float(x) for x in hold.split(",")] for hold in (step.source, step.target)], axis=0).tolist()
        obstacles.append(Obstacle(f"{step.arm}'s", shape, grid_pose(t, a, 100 * INCH)))
    assert len(obstacles) == 2
    file = save_structure(replace(structure, obstacles=tuple(obstacles)), tmp_path / "there.csv")
    there = replace(read_structure(file), name=structure.name)
    assert [obstacle.id for obstacle in there.obstacles] == [obstacle.id for obstacle in obstacles]
    # Planned without them, a hand comes too near, or the walk refuses to begin; planned with them, none does
    with pytest.raises(NoPlanError, match="obstacle"):
        checked(machine, plain, there, stack, tmp_path)
    blind = checked(machine, plain, there, stack, tmp_path, foresees=False)
    assert not blind[CLEARANCE].ok
    assert blind[CLEARANCE].where.endswith("'s")
    seen = plan_walk(machine, there, path)
    assert seen.rows() != plain.rows()
    report = checked(machine, seen, there, stack, tmp_path)
    assert report.ok, str(report)
