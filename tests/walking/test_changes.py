"""What happens on the way: holds that vanish, hands that miss, a body that turns back."""

from __future__ import annotations

import numpy as np
import pytest

from wbc.errors import UnknownNameError
from wbc.robots import Walker
from wbc.walking import Structure, remove_rows
from wbc.walking.body_path import BodyPath, grid_path
from wbc.walking.loop.stack import WalkStack
from wbc.walking.loop.walk import Tick, Walk
from wbc.walking.planner.plan import HoldLost, NoPlanError
from wbc.walking.planner.planner import plan_walk
from wbc.walking.planner.replanning import plan_from_stance
from wbc.walking.planner.slices import drained
from wbc.walking.run.carrying_out import CarryingOut
from wbc.walking.run.recording import WalkRecorder

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
    # On its way, before it lifts a hand
    while walk.path_time < 0.04:
        walk.tick()
    assert len(walk.held) == 3
    gone = walk.structure.ids[walk.held[0]]
    walk.vanish([gone])
    assert 0 not in walk.held
    finish(walk)
    assert set(walk.held) == {0, 1, 2}


def test_too_few_hands_stop_the_walk(walk: Walk) -> None:
    to_first(walk, "lift", 0.3)
    held = [walk.structure.ids[hold] for hold in walk.held.values()]
    walk.vanish(held[:1])
    before = walk.q.copy()
    with pytest.raises(HoldLost, match="at least 2 must hold"):
        walk.tick()
    # Zero command: nothing moves, and it stays so
    assert not walk.v.any()
    assert walk.pace == 0.0
    with pytest.raises(HoldLost):
        walk.tick()
    assert (walk.q == before).all()


def test_a_walk_that_loses_its_holds_says_so_and_stands(walk: Walk) -> None:
    doing = CarryingOut(walk, WalkRecorder(walk))
    while walk.swinging is None:
        assert doing.step()
    walk.vanish([walk.structure.ids[next(iter(walk.held.values()))]])
    before = walk.q.copy()
    assert not doing.step()
    assert doing.outcome == "hold lost"
    assert "at least 2 must hold" in doing.reason
    assert (walk.q == before).all()


def test_a_hold_that_vanishes_while_a_hand_closes_on_it(walk: Walk) -> None:
    while walk.swinging is None or walk.swinging.state != "closing":
        walk.tick()
    walk.vanish([walk.structure.ids[walk.swinging.hold]])
    assert walk.swinging is None
    finish(walk)


def test_a_hand_that_can_grasp_nothing_says_so(machine: Walker, structure: Structure, stack: WalkStack) -> None:
    plan = plan_walk(machine, structure, grid_path([(13, 9), (13, 13)], 4 * INCH))
    kept = {*plan.start, *(step.target for step in plan.regrasps)}
    few = structure.without([hold for hold in structure.ids if hold not in kept])
    walk = Walk(machine, few, plan_walk(machine, few, plan.path), stack=stack, grasps=lambda arm, _hold: arm != broken)
    broken = walk.plan.regrasps[0].arm
    doing = CarryingOut(walk, WalkRecorder(walk))
    while not walk.done and doing.step():
        assert walk.time < 40.0
    # A hold is tried three times, and taken as vanished; then the arm has none left in reach
    assert doing.outcome == "refused"
    assert broken in doing.reason, doing.reason
    failed = [event.hold for event in walk.events if event.what == "failed"]
    assert len(failed) >= 3
    assert failed == [hold for hold in dict.fromkeys(failed) for _ in range(3)]
    assert not set(failed) & set(walk.structure.ids)


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


def test_what_a_vanished_hold_does_not_change_is_kept(walk: Walk) -> None:
    to_first(walk, "lift", 0.3)
    before, walked = walk.plan, walk.path_time
    walk.vanish([before.regrasps[1].target])
    while walk.path_time < walked + 0.3:
        assert walk.tick().path_time > walked  # the body goes on
    finish(walk)
    assert walk.plan.regrasps[0] == before.regrasps[0]
    assert before.regrasps[1].target not in [event.hold for event in walk.events if event.what == "land"]
    assert [event.what for event in walk.events if event.what in ("vanished", "replanned")] == ["vanished", "replanned"]


def test_holds_that_no_plan_needs_may_vanish(walk: Walk) -> None:
    to_first(walk, "lift")
    rows = walk.plan.rows()
    walk.vanish(["13,1", "20,20"])
    finish(walk)
    assert walk.plan.rows() == rows
    assert "replanned" not in [event.what for event in walk.events]


def test_turning_back_with_a_hand_at_the_edge_of_its_reach(walk: Walk) -> None:
    # One of the hands is too far ahead to be lifted: the body goes towards it first
    while walk.time < 1.0:
        walk.tick()
    start = 9 + 4 * walk.path_time / 9.25
    walk.go(grid_path([(13, start), (13, 8)], 4 * INCH))
    finish(walk)
    assert walk.q[2] == pytest.approx(-8 * 9.25 * INCH, abs=0.002)


def test_a_walk_begins_before_its_plan_is_made(machine: Walker, structure: Structure, stack: WalkStack) -> None:
    path = grid_path([(13, 9), (13, 13)], 4 * INCH)
    whole = plan_walk(machine, structure, path)
    start = dict(zip([arm.name for arm in machine.arms], whole.start, strict=True))
    walk = Walk(machine, structure, plan_from_stance(machine, structure, path, start), stack=stack)
    assert not walk.plan.complete
    assert walk.plan.regrasps == ()
    while not walk.plan.complete:
        walk.tick()
        assert walk.path_time <= walk.walker.margins.head + 1e-9
    assert walk.path_time > 0.0
    finish(walk)
    assert path.duration / (walk.time - 0.5) >= 0.98
    assert len(walk.plan.regrasps) <= len(whole.regrasps)
    again = drained(plan_from_stance(machine, structure, path, start))
    assert again.rows() == walk.plan.rows()


def test_a_plan_in_slices_is_there_before_the_body_has_to_wait(
    machine: Walker, structure: Structure, stack: WalkStack
) -> None:
    """Along +A at 6 in/s, where hands are late from the first lift on: no delay would do, and not just any is taken."""
    path = grid_path([(13, 6), (13, 18)], 6 * INCH)
    whole = plan_walk(machine, structure, path)
    start = dict(zip([arm.name for arm in machine.arms], whole.start, strict=True))
    walk, pace = Walk(machine, structure, plan_from_stance(machine, structure, path, start), stack=stack), 0.0
    while not walk.plan.complete:
        walk.tick()
        assert walk.pace == pytest.approx(min(pace + walk.dt / 0.5, 1.0))
        pace = walk.pace
    assert len(walk.plan.regrasps) == len(whole.regrasps)
    assert walk.plan.delay <= whole.delay + 0.25


def test_slices_find_out_too_that_there_is_no_plan(machine: Walker, structure: Structure, stack: WalkStack) -> None:
    gap = remove_rows(structure, "10-23")
    path = grid_path([(13, 7), (13, 12)], 4 * INCH)
    whole = plan_walk(machine, gap, path, partial=True, objective="destination")
    start = dict(zip([arm.name for arm in machine.arms], whole.start, strict=True))
    with pytest.raises(NoPlanError, match="no hand can be moved in time after"):
        drained(plan_from_stance(machine, gap, path, start, objective="destination"))


def test_a_path_goes_on_where_the_body_stands(walk: Walk) -> None:
    assert isinstance(walk.plan.path, BodyPath)
    finish(walk)
    walk.go(grid_path([(13, 13), (14, 13)], 4 * INCH))
    finish(walk)
    assert walk.plan.path.poses[-1][2, 3] == pytest.approx(-13 * 9.25 * INCH)
