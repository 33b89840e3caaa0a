"""Swings of plans are computed once more as they will be carried out."""

from __future__ import annotations

import pytest

from wbc.robots import Walker
from wbc.walking import Structure
from wbc.walking.body_path import grid_path
from wbc.walking.holds.built_in import grid_pose, remove_fraction
from wbc.walking.modes.drive import standing_plan
from wbc.walking.planner import sound
from wbc.walking.planner.planner import plan_walk
from wbc.walking.planner.swings.law import SwingLaw
from wbc.walking.planner.swings.move import Move
from wbc.walking.planner.swings.swings import Swings


def test_a_swing_that_turns_out_impossible_is_not_in_the_plan(
    machine: Walker, structure: Structure, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = grid_path([(13, 9), (13, 13)], 0.1)
    first = plan_walk(machine, structure, path)
    assert all(law.possible for law in first.laws)
    assert [law.duration + 0.24 for law in first.laws] == pytest.approx(
        [max(step.duration, step.land - step.lift) for step in first.regrasps], abs=0.1
    )
    step, of = first.regrasps[0], sound.law_of

    def barred(swings: Swings, move: Move) -> SwingLaw:
        law, holds = of(swings, move), structure.ids
        grips = swings.grips
        if (holds[grips.hold[move.source]], holds[grips.hold[move.target]]) == (step.source, step.target):
            object.__setattr__(law, "possible", False)
        return law

    monkeypatch.setattr(sound, "law_of", barred)
    other = plan_walk(machine, structure, path)
    assert other.complete
    assert len(other.laws) == len(other.regrasps)
    assert (step.source, step.target) not in [(one.source, one.target) for one in other.regrasps]


def test_a_corrected_time_counts_only_where_the_way_is_possible(machine: Walker, structure: Structure) -> None:
    """The same swing with other room to land has no way here, though its time was corrected before."""
    sparse = remove_fraction(structure, 0.74, 0)
    plan = standing_plan(machine, sparse, grid_pose(13, 8, 152 * 0.0254))
    assert not plan.regrasps
