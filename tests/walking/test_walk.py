"""Plans are carried out: the body keeps its pace, hands keep their holds, joints their limits."""

from __future__ import annotations

import pathlib
from collections.abc import Sequence
from itertools import combinations

import numpy as np
import pytest

from wbc.robots import Walker
from wbc.walking import Structure
from wbc.walking.body_path import grid_path
from wbc.walking.checker import check_walk
from wbc.walking.loop.stack import WalkStack
from wbc.walking.loop.walk import Tick, Walk
from wbc.walking.planner.plan import NoPlanError, Plan
from wbc.walking.planner.planner import plan_walk
from wbc.walking.run import PathRequest, Site, perform_walk
from wbc.walking.run.recording import WalkRecorder

INCH = 0.0254
PATHS = {"+A": [(13, 9), (13, 14)], "-T": [(16, 12), (11, 12)]}


def walked(
    machine: Walker, structure: Structure, stack: WalkStack, points: Sequence[tuple[float, float]], speed: float
):
    plan = plan_walk(machine, structure, grid_path(points, speed * INCH))
    walk, ticks = Walk(machine, structure, plan, stack=stack), list[Tick]()
    recorder = WalkRecorder(walk)

    def keep(tick: Tick) -> None:
        ticks.append(tick)
        hand = walk.swinging
        if hand is not None and hand.state == "open":
            # What comes down is not turned off its way: 2.5 mm at most on these, 5.6 mm where it turned all at once
            assert np.linalg.norm(walk.machine.chain.origins[hand.arm] - hand.aim.position) < 0.005
        recorder.tick(tick)

    assert walk.run(keep) == "arrived"
    return plan, walk, ticks, recorder.log()[0]


@pytest.mark.parametrize("name", sorted(PATHS))
def test_four_inches_a_second(
    machine: Walker, structure: Structure, stack: WalkStack, name: str, tmp_path: pathlib.Path
) -> None:
    plan, walk, ticks, log = walked(machine, structure, stack, PATHS[name], 4.0)
    # The checker knows nothing of the planner: clearances of links, surface and body, holds, rates, all of it
    report = check_walk(log, machine.urdf(tmp_path / "robot.urdf"), structure)
    assert report.ok, str(report)
    # A swing takes as long as was planned: what the planner calls feasible the controller can do
    lifts, lands = ([event.time for event in walk.events if event.what == what] for what in ("lift", "land"))
    took = np.array(lands) - np.array(lifts)
    planned = [max(step.duration, step.land - step.lift) for step in plan.regrasps]
    assert took == pytest.approx(planned, abs=0.25)  # a hand waits until it is over its hold
    assert plan.complete
    assert plan.delay == 0.0
    assert len(plan.regrasps) >= 2
    # One of them at least had time to spare
    assert any(law.jerk_limited for law in plan.laws)
    assert plan.path.duration / (walk.time - 0.5) >= 0.97  # ramps at both ends take half a second; a hand may wait
    assert max(tick.body_error for tick in ticks) < 0.002
    assert max(tick.slip for tick in ticks) < 0.001
    assert all(tick.status == "solved" for tick in ticks)
    rates = np.array([tick.v[6:] for tick in ticks])
    assert (np.abs(rates) <= machine.robot.limits.velocity[6:] * (1 + 1e-6)).all()
    q = np.array([tick.q[7:] for tick in ticks])
    limits = machine.robot.limits
    assert (q >= limits.position_lower[6:] - 1e-6).all()
    assert (q <= limits.position_upper[6:] + 1e-6).all()
    for tick in ticks:
        closed = [hold for hold, hand in zip(tick.holds, tick.hands, strict=True) if hand == "closed"]
        assert len(closed) >= machine.min_holds
        assert len(set(tick.holds)) == 3


def test_a_plan_is_the_same_every_time_and_on_a_moved_structure(machine: Walker, structure: Structure) -> None:
    import pinocchio as pin

    path = grid_path(PATHS["+A"], 4 * INCH)
    plan = plan_walk(machine, structure, path)
    again = plan_walk(machine, structure, path)
    pose = pin.SE3(pin.exp3(np.array([0.3, -0.7, 0.2])), np.array([1.0, -2.0, 0.5]))
    moved = plan_walk(machine, structure.moved(pose), path.moved(pose))
    assert plan.rows() == again.rows()
    assert [row["target"] for row in plan.rows()] == [row["target"] for row in moved.rows()]


def test_grips_of_a_plan_are_what_it_says(machine: Walker, structure: Structure) -> None:
    plan = plan_walk(machine, structure, grid_path(PATHS["-T"], 4 * INCH))
    check(plan, machine)


def check(plan: Plan, machine: Walker) -> None:
    """Hands move one by one, are on different holds, and lift before their grip ends."""
    held = dict(zip([arm.name for arm in machine.arms], plan.start, strict=True))
    free = 0.0
    for step in plan.regrasps:
        assert step.lift >= free - 1e-9
        assert step.land > step.lift
        assert step.margin >= 0.0
        assert held[step.arm] == step.source
        held[step.arm], free = step.target, step.land
        assert all(a != b for a, b in combinations(held.values(), 2))


def test_a_budget_ends_the_search_with_what_is_found(machine: Walker, structure: Structure) -> None:
    path = grid_path(PATHS["+A"], 4 * INCH)
    whole, enough = plan_walk(machine, structure, path), plan_walk(machine, structure, path, time_budget=600.0)
    assert enough.rows() == whole.rows()
    none = plan_walk(machine, structure, path, time_budget=0.0, partial=True)
    assert not none.complete
    assert none.reached < path.duration
    assert len(none.regrasps) < len(whole.regrasps)
    with pytest.raises(NoPlanError, match="no hand can be moved in time"):
        plan_walk(machine, structure, path, time_budget=0.0)


def test_a_walk_that_takes_too_long_is_given_up_and_says_so(
    machine: Walker, structure: Structure, stack: WalkStack, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("wbc.walking.loop.walk", "wbc.walking.run.path_mode"):
        monkeypatch.setattr(f"{name}.PATIENCE", 0.0)
        monkeypatch.setattr(f"{name}.SLACK", 0.3)
    walk = Walk(machine, structure, plan_walk(machine, structure, grid_path([(13, 12), (13, 13)], 0.1)), stack=stack)
    assert walk.run() == "late"
    run = perform_walk(PathRequest(Site(rigid=True), "13,12", ("13,13",)), machine, stack=stack)
    assert run.outcome == "late"
    assert "not there after" in run.reason
    assert run.log is not None
