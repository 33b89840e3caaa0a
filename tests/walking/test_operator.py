"""What an operator may do on the way: abort, and say no to a hold."""

from __future__ import annotations

import pathlib

import numpy as np
import pytest

from wbc.errors import UnknownNameError
from wbc.robots import Walker
from wbc.walking import Structure
from wbc.walking.body_path import grid_path
from wbc.walking.checker import Rules, check_walk
from wbc.walking.loop.stack import WalkStack
from wbc.walking.loop.walk import Walk
from wbc.walking.modes.veto import HoldRefusedError, Veto
from wbc.walking.planner.plan import Plan
from wbc.walking.planner.planner import plan_walk
from wbc.walking.run.recording import WalkRecorder

INCH = 0.0254


@pytest.fixture(scope="module")
def plan(machine: Walker, structure: Structure) -> Plan:
    return plan_walk(machine, structure, grid_path([(13, 9), (13, 13)], 4 * INCH))


def test_nothing_goes_farther_after_an_abort_than_was_said(
    machine: Walker, structure: Structure, stack: WalkStack, plan: Plan, tmp_path: pathlib.Path
) -> None:
    walk, rng = Walk(machine, structure, plan, stack=stack), np.random.default_rng(5)
    recorder = WalkRecorder(walk)
    most, swung = walk.leader.stops.longest(plan), 0
    for _ in range(12):
        for _ in range(int(rng.integers(20, 90))):
            if not walk.done:
                recorder.tick(walk.tick())
        bounds, arm = walk.stopping(), walk.swinging and walk.swinging.arm
        body, hands = walk.q[:3].copy(), walk.machine.chain.origins.copy()
        walk.abort()
        for _ in range(50):
            recorder.tick(walk.tick())
            assert np.linalg.norm(walk.q[:3] - body) <= bounds[0] <= most[0]
            if arm is not None:
                assert np.linalg.norm(walk.machine.chain.origins[arm] - hands[arm]) <= bounds[1] <= most[1]
        swung += arm is not None and np.linalg.norm(walk.machine.chain.origins[arm] - hands[arm]) > 0.01
        assert walk.still
        assert np.abs(walk.v).max() < 0.02
        walk.carry_on()
    assert swung >= 3
    while not walk.done:
        recorder.tick(walk.tick())
    report = check_walk(recorder.log()[0], machine.urdf(tmp_path / "robot.urdf"), structure, Rules(sub_samples=1))
    assert report.ok, str(report)


def test_a_body_waits_for_the_answer(
    machine: Walker, structure: Structure, stack: WalkStack, plan: Plan, tmp_path: pathlib.Path
) -> None:
    walk = Walk(machine, structure, plan, stack=stack)
    recorder = WalkRecorder(walk)
    veto, first = Veto(walk), plan.regrasps[0]
    for _ in range(round((first.lift + 1.0) / walk.dt)):
        recorder.tick(walk.tick())
    assert veto.proposal == first
    assert walk.pace == 0.0
    assert walk.path_time == pytest.approx(first.lift, abs=0.06)
    held = {arm: structure.ids[hold] for arm, hold in walk.held.items()}
    with pytest.raises(HoldRefusedError, match="a hand holds it"):
        veto.choose(held[0])
    with pytest.raises(HoldRefusedError, match="cannot hold it anywhere on the path"):
        veto.choose("1,1")
    with pytest.raises(UnknownNameError):
        veto.choose("1,100")
    assert walk.plan is plan
    grips, row = plan.grips, [arm.name for arm in machine.arms].index(first.arm)
    assert grips is not None
    there = structure.positions[structure.index(first.target)]
    rows = np.unique(grips.hold[grips.of_arm(row)])
    order = rows[np.argsort(np.linalg.norm(structure.positions[rows] - there, axis=1), kind="stable")]
    near = [structure.ids[hold] for hold in order[1:8] if structure.ids[hold] not in held.values()]
    for name in near:
        try:
            chosen = veto.choose(name)
        except HoldRefusedError:
            continue
        break
    assert (chosen.arm, chosen.target) == (first.arm, name)
    while not walk.done:
        veto.accept()
        recorder.tick(walk.tick())
        assert walk.time < 40.0
    assert walk.progress.steps[0].target == name
    assert veto.proposal is None
    with pytest.raises(HoldRefusedError, match="no re-grasp is proposed"):
        veto.choose("13,13")
    report = check_walk(recorder.log()[0], machine.urdf(tmp_path / "robot.urdf"), structure, Rules(sub_samples=1))
    assert report.ok, str(report)
