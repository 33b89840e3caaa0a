"""A body with four arms is planned for and walks as one with three."""

from __future__ import annotations

import pathlib
from itertools import combinations, product

import numpy as np

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
from wbc.walking.planner.stances.nodes import StanceEnds
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


def test_a_start_of_many_arms_lasts_longest(structure: Structure) -> None:
    """As all stances of some grips say, one by one."""
    machine = wbc.robots.walker(4, 16 * INCH)
    path = grid_path([(13, 9), (13, 11)], 4 * INCH)
    grips = drained(grip_slices(machine, structure, path))
    search = BodySearch(machine, structure, path, grips)
    some = [[int(g) for g in grips.of_arm(arm) if grips.first[g] == 0][:5] for arm in range(4)]
    search.conflicts.prepare(pair for one, other in combinations(some, 2) for pair in product(one, other))
    apart = [key for key in product(*some) if len({int(grips.hold[g]) for g in key}) == 4]
    found = list(_candidates(grips, search, some, 0))
    assert found
    assert search.until(found[0], 0) == max(search.until(key, 0) for key in apart)


def test_of_two_arms_that_conflict_the_one_whose_grip_ends_sooner_moves() -> None:
    class Meeting:
        """Grips 0 and 2 are in each other's way from sample 5 on."""

        def prepare(self, pairs: object) -> None: ...

        def first_conflict(self, one: int, other: int, sample: int) -> int:
            return max(5, sample) if {one, other} == {0, 2} else 1000

        def free_from(self, one: int, other: int, sample: int) -> int:
            return sample

    last, stance = np.array([20, 30, 40]), (np.array([[0, 1, 2]]), np.array([0]))
    assert StanceEnds(Meeting(), last, last).by_arm(*stance).tolist() == [[4, 30, 40]]
    assert StanceEnds(Meeting(), last[::-1], last).by_arm(*stance).tolist() == [[40, 30, 4]]
