"""Bodies on their way turn into other rates while limbs land, and robots that moved come to rest before they go on."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from tests.climb.arriving import arrives
from tests.climb.test_operator import walked
from wbc.climb import BodyPlace, ClimbOptions, ContactPlan, Stance, first_stance, machines, plan_climb, scenes
from wbc.climb.drive import ClimbDrive
from wbc.climb.let_go import joined
from wbc.climb.loop import ClimbLoop, LimbState
from wbc.climb.loop.reference import PlanReference
from wbc.climb.motion import MoveError
from wbc.climb.resume import coming_to_rest, stance_in
from wbc.climb.scene import size_of
from wbc.climb.time_law import MotionSpeeds
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
    arrives(run, plan.climber, plan.scene)
    assert run.log.array("contact")[-1].min() >= 0


def test_a_body_at_rest_goes_as_it_is_told_while_a_limb_lands() -> None:
    plan = walked()
    move = next(move for move in plan.moves if move.land > move.lift + 1.2)
    stance = Stance(
        plan.contacts_at(move.lift), PlanReference(plan, plan.climber.robot).q(0.5 * (move.lift + move.land))
    )
    drive, twist = ClimbDrive(plan.climber), np.array([0.05, 0.0, 0.0, 0.0, 0.0, 0.02])
    drive.command(twist)
    going = drive.following(plan.scene, stance)
    assert [(move.limb, move.lift) for move in going.moves] == [(move.limb, 0.0)]
    assert not going.v[0].any()
    assert not going.v[-1].any()
    assert np.abs(going.v[going.times.searchsorted(0.5), :6] - twist).max() < 1e-9


def test_a_body_that_turns_fast_turns_the_way_it_is_told() -> None:
    """What is planned ahead is more than half a turn."""
    climber = machines.climber("hexapod")
    course = scenes.draw("stepping_stones", size_of(climber), 0, density=1.0)
    drive = ClimbDrive(climber)
    drive.command([0.0, 0.0, 0.0, 0.0, 0.0, -0.6])
    plan = drive.following(course.scene, first_stance(climber, course.scene, scenes.placed(climber, course.start)))
    assert plan.moves
    assert plan.v[:, 5].max() < 1e-9
    assert plan.v[:, 5].min() < -0.5


def test_limbs_land_at_last_no_faster_than_the_body_was_driven(monkeypatch: pytest.MonkeyPatch) -> None:
    plan, asked = walked(), list[MotionSpeeds]()
    drive, move = ClimbDrive(plan.climber), plan.moves[0]

    def refused(*given: Any) -> ContactPlan:
        if isinstance(given[-1], ClimbOptions):
            asked.append(given[-1].motion.speeds)
        raise MoveError("targets[0]", 0.0, "links touch")

    monkeypatch.setattr("wbc.climb.drive.plan_climb", refused)
    monkeypatch.setattr("wbc.climb.drive.plan_limb_work", refused)
    for speed in (0.02, 0.03, 0.025):
        drive.command([speed, 0.0, 0.0, 0.0, 0.0, 0.04])
    drive.finish(ClimbLoop(plan, backend="vm"))
    middle = PlanReference(plan, plan.climber.robot).q(0.5 * (move.lift + move.land))
    assert drive.onward(plan.scene, Stance(plan.contacts_at(move.lift), middle)) is None
    assert {(speeds.speed, speeds.turn_rate) for speeds in asked} == {(0.03, 0.04)}


def test_a_plan_that_does_not_begin_as_the_robot_goes_is_refused() -> None:
    plan = walked()
    loop = ClimbLoop(plan, backend="vm")
    for _ in range(50):
        loop.tick()
    with pytest.raises(RangeError, match="begins within 1e-06 m and rad of the robot"):
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
    arrives(run, climber, scene)
    # Where it stands there is nothing to do
    assert coming_to_rest(log, climber, scene, 0.0) is None
