"""Climbing under torques in MuJoCo: feet and grips, with less friction, other masses and delay than planned."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from tests.climb.arriving import arrives
from tests.climb.by_hand import TRIPODS, climber, gait
from tests.repeats import ALL, MORE, repeats
from wbc.climb import BodyPlace, ClimbOptions, ContactPlan, Equilibrium, first_stance, plan_climb, scenes
from wbc.climb.checker import CheckRules
from wbc.climb.loop import ClimbLoop, ClimbRun, LimbState, LoopOptions, PlanReference
from wbc.climb.plants import ClimbPlant, PlantErrors
from wbc.climb.scene import size_of

#: What plan and loop do not know: friction, masses, delay [s]
UNKNOWN = {"friction": 0.8, "mass": 0.05, "delay": 0.005}
#: Climbers, what they climb, and the part of it that does for a short test
COURSES = (
    ("anymal_c", "stepping_stones", 0.12),
    ("hexapod", "stepping_stones", 0.12),
    ("wall_climber", "wall", 0.3),
)


def _carried_out(plan: ContactPlan, errors: PlantErrors, most: float = 10.0) -> tuple[ClimbRun, float]:
    """The run, and the largest ratio of friction to normal force by MuJoCo's contacts of feet that press with 5 N."""
    plant = ClimbPlant(plan.climber, plan.scene, errors)
    loop, ratio = ClimbLoop(plan, plant, options=LoopOptions(delay=errors.delay)), 0.0
    while not loop.ended and loop.time < most:
        loop.tick()
        for move in loop.coming:
            # What comes after a landing counts on it
            landing = loop.states[move.limb] in (LimbState.REACHING, LimbState.LATCHING)
            assert not landing or loop.path_time <= move.land + 1e-9
        forces = plant.contact_forces()
        pressing = forces[:, 0] > 5.0
        if pressing.any():
            ratio = max(ratio, float((forces[pressing, 1] / forces[pressing, 0]).max()))
    return loop.result(), ratio


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
    run, ratio = _carried_out(plan, PlantErrors(0.8, 0.05, 0.005, seed))
    arrives(run, plan.climber, plan.scene, CheckRules.by_torques())
    assert run.log["kept"].all()
    # What slips is at the cone of the friction that there is
    assert ratio < 0.8 * 0.6
    weight = plan.climber.mass * 9.81
    pressed = sum(run.log[f"wrench.limb{k}.fz"] for k in range(1, 7))
    assert abs(pressed[-1] - weight) < 0.02 * weight


@pytest.mark.parametrize(
    ("name", "scene", "part", "seed"), [(*course, k) for course in COURSES for k in range(repeats(1))]
)
def test_courses_are_walked(name: str, scene: str, part: float, seed: int) -> None:
    """A fifth of the stones and holds is missing."""
    robot = climber(name)
    course = scenes.draw(scene, size_of(robot), seed, density=0.8)
    q, end = (scenes.placed(robot, frame) for frame in (course.start, course.goal))
    first, last = (robot.body_pose(posture).translation for posture in (q, end))
    options = ClimbOptions.by_torques()
    start = first_stance(robot, course.scene, q, options.stances)
    goal = first + (part if MORE < ALL else 1.0) * (last - first)
    plan = plan_climb(robot, course.scene, start, BodyPlace(goal), options)
    assert plan.moves
    assert _least_with_motors(plan, 0.75) > 0.0
    run, ratio = _carried_out(plan, PlantErrors(**UNKNOWN, seed=seed), 2.0 * plan.times[-1] + 10.0)
    arrives(run, robot, course.scene, CheckRules.by_torques())
    assert ratio < 0.8 * 0.6 + 1e-6


def test_grips_hang_and_go_on() -> None:
    machine = climber("wall_climber")
    plan = gait([(0,), (3,)], 0.02, machine=machine)
    scene = dataclasses.replace(plan.scene, gravity=np.array([0.0, 0.0, 9.81]))
    plan = dataclasses.replace(plan, scene=scene)
    run, _ = _carried_out(plan, PlantErrors(delay=0.002, mass=0.05))
    arrives(run, machine, scene, CheckRules.by_torques())
    pulled = sum(run.log[f"wrench.{limb.name}.fz"][-1] for limb in machine.limbs)
    assert abs(pulled + machine.mass * 9.81) < 0.02 * machine.mass * 9.81
