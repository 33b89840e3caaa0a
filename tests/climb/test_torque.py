"""Climbing under torques in MuJoCo: feet and grips, with less friction, other masses and delay than planned."""

from __future__ import annotations

import dataclasses

import numpy as np
import pinocchio as pin
import pytest

from bench.climb.torques import UNKNOWN, carried_out, planned
from tests.climb.arriving import arrives
from tests.climb.by_hand import TRIPODS, climber, gait
from tests.repeats import ALL, MORE, repeats
from wbc.climb import ClimbOptions, ContactPlan, Equilibrium, first_stance, scenes
from wbc.climb.checker import CheckRules, check
from wbc.climb.drive import standing_plan
from wbc.climb.loop import ClimbLoop, ClimbOutcome, PlanReference
from wbc.climb.plants import CONTACT_TIME, ClimbPlant, PlantErrors
from wbc.climb.scene import size_of
from wbc.validation import Array

#: Climbers, what they climb, and the part of it that does for a short test
COURSES = (
    ("anymal_c", "stepping_stones", 0.07),
    ("hexapod", "stepping_stones", 0.07),
    ("wall_climber", "wall", 0.2),
)


def _least_with_motors(plan: ContactPlan, effort: float) -> float:
    """The least margin with a share of the motors' efforts, at rest, as limbs lift, half-way and as they land."""
    balance, reference = Equilibrium(plan.climber, plan.scene), PlanReference(plan, plan.climber.robot)
    margins, moves = [], sorted(plan.moves, key=lambda move: move.lift)
    for move in moves:
        held = plan.contacts_at(move.lift)
        for time in np.linspace(move.lift, move.land, 3):
            margins.append(balance.margin(held, reference.q(time), motors=True, effort=effort))
    return min(margins)


@pytest.mark.parametrize("seed", range(2))
def test_a_hexapod_walks_in_tripods(seed: int) -> None:
    plan = gait(TRIPODS, swing=0.5, rest=0.15)
    run, of_cone = carried_out(plan, PlantErrors(**UNKNOWN, seed=seed))
    arrives(run, plan.climber, plan.scene, CheckRules.by_torques())
    assert run.log["kept"].all()
    # What slips is at the cone of the friction that there is
    assert of_cone < 1.0
    weight = plan.climber.mass * 9.81
    pressed = sum(run.log[f"wrench.limb{k}.fz"] for k in range(1, 7))
    assert abs(pressed[-1] - weight) < 0.02 * weight


@pytest.mark.parametrize(
    ("name", "scene", "part", "seed"), [(*course, k) for course in COURSES for k in range(repeats(1))]
)
def test_courses_are_walked(name: str, scene: str, part: float, seed: int) -> None:
    """A fifth of the stones and holds is missing."""
    plan = planned(name, scene, seed, part if MORE < ALL else 1.0)
    assert plan.moves
    assert _least_with_motors(plan, 0.75) > 0.0
    run, of_cone = carried_out(plan, PlantErrors(**UNKNOWN, seed=seed))
    arrives(run, plan.climber, plan.scene, CheckRules.by_torques())
    assert of_cone < 1.0 + 1e-6


def test_grips_hang_and_go_on() -> None:
    machine = climber("wall_climber")
    plan = gait([(0,), (3,)], 0.02, machine=machine)
    scene = dataclasses.replace(plan.scene, gravity=np.array([0.0, 0.0, 9.81]))
    plan = dataclasses.replace(plan, scene=scene)
    run, _ = carried_out(plan, PlantErrors(delay=0.002, mass=0.05))
    arrives(run, machine, scene, CheckRules.by_torques())
    pulled = sum(run.log[f"wrench.{limb.name}.fz"][-1] for limb in machine.limbs)
    assert abs(pulled + machine.mass * 9.81) < 0.02 * machine.mass * 9.81


def test_feet_land_before_they_bear_their_load() -> None:
    """Of other masses than thought a foot that has closed would stay above the surface; its load would throw it there,
    and aside.
    """
    plan = gait(TRIPODS, swing=0.5, rest=0.15)
    run, _ = carried_out(plan, PlantErrors(**UNKNOWN, seed=0))
    held, model = run.log.array("contact"), plan.climber.robot.model
    data = model.createData()
    for limb, own in enumerate(plan.climber.limbs):
        closes = np.flatnonzero((held[1:, limb] >= 0) & (held[:-1, limb] < 0))
        assert len(closes) == 1
        frame, places = model.getFrameId(own.frame), list[Array]()
        for q in run.log.array("q")[closes[0] + 1 : closes[0] + 101]:
            pin.framesForwardKinematics(model, data, q)
            places.append(data.oMf[frame].act(own.placement.translation)[:2])
        # While it comes down and takes its load within 0.2 s
        assert np.ptp(places, axis=0).max() < 6e-4


def test_a_humanoid_stands_firm_on_stairs() -> None:
    """On its first steps no sole tilts, slips or turns about an edge, and the motors are never at their limits for
    long: plans leave the loop a part of the soles that it follows with.
    """
    plan = planned("talos_hand", "rail", 0, 1.0)
    run = ClimbLoop(plan, ClimbPlant(plan.climber, plan.scene)).run(most=9.5)
    assert run.outcome is ClimbOutcome.OUT_OF_TIME
    report = check(run.log, plan.climber, run.scene, CheckRules.by_torques())
    assert not report.violations
    assert len({row for row in run.log.array("contact")[:, :2].ravel() if row >= 0}) > 3


def test_loads_are_shared_by_what_contacts_bear() -> None:
    """A hand of 60 N beside the feet of a humanoid bears little of its 886 N, and its wrist is far from its limits."""
    machine = climber("talos_hand")
    course = scenes.draw("rail", size_of(machine), 0)
    q, options = scenes.placed(machine, course.start), ClimbOptions.by_torques()
    plan = standing_plan(machine, course.scene, first_stance(machine, course.scene, q, options.stances))
    plant = ClimbPlant(machine, course.scene)
    loop = ClimbLoop(plan, plant)
    while loop.time < 0.2:
        loop.tick()
    # MuJoCo takes the mean of the time constants of what touches
    assert plant.data.ncon >= 4
    assert {float(plant.data.contact[k].solref[0]) for k in range(plant.data.ncon)} == {CONTACT_TIME}
    assert loop.step is not None
    hand = loop.step.forces["right_hand contact"]
    assert np.linalg.norm(hand[:3]) < 0.4 * 60.0
    limits = loop.robot.limits.effort
    arm = [k for k, name in enumerate(loop.robot.dof_names) if name.startswith("arm_right")]
    assert np.abs(loop.step.torque[arm] / limits[arm]).max() < 0.8
