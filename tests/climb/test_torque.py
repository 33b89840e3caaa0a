"""Climbing under torques in MuJoCo: feet and grips, with less friction, other masses and delay than planned."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from tests.climb.by_hand import TRIPODS, climber, gait
from wbc.climb import ContactPlan
from wbc.climb.checker import CheckRules, check
from wbc.climb.loop import ClimbLoop, ClimbOutcome, ClimbRun, LoopOptions
from wbc.climb.plants import ClimbPlant, PlantErrors


def _carried_out(plan: ContactPlan, errors: PlantErrors) -> tuple[ClimbRun, float]:
    """The run, and the largest ratio of friction to normal force by MuJoCo's contacts of feet that press with 5 N."""
    plant = ClimbPlant(plan.climber, plan.scene, errors)
    loop, ratio = ClimbLoop(plan, plant, options=LoopOptions(delay=errors.delay)), 0.0
    while not loop.ended and loop.time < 10.0:
        loop.tick()
        forces = plant.contact_forces()
        pressing = forces[:, 0] > 5.0
        if pressing.any():
            ratio = max(ratio, float((forces[pressing, 1] / forces[pressing, 0]).max()))
    return loop.result(), ratio


@pytest.mark.parametrize("seed", range(2))
def test_a_hexapod_walks_in_tripods(seed: int) -> None:
    plan = gait(TRIPODS, swing=0.5, rest=0.15)
    run, ratio = _carried_out(plan, PlantErrors(0.8, 0.05, 0.005, seed))
    assert run.outcome is ClimbOutcome.ARRIVED, run.reason
    assert run.log["kept"].all()
    report = check(run.log, plan.climber, plan.scene, CheckRules.by_torques())
    assert report.clean, str(report)
    # What slips is at the cone of the friction that there is
    assert ratio < 0.8 * 0.6
    weight = plan.climber.mass * 9.81
    pressed = sum(run.log[f"wrench.limb{k}.fz"] for k in range(1, 7))
    assert abs(pressed[-1] - weight) < 0.02 * weight


def test_grips_hang_and_go_on() -> None:
    machine = climber("wall_climber")
    plan = gait([(0,), (3,)], 0.02, machine=machine)
    scene = dataclasses.replace(plan.scene, gravity=np.array([0.0, 0.0, 9.81]))
    plan = dataclasses.replace(plan, scene=scene)
    run, _ = _carried_out(plan, PlantErrors(delay=0.002, mass=0.05))
    assert run.outcome is ClimbOutcome.ARRIVED, run.reason
    report = check(run.log, machine, scene, CheckRules.by_torques())
    assert report.clean, str(report)
    pulled = sum(run.log[f"wrench.{limb.name}.fz"][-1] for limb in machine.limbs)
    assert abs(pulled + machine.mass * 9.81) < 0.02 * machine.mass * 9.81
