"""Plants of torques that grip, and what goes wrong with them: slips, limp motors, holds that break off, delays."""

from __future__ import annotations

import dataclasses
import functools
import re

import numpy as np
import pytest

from tests.climb.by_hand import climber, gait
from tests.climb.walkers import over
from tests.refusals import assert_refused
from wbc.climb import BodyPlace, ClimbOptions, ContactMove, ContactPlan, machines, plan_climb
from wbc.climb.along import AlongOptions, BodyTrack, plan_along
from wbc.climb.checker import CheckRules, check
from wbc.climb.faults import PlantFault
from wbc.climb.grids import cylinder_grid
from wbc.climb.loop import ClimbLoop, ClimbOutcome, ClimbRun
from wbc.climb.loop.hand_over import HandOvers
from wbc.climb.loop.reference import PlanReference
from wbc.climb.plants import PlantErrors, climb_plant
from wbc.errors import RangeError, ShapeError, UnknownNameError, WbcError

PLANTS = ("pinocchio", "mujoco")


@functools.cache
def steps() -> ContactPlan:
    """Two limbs of a climber that grips step on, one after the other."""
    return gait([(0,), (3,)], 0.02, machine=climber("wall_climber"))


def carried_out(plant: str, plan: ContactPlan, *faults: str, errors: PlantErrors | None = None) -> ClimbRun:
    made = climb_plant(plant, plan.climber, plan.scene, errors, [PlantFault.read(text) for text in faults])
    assert made is not None
    return ClimbLoop(plan, made, delay=made.errors.delay).run(2.0 * float(plan.times[-1]))


def broken(run: ClimbRun, plan: ContactPlan) -> list[str]:
    report = check(run.log, plan.climber, run.scene, CheckRules.by_torques())
    return [finding.rule for finding in report.violations]


def test_texts_of_faults() -> None:
    assert PlantFault.read("slip arm2 0.005 at 4") == PlantFault("slip", "arm2", 0.005, 4.0)
    assert PlantFault.read("limp arm3_joint2 at 2.5") == PlantFault("limp", "arm3_joint2", 0.0, 2.5)
    assert PlantFault.read("break arm1 at 0") == PlantFault("break", "arm1", 0.0, 0.0)
    assert PlantFault.read("delay 0.02") == PlantFault("delay", "", 0.02)


@pytest.mark.parametrize(
    ("text", "error"),
    [("slip arm2 at 4", ShapeError), ("limp arm3_joint2 0.1 at 2", ShapeError), ("break arm1 4", ShapeError),
     ("break arm1 in 4", ShapeError), ("delay", ShapeError), ("delay x", ShapeError), ("delay -1", RangeError),
     ("break arm1 at nan", WbcError), ("burn arm1 at 2", UnknownNameError), ("", UnknownNameError)],
)  # fmt: skip
def test_texts_that_are_no_faults(text: str, error: type[WbcError]) -> None:
    with pytest.raises(error):
        PlantFault.read(text)


@pytest.mark.parametrize(
    ("plant", "name", "texts", "error", "word"),
    [("pinochio", "wall_climber", (), UnknownNameError, "pinocchio"),
     ("kinematic", "wall_climber", ("delay 0.02",), RangeError, "kinematic"),
     ("mujoco", "wall_climber", ("delay 0.02", "delay 0.01"), RangeError, "one delay"),
     ("pinocchio", "hexapod", (), RangeError, "mujoco"),
     ("pinocchio", "wall_climber", ("break limb9 at 1",), UnknownNameError, "limb1"),
     ("mujoco", "wall_climber", ("limp limb1_joint9 at 1",), UnknownNameError, "limb1_joint"),
     ("mujoco", "hexapod", ("slip limb1 0.01 at 1",), RangeError, "grips nothing")],
)  # fmt: skip
def test_plants_that_cannot_be(plant: str, name: str, texts: tuple[str, ...], error: type[WbcError], word: str) -> None:
    faults = [PlantFault.read(text) for text in texts]
    assert_refused(lambda: climb_plant(plant, climber(name), steps().scene, None, faults), error, word)


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize(
    ("fault", "reason"),
    [("", ""), ("delay 0.01", ""),
     ("slip limb2 0.005 at 0.3", "limb2 has slipped by 1."),
     ("limp limb2_joint2 at 0.3", "limb2_joint2 gets 0% of the torque asked of it: its motor is limp, or"),
     ("limp limb1_joint2 at 0.3", "limb1_joint2 has been beyond its limits for 0.1 s: its motor is limp, or"),
     ("break limb2 at 0.5", "the foothold p1 of limb2 broke off, and what is left does not keep the body")],
)  # fmt: skip
def test_what_fails_is_named_and_ends_the_run(plant: str, fault: str, reason: str) -> None:
    plan = steps()
    run = carried_out(plant, plan, *([fault] if fault else []))
    assert run.outcome is (ClimbOutcome.PLANT_FAILED if reason else ClimbOutcome.ARRIVED), run.reason
    assert run.reason.startswith(reason)
    assert [text.startswith(reason) for _, text in run.noted] == [True] * bool(reason)
    if not reason:
        assert broken(run, plan) == []
    elif fault.startswith("slip"):
        assert broken(run, plan) == ["closed grip slips"]
    if reason:
        assert run.noted[0][0] < float(fault.split()[-1]) + 0.2


def test_limbs_that_hold_plan_on_without_what_broke_off() -> None:
    run = carried_out("pinocchio", steps(), "break limb2 at 0.05")
    assert run.outcome is ClimbOutcome.STOPPED
    assert run.reason == "the foothold p1 of limb2 is gone, and no planner was given"
    assert run.log["contact.limb2"][-1] == -1
    assert broken(run, steps()) == []


def test_a_limb_that_fails_as_it_comes_to_its_foothold_does_not_hold() -> None:
    plan = steps()
    loop = ClimbLoop(plan, climb_plant("pinocchio", plan.climber, plan.scene))
    while loop.path_time < plan.moves[0].land - 0.03:
        loop.tick()
    loop.fail("limb1")
    run = loop.run(10.0)
    assert run.reason == "limb1 holds no more, and no planner was given"
    assert run.log["contact.limb1"][-1] == -1


@functools.cache
def walk(gravity: float) -> ContactPlan:
    """The published walker goes on along its cylinder, gravity towards the holds."""
    options = ClimbOptions.by_torques()
    scene = dataclasses.replace(cylinder_grid(), gravity=np.array([0.0, -gravity, 0.0]))
    way = BodyTrack([over(13.0, a) for a in (9.0, 10.0, 11.0)], 0.1016)
    given = AlongOptions(options.motion, options.stances.margin)
    return plan_along(machines.climber("walker"), scene, way, None, given)


@pytest.mark.parametrize(("plant", "gravity"), [("pinocchio", 1.62), ("mujoco", 0.0)])
def test_the_walker_walks_without_weight_and_on_the_moon(plant: str, gravity: float) -> None:
    run = carried_out(plant, walk(gravity))
    assert run.outcome is ClimbOutcome.ARRIVED, run.reason
    assert run.log["kept"].all()
    assert broken(run, walk(gravity)) == []


def test_a_payload_and_friction_that_nobody_knows_are_borne() -> None:
    """20 kg on the body and 2 N m in every joint, in 1 m/s^2."""
    errors = PlantErrors(payload=20.0, rubbing=2.0, mass=0.05, delay=0.004)
    run = carried_out("pinocchio", walk(1.0), errors=errors)
    assert run.outcome is ClimbOutcome.ARRIVED, run.reason
    assert broken(run, walk(1.0)) == []


def test_a_load_that_is_too_much_ends_the_run() -> None:
    run = carried_out("pinocchio", walk(1.62), errors=PlantErrors(payload=400.0))
    assert run.outcome is ClimbOutcome.PLANT_FAILED, run.reason
    assert re.search("given way for 0.1 s|a load that nobody knows", run.reason), run.reason


def test_the_walker_goes_on_without_a_hold_that_broke_off() -> None:
    plan, options = walk(0.0), ClimbOptions.by_torques()
    plant = climb_plant("pinocchio", plan.climber, plan.scene, None, [PlantFault.read("break arm1 at 0.5")])
    goal = BodyPlace(plan.climber.body_pose(plan.q[-1]).translation)
    loop = ClimbLoop(plan, plant, replan=lambda scene, at: plan_climb(plan.climber, scene, at, goal, options))
    run = loop.run(60.0)
    assert run.outcome is ClimbOutcome.ARRIVED, run.reason
    held = plan.scene.footholds[plan.start[0]].id
    assert [text for _, text in run.noted] == [f"the foothold {held} of arm1 broke off"]
    assert held not in [foothold.id for foothold in run.plans[-1].scene.footholds]
    assert broken(run, plan) == []


def test_loads_are_handed_over_before_the_next_lift() -> None:
    """Of 0.176 s between a landing and a lift the plan has 0.05: its rate there is what makes them that long, it comes
    down to it within 0.2 s, and only where the robot moves.
    """
    plan = steps()
    times, q = np.array([0.0, 1.0, 2.0, 3.0]), np.array([plan.q[0]] * 4)
    q[:, 0] += 0.1 * times
    moves = [ContactMove(0, 0, 1, 0.2, 1.0), ContactMove(1, 1, 2, 1.05, 2.0)]
    for moving, slow in ((True, 0.05 / 0.176), (False, 1.0)):
        v = np.zeros((4, plan.climber.robot.nv))
        v[:, 0] = 0.1
        some = dataclasses.replace(plan, times=times, q=q if moving else q[:1].repeat(4, 0), v=v * moving)
        overs = HandOvers(moves, PlanReference(some, plan.climber.robot), 0.08)
        rates = [overs.rate(at) for at in np.arange(0.0, 2.0, 0.01)]
        assert min(rates) == pytest.approx(slow)
        assert rates[102] == pytest.approx(slow)
        assert rates[79] == rates[126] == 1.0
        squares = np.square(rates)
        assert np.abs(np.diff(squares)).max() <= 2.0 * 0.01 / 0.2 + 1e-9 or not moving
