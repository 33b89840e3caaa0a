"""What happens on the way: holds that vanish, hands that miss, a body that turns back."""

from __future__ import annotations

import numpy as np
import pytest

from wbc.errors import UnknownNameError
from wbc.robots import Walker
from wbc.walking import Structure
from wbc.walking.body_path import BodyPath, grid_path
from wbc.walking.plan import HoldLost
from wbc.walking.planner import plan_walk
from wbc.walking.walk import Tick, Walk
from wbc.walking.walk_stack import WalkStack

INCH = 0.0254


@pytest.fixture
def walk(machine: Walker, structure: Structure, stack: WalkStack) -> Walk:
    plan = plan_walk(machine, structure, grid_path([(13, 9), (13, 13)], 4 * INCH))
    return Walk(machine, structure, plan, stack=stack)


def to_first(walk: Walk, what: str, after: float = 0.0) -> None:
    """Ticks until something has happened, and some seconds more."""
    while not any(event.what == what for event in walk.events):
        walk.tick()
    end = walk.time + after
    while walk.time < end:
        walk.tick()


def finish(walk: Walk) -> list[Tick]:
    """The rest of the walk, in which hands and body keep what they are to keep."""
    ticks = list[Tick]()
    assert walk.run(ticks.append) == "arrived"
    assert max(tick.slip for tick in ticks) < 0.001
    assert max(tick.body_error for tick in ticks) < 0.003
    assert all(sum(hand == "closed" for hand in tick.hands) >= 2 for tick in ticks)
    return ticks


def test_a_hold_that_vanishes_before_the_hand_is_there(walk: Walk) -> None:
    to_first(walk, "lift", 0.4)
    assert walk.swinging is not None
    gone = walk.structure.ids[walk.swinging.hold]
    walk.vanish([gone])
    finish(walk)
    assert gone not in walk.structure
    assert [event.what for event in walk.events if event.what in ("vanished", "replanned")] == ["vanished", "replanned"]


def test_a_hold_that_vanishes_in_the_hand(walk: Walk) -> None:
    for _ in range(60):
        walk.tick()
    gone = walk.structure.ids[walk.held[0]]
    walk.vanish([gone])
    assert 0 not in walk.held
    finish(walk)
    assert set(walk.held) == {0, 1, 2}


def test_too_few_hands_stop_the_walk(walk: Walk) -> None:
    to_first(walk, "lift", 0.3)
    held = [walk.structure.ids[hold] for hold in walk.held.values()]
    walk.vanish(held[:1])
    with pytest.raises(HoldLost, match="at least 2 must hold"):
        walk.tick()


def test_names_that_are_none_change_nothing(walk: Walk) -> None:
    before = walk.structure
    with pytest.raises(UnknownNameError, match="did you mean '13,1"):
        walk.vanish(["13,100"])
    assert walk.structure is before


def test_a_hand_that_misses_tries_again_and_then_elsewhere(
    machine: Walker, structure: Structure, stack: WalkStack
) -> None:
    plan = plan_walk(machine, structure, grid_path([(13, 9), (13, 13)], 4 * INCH))
    bad = plan.regrasps[0].target
    walk = Walk(machine, structure, plan, stack=stack, grasps=lambda _arm, hold: hold != bad)
    finish(walk)
    assert sum(event.what == "failed" for event in walk.events) == 3
    assert bad not in [event.hold for event in walk.events if event.what == "land"]


def test_turning_back(walk: Walk) -> None:
    to_first(walk, "land", 0.3)
    back = grid_path([(13, 9 + 4 * walk.path_time / 9.25), (13, 8)], 4 * INCH)
    walk.go(back)
    finish(walk)
    assert np.linalg.norm(walk.q[:3] - back.poses[-1][:3, 3]) < 0.002


def test_a_path_goes_on_where_the_body_stands(walk: Walk) -> None:
    assert isinstance(walk.plan.path, BodyPath)
    finish(walk)
    walk.go(grid_path([(13, 13), (14, 13)], 4 * INCH))
    finish(walk)
    assert walk.plan.path.poses[-1][2, 3] == pytest.approx(-13 * 9.25 * INCH)
