"""Arm mode: one hand moves as it is told, the body stands."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wbc
from wbc.errors import UnknownNameError
from wbc.robots import Walker
from wbc.robots.walker_data import spaced_radius
from wbc.walking import Structure
from wbc.walking.body_path import grid_path
from wbc.walking.checker import Rules, check_walk
from wbc.walking.loop.stack import WalkStack
from wbc.walking.loop.walk import Tick, Walk
from wbc.walking.modes.arm_mode import ArmMode, ArmStopped
from wbc.walking.modes.hand_motion import ArmRefused
from wbc.walking.planner.planner import plan_walk
from wbc.walking.report.folder import rules_of
from wbc.walking.run import ArmRequest, Site, perform_walk
from wbc.walking.run.recording import WalkRecorder
from wbc.walking.run.request import arm_task


@pytest.fixture
def walk(machine: Walker, structure: Structure, stack: WalkStack) -> Walk:
    return Walk(machine, structure, plan_walk(machine, structure, grid_path([(13, 11), (13, 12)], 0.1)), stack=stack)


def test_a_hand_goes_through_poses_to_a_hold_and_the_body_stands(walk: Walk, machine: Walker, tmp_path) -> None:  # type: ignore[no-untyped-def]
    recorder, ticks = WalkRecorder(walk, 0, {}), list[Tick]()

    def on_tick(tick: Tick) -> None:
        ticks.append(tick)
        recorder.tick(tick)

    body, structure = walk.q[:7].copy(), walk.structure
    mode = ArmMode(walk, "arm2", on_tick)
    first, hold = mode.pose, structure.ids[walk.held[1]]
    up = pin.SE3(first.rotation, first.translation - 0.15 * first.rotation[:, 2])
    aside = pin.SE3(up.rotation @ pin.exp3(np.array([0.1, -0.1, 0.3])), up.translation + np.array([0.03, 0.0, 0.05]))
    mode.through([up, aside])
    assert np.abs((mode.pose.inverse() * aside).translation).max() < 0.001
    assert np.abs(pin.log3(mode.pose.rotation.T @ aside.rotation)).max() < 0.002
    mode.by_rate([0.0, 0.0, -0.05, 0.0, 0.0, 0.0], 0.5)
    assert mode.pose.translation - aside.translation == pytest.approx([0.0, 0.0, -0.025], abs=0.001)
    mode.to_hold(hold)
    assert structure.ids[walk.held[1]] == hold
    # At once off again: the log has it closed meanwhile
    mode.through([up])
    mode.to_hold(hold)
    assert max(np.abs(tick.q[:3] - body[:3]).max() for tick in ticks) < 0.002
    assert all(tick.status == "solved" for tick in ticks)
    assert walk.run(on_tick) == "arrived"
    log, _ = recorder.log()
    report = check_walk(log, machine.urdf(tmp_path / "robot.urdf"), structure, Rules(sub_samples=1))
    assert report.ok, str(report)


def test_a_motion_that_is_stopped_goes_no_farther_than_was_said(walk: Walk) -> None:
    asked = iter([*[False] * 40, True])
    mode, body = ArmMode(walk, "arm2", stop=lambda: next(asked)), walk.q[:3].copy()
    first = mode.pose
    up = pin.SE3(first.rotation, first.translation - 0.15 * first.rotation[:, 2])
    with pytest.raises(ArmStopped, match="the motion was stopped"):
        mode.through([up], speed=0.4)
    assert mode.stopped is not None
    far, said = mode.stopped
    assert 0.01 < far[1] <= said[1] <= mode.farthest[1] < 0.2
    assert far[0] <= said[0] <= mode.farthest[0] == 0.002
    assert np.abs(walk.q[:3] - body).max() < 0.002
    assert np.abs(walk.v).max() < 0.01
    assert 1 not in walk.held


def test_a_walk_goes_on_from_a_hold_from_which_few_swings_lead_on(
    machine: Walker, structure: Structure, stack: WalkStack
) -> None:
    walk = Walk(machine, structure, plan_walk(machine, structure, grid_path([(13, 11), (13, 14)], 0.1)), stack=stack)
    ArmMode(walk, "arm2").to_hold("16,11")
    assert walk.run() == "arrived"
    assert walk.plan.regrasps
    assert all(law.possible for law in walk.plan.laws)


def test_refusals_say_why_and_nothing_moves(walk: Walk) -> None:
    mode = ArmMode(walk, "arm1")
    here, q, structure = mode.pose, walk.q.copy(), walk.structure
    far = pin.SE3(here.rotation, here.translation - np.array([0.0, 0.0, 3.0]))
    into = pin.SE3(here.rotation, here.translation + 0.1 * here.rotation[:, 2])
    with pytest.raises(ArmRefused, match=r"poses\[0\]: .*(out of reach|limit)"):
        mode.through([far])
    with pytest.raises(ArmRefused, match=r"too near: arm._link. and the surface"):
        mode.through([into])
    with pytest.raises(ArmRefused, match="another hand holds it"):
        mode.to_hold(structure.ids[walk.held[1]])
    with pytest.raises(UnknownNameError):
        mode.to_hold("99,99")
    with pytest.raises(UnknownNameError):
        ArmMode(walk, "arm9")
    assert (walk.q == q).all()
    assert len(walk.held) == 3
    walk.body.pace = 0.5
    with pytest.raises(ArmRefused, match="the body moves"):
        ArmMode(walk, "arm1")


def test_a_log_ends_at_rest_where_an_arm_was_turning_upright(machine: Walker, tmp_path: Path) -> None:
    """A hand that leans where it stands turns upright meanwhile; its first task is refused at once."""
    six = wbc.robots.walker(6, spaced_radius(6, machine.data.shoulder_radius))
    site = Site("truss", fraction=0.33149961941237777, seed=271)
    tasks = (arm_task("rate 0,0,0.0594,0,0,0 for 1.17"),)
    run = perform_walk(ArmRequest(site, "L3,9", ("L1,16",), arm="arm5", tasks=tasks), six)
    assert run.outcome == "refused"
    assert run.log is not None
    report = check_walk(run.log, six.urdf(tmp_path / "robot.urdf"), run.structure, rules_of(six))
    assert report.ok, str(report)
