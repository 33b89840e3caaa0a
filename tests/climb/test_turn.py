"""Bodies on their way turn into other rates while limbs land, and robots that moved come to rest before they go on."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from tests.climb.test_operator import walked
from wbc.climb import BodyPlace, Stance, plan_climb
from wbc.climb.checker import check
from wbc.climb.drive import ClimbDrive
from wbc.climb.let_go import joined
from wbc.climb.loop import ClimbLoop, ClimbOutcome, LimbState
from wbc.climb.loop.reference import PlanReference
from wbc.climb.resume import coming_to_rest, stance_in
from wbc.errors import RangeError


def test_a_body_goes_as_it_is_told_while_a_limb_lands() -> None:
    plan = walked()
    drive = ClimbDrive(plan.climber)
    loop = ClimbLoop(plan, replan=drive.following, onward=drive.onward, backend="vm")
    moves = [move for move in plan.moves if move.land > move.lift + 1.2]
    while loop.path_time < moves[1].lift + 0.3:
        loop.tick()
    aloft = loop.states.index(LimbState.SWINGING)
    told, twist = loop.time, np.array([0.1, 0.0, 0.0, 0.0, 0.0, 0.05])
    drive.steer(twist, loop)
    assert len(loop.result().plans) == 2
    while np.linalg.norm(loop.velocity[:6] - twist) > 0.2 * np.linalg.norm(twist):
        loop.tick()
        assert loop.time < told + 0.7
    assert loop.states[aloft] in (LimbState.SWINGING, LimbState.REACHING)
    # It lands where it was to
    while loop.states[aloft] is not LimbState.HELD:
        loop.tick()
    assert loop.held[aloft] == moves[1].lands
    while not loop.ended:
        drive.finish(loop)
        loop.tick()
        assert loop.time < told + 30.0
    run = loop.result()
    assert run.outcome is ClimbOutcome.ARRIVED, run.reason
    assert run.log.array("contact")[-1].min() >= 0
    report = check(run.log, plan.climber, plan.scene)
    assert report.clean, str(report)


def test_a_body_at_rest_goes_as_it_is_told_while_a_limb_lands() -> None:
    plan = walked()
    move = next(move for move in plan.moves if move.land > move.lift + 1.2)
    held = list(plan.start)
    for before in sorted(plan.moves, key=lambda move: move.lift):
        if before.lift <= move.lift:
            held[before.limb] = before.lands if before.land <= move.lift else -1
    stance = Stance((*held,), PlanReference(plan, plan.climber.robot).q(0.5 * (move.lift + move.land)))
    drive, twist = ClimbDrive(plan.climber), np.array([0.05, 0.0, 0.0, 0.0, 0.0, 0.02])
    drive.command(twist)
    going = drive.following(plan.scene, stance)
    assert [(move.limb, move.lift) for move in going.moves] == [(move.limb, 0.0)]
    assert not going.v[0].any()
    assert not going.v[-1].any()
    assert np.abs(going.v[going.times.searchsorted(0.5), :6] - twist).max() < 1e-9


def test_a_plan_that_does_not_begin_as_the_robot_goes_is_refused() -> None:
    plan = walked()
    loop = ClimbLoop(plan, backend="vm")
    for _ in range(50):
        loop.tick()
    with pytest.raises(RangeError, match="begins where the steady loop is"):
        loop.go_over(plan)


@pytest.mark.parametrize("share", [0.1, 0.35, 0.6])
def test_a_robot_that_moved_comes_to_rest_and_goes_on(share: float) -> None:
    plan = walked()
    climber, scene = plan.climber, plan.scene
    log = ClimbLoop(plan, backend="vm").run().log
    at = share * float(log["t"][-1])
    rest = coming_to_rest(log, climber, scene, at)
    assert rest is not None
    row = int(np.searchsorted(log["t"], at + 1e-9, side="right")) - 1
    np.testing.assert_allclose(rest.v[0], log.array("v")[row])
    assert not rest.v[-1].any()
    stance = dataclasses.replace(stance_in(log, climber, scene, at), q=rest.q[-1])
    goal = BodyPlace(climber.body_pose(stance.q).translation + [0.0, 0.0, -0.1])
    run = ClimbLoop(joined(rest, plan_climb(climber, scene, stance, goal)), backend="vm").run()
    assert run.outcome is ClimbOutcome.ARRIVED, run.reason
    report = check(run.log, climber, scene)
    assert report.clean, str(report)
    # Where it stands there is nothing to do
    assert coming_to_rest(log, climber, scene, 0.0) is None
