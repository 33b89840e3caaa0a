"""The two-ended arm goes end over end along a row of holds: planned, carried out and checked."""

from __future__ import annotations

import pathlib
from dataclasses import replace
from math import radians

import numpy as np
import pinocchio as pin
import pytest

import wbc
from wbc.errors import RangeError, ShapeError, UnknownNameError
from wbc.robots import TwoEndedData, Walker
from wbc.shapes import Box
from wbc.walking import Hold, Obstacle, Structure, cylinder
from wbc.walking.checker import check_walk
from wbc.walking.loop.walk import Walk
from wbc.walking.planner.plan import HoldLost, NoPlanError
from wbc.walking.report.folder import rules_of
from wbc.walking.run.recording import WalkRecorder
from wbc.walking.two_ended import (
    TwoEndedPlan,
    TwoEndedStack,
    TwoEndedWalk,
    grapple_row,
    plan_two_ended,
)
from wbc.walking.two_ended.planner import plan_from_air
from wbc.walking.two_ended.postures import Grip, PairPostures

START = {"arm1": "1", "arm2": "2"}
#: Control period of the walks [s]
DT = 0.025


@pytest.fixture(scope="module")
def quick() -> Walker:
    """Ten times the rates, so that a walk has fewer ticks."""
    return wbc.robots.walker(data=TwoEndedData.read(joint_rate=radians(40.0)), two_ended=True)


@pytest.fixture(scope="module")
def row() -> Structure:
    return grapple_row()


@pytest.fixture(scope="module")
def stack(quick: Walker, row: Structure) -> TwoEndedStack:
    return TwoEndedStack(quick, row, DT, collisions=False)


def swings(plan: TwoEndedPlan) -> list[tuple[str, str, str]]:
    return [(step.arm, step.source, step.target) for step in plan.regrasps]


def order(plan: TwoEndedPlan) -> list[int]:
    """Which hand is ahead in each stance."""
    at = [int(plan.start[0]), int(plan.start[1])]
    out = [int(at[1] > at[0])]
    for step in plan.regrasps:
        at[int(step.arm == "arm2")] = int(step.target)
        out.append(int(at[1] > at[0]))
    return out


@pytest.mark.parametrize(("gait", "wanted"), [("inchworm", [1, 1, 1, 1]), ("turnaround", [1, 0, 1])])
def test_both_gaits_walk(
    quick: Walker, row: Structure, stack: TwoEndedStack, tmp_path: pathlib.Path, gait: str, wanted: list[int]
) -> None:
    plan = plan_two_ended(quick, row, START, "6", gait=gait)
    assert order(plan) == wanted
    walk = TwoEndedWalk(quick, row, plan, stack=stack)
    recorder = WalkRecorder(walk)
    assert walk.run(recorder.tick) == "arrived"
    assert 5 in walk.held.values()
    log, ticks = recorder.log()
    assert ticks.solved.all()
    assert ticks.body_error.max() < 0.002
    # A swing takes what was planned, latch and the ticks of closing included
    lifts, lands = ([event.time for event in walk.events if event.what == what] for what in ("lift", "land"))
    planned = [step.duration for step in plan.regrasps]
    assert np.subtract(lands, lifts) == pytest.approx(planned, abs=0.2)
    # The checker knows nothing of the planner; one hand alone says where the arm is
    # The log has the twist of a tick where it ends; at these rates it changes more within a tick
    rules = replace(rules_of(quick), twist_speed=0.1)
    report = check_walk(log, quick.urdf(tmp_path / "robot.urdf"), row, rules)
    assert report.ok, str(report)
    assert report["hands that hold"].worst == 1


def test_the_fewest_swings_and_the_least_time_whatever_the_gait(quick: Walker, row: Structure) -> None:
    plans = {gait: plan_two_ended(quick, row, START, "6", gait=gait) for gait in ("any", "inchworm", "turnaround")}
    counts = {gait: len(plan.regrasps) for gait, plan in plans.items()}
    assert counts == {"any": 2, "inchworm": 3, "turnaround": 2}
    assert plans["any"].path.duration <= plans["turnaround"].path.duration
    again = plan_two_ended(quick, row, START, "6")
    assert again.rows() == plans["any"].rows()
    # On a structure that was moved the plan is the same
    pose = pin.SE3(pin.exp3(np.array([0.3, -0.7, 0.2])), np.array([1.0, -2.0, 0.5]))
    assert swings(plan_two_ended(quick, row.moved(pose), START, "6")) == swings(plans["any"])


def test_the_elbow_goes_to_a_place(quick: Walker, row: Structure) -> None:
    plan = plan_two_ended(quick, row, START, [14.0, 0.0, 4.0])
    ends = plan.path.poses[[0, -1], :3, 3]
    assert np.linalg.norm(ends[1] - [14.0, 0.0, 4.0]) < np.linalg.norm(ends[0] - [14.0, 0.0, 4.0])
    longer = plan_two_ended(quick, row, START, "6")
    assert len(plan.regrasps) <= len(longer.regrasps)


def test_an_obstacle_changes_the_way(quick: Walker, row: Structure) -> None:
    free = plan_two_ended(quick, row, START, "3")
    assert swings(free) == [("arm2", "2", "3")]
    # A box over the hold that the nearest swing leads to
    box = Obstacle("box", Box((1.0, 1.0, 1.0)), pin.SE3(np.eye(3), np.array([8.0, 0.0, 1.2])))
    blocked = Structure("blocked", row.holds, (box,), row.surface)
    with pytest.raises(NoPlanError, match="no swing leads on from") as refusal:
        plan_two_ended(quick, blocked, START, "3")
    assert refusal.value.separating
    beyond = plan_two_ended(quick, blocked, START, "5")
    assert all(step.target != "3" for step in beyond.regrasps)


def test_holds_that_vanish_are_gone_round(quick: Walker, row: Structure, stack: TwoEndedStack) -> None:
    plan = plan_two_ended(quick, row, START, "6", gait="inchworm")
    lost = plan.regrasps[1].target
    walk = TwoEndedWalk(quick, row, plan, stack=stack)
    while walk.swinging is None:
        walk.tick()
    walk.vanish([lost])
    assert walk.run() == "arrived"
    assert "6" in {walk.structure.ids[hold] for hold in walk.held.values()}
    assert lost not in {event.hold for event in walk.events if event.what == "land"}
    # The only hold of a hand that holds may not vanish
    walk = TwoEndedWalk(quick, row, plan, stack=stack)
    while walk.swinging is None:
        walk.tick()
    walk.vanish([walk.structure.ids[hold] for hold in walk.held.values()])
    with pytest.raises(HoldLost, match="at least 1 must hold"):
        walk.tick()
    assert not walk.v.any()


@pytest.mark.parametrize("clock", [0.0, 0.4, 2.0])
def test_a_hand_in_the_air_goes_to_another_hold(
    quick: Walker, row: Structure, stack: TwoEndedStack, tmp_path: pathlib.Path, clock: float
) -> None:
    plan = plan_two_ended(quick, row, START, "6", gait="inchworm")
    walk = TwoEndedWalk(quick, row, plan, stack=stack)
    recorder, limit = WalkRecorder(walk), walk.walker.robot.limits.acceleration[6:]
    while walk.swinging is None or walk.swinging.state != "open" or walk.swinging.clock < clock:
        recorder.tick(walk.tick())
    lost, before = plan.regrasps[0].target, walk.v[6:].copy()
    walk.vanish([lost])
    # It comes to rest on its way, and does not go on as far as a hold that is not there
    while walk.swinging is not None:
        recorder.tick(walk.tick())
        assert (np.abs(walk.v[6:] - before) < 1.01 * limit * walk.dt).all()
        before = walk.v[6:].copy()
    assert walk.run(recorder.tick) == "arrived"
    landed = [event.hold for event in walk.events if event.what == "land"]
    assert lost not in landed
    assert "6" in {walk.structure.ids[hold] for hold in walk.held.values()}
    assert [step.source for step in walk.progress.steps[:2]] == [plan.regrasps[0].source] * 2
    # At ten times the rates the elbow moves too far in a tick for these
    rules = replace(rules_of(quick), sub_samples=1, twist_speed=0.05, jump_speed=0.1, jump_rate=0.1)
    report = check_walk(recorder.log()[0], quick.urdf(tmp_path / "robot.urdf"), row, rules)
    assert report.ok, str(report)


def test_a_goal_that_vanishes_and_holds_out_of_reach_are_said(
    quick: Walker, row: Structure, stack: TwoEndedStack
) -> None:
    plan = plan_two_ended(quick, row, START, "3")
    walk = TwoEndedWalk(quick, row, plan, stack=stack)
    while walk.swinging is None or walk.swinging.clock < 1.0:
        walk.tick()
    walk.vanish(["3"])
    with pytest.raises(NoPlanError, match="was to come to is gone"):
        walk.run()
    assert np.abs(walk.v).max() < 1e-3
    # Where somebody asks for another goal it goes on
    walk.go_to("4")
    assert walk.run() == "arrived"
    # Of holds that are too far no hand is in reach
    far = Structure("far", (row.holds[1], row.holds[5]), (), row.surface)
    joints = PairPostures(quick, row).between(Grip(0, 0), Grip(1, 0))
    assert joints is not None
    with pytest.raises(NoPlanError, match="it reaches no hold beside 2"):
        plan_from_air(quick, far, (1, Grip(0, 0)), joints, "6")


def test_bad_questions_are_refused(quick: Walker, row: Structure) -> None:
    with pytest.raises(UnknownNameError, match="gait"):
        plan_two_ended(quick, row, START, "6", gait="walk")
    with pytest.raises(UnknownNameError, match="hold"):
        plan_two_ended(quick, row, START, "7")
    with pytest.raises(ShapeError, match="start"):
        plan_two_ended(quick, row, {"arm1": "1"}, "6")
    with pytest.raises(RangeError, match="two hands on one hold"):
        plan_two_ended(quick, row, {"arm1": "1", "arm2": "1"}, "6")
    with pytest.raises(NoPlanError, match="no posture between"):
        plan_two_ended(quick, row, {"arm1": "1", "arm2": "6"}, "6")
    with pytest.raises(NoPlanError, match="no two holds bring the arm's elbow nearer"):
        plan_two_ended(quick, row, START, [1000.0, 0.0, 0.0])
    with pytest.raises(RangeError, match="one hand must fix the arm"):
        plan_two_ended(quick, cylinder(), {"arm1": "1,1", "arm2": "9,9"}, "5,5")
    with pytest.raises(ShapeError, match="two-ended arm"):
        plan_two_ended(wbc.robots.walker(), row, START, "6")
    plan = plan_two_ended(quick, row, START, "3")
    with pytest.raises(ShapeError, match="WalkerData"):
        Walk(quick, row, plan, stack=TwoEndedStack(quick, row, DT, collisions=False, backend="vm"))


def test_a_hand_keeps_the_roll_at_which_it_holds(quick: Walker) -> None:
    row = grapple_row(4)
    turned = Structure("two-fold", tuple(Hold(hold.id, hold.pose, 2) for hold in row.holds), (), row.surface)
    for rolls in ((0, 1), (1, 0), (1, 1)):
        plan = plan_two_ended(quick, turned, START, "4", rolls=rolls)
        assert plan.grips is not None
        assert [int(plan.grips.roll[chain[0]]) for chain in plan.chain] == list(rolls)


def test_holds_with_two_rolls(quick: Walker) -> None:
    row = grapple_row(3)
    turned = Structure("two-fold", tuple(Hold(hold.id, hold.pose, 2) for hold in row.holds), (), row.surface)
    plan, fixed = (plan_two_ended(quick, holds, START, "3") for holds in (turned, row))
    assert plan.path.duration <= fixed.path.duration + 1e-9
    assert len(plan.regrasps) == 1
