"""What contacts and motors bear at rest: what lacks, and plans that are refused for it."""

from __future__ import annotations

import dataclasses

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import linprog

from tests.climb.by_hand import climber, gait
from wbc.climb import BodyPlace, ClimbOptions, Equilibrium, NoStancesError, Stance, StanceOptions, machines, plan_climb
from wbc.climb.bearing import EFFORT_SHARE, check_borne
from wbc.climb.grids import cylinder_grid
from wbc.climb.loop import ClimbLoop
from wbc.climb.plants import climb_plant
from wbc.errors import RangeError
from wbc.robots import hold_rating
from wbc.validation import Array

#: Gravity of the tests [m/s^2]
MOON = np.array([0.0, -1.62, 0.0])


def most_gravity(q: Array, hands: tuple[str, ...]) -> float:
    """The part of its gravity that the walker bears, by a linear program over Pinocchio's rows."""
    robot, rating = machines.climber("walker").robot, hold_rating()
    model = robot.model.copy()
    model.gravity.linear = MOON
    data = model.createData()
    weight = pin.computeGeneralizedGravity(model, data, q)
    rows = [pin.computeFrameJacobian(model, data, q, model.getFrameId(hand))[:5] for hand in hands]
    push, torque = np.vstack(rows).T, EFFORT_SHARE * robot.limits.effort[6:]
    inside = np.hstack([-push[6:], weight[6:, None]])
    box = np.array([rating.force] * 3 + [rating.torque] * 2)
    answer = linprog(
        np.append(np.zeros(push.shape[1]), -1.0),
        A_ub=np.vstack([inside, -inside]),
        b_ub=np.tile(torque, 2),
        A_eq=np.hstack([push[:6], -weight[:6, None]]),
        b_eq=np.zeros(6),
        bounds=[(-most, most) for most in np.tile(box, len(hands))] + [(0.0, None)],
    )
    return float(answer.x[-1])


@pytest.mark.parametrize("seed", range(12))
def test_what_it_bears_is_what_a_linear_program_says(seed: int) -> None:
    """Hands hold where they are; what lacks is nothing if the gravity that is borne is that of the scene or more."""
    random, machine = np.random.default_rng(seed), machines.climber("walker")
    q, count = np.array(machine.rest), 2 + seed % 2
    q[7:] += random.uniform(-0.5, 0.5, machine.robot.nq - 7)
    q[3:7] = pin.Quaternion(pin.exp3(random.uniform(-1.0, 1.0, 3))).coeffs()
    scene = cylinder_grid()
    places = [
        dataclasses.replace(scene.footholds[k], id=f"h{k}", pose=machine.contact_pose(q, k), on="") for k in (0, 1, 2)
    ]
    scene = dataclasses.replace(scene, footholds=places, bodies={}, gravity=MOON)
    held = [k if k < count else -1 for k in range(3)]
    share = most_gravity(q, tuple(limb.frame for limb in machine.limbs[:count]))
    lacks = Equilibrium(machine, scene).lacking(held, q, EFFORT_SHARE)
    assert (not lacks) == (share >= 1.0)
    assert all(amount > 0.0 for _, amount in lacks)


def test_a_robot_too_heavy_for_its_motors_or_without_masses_is_refused_in_numbers() -> None:
    machine = climber("wall_climber")
    plan = gait([(0,), (3,)], 0.02, machine=machine)
    start, goal = Stance(plan.start, plan.q[0]), BodyPlace(plan.q[-1][:3])
    options = ClimbOptions(StanceOptions(effort=0.75))
    assert Equilibrium(machine, plan.scene).lacking(plan.start, plan.q[0], 1.0) == []
    weak = dataclasses.replace(machine, robot=machine.robot.with_limits(effort=0.05))
    words = r"9\.81 m/s\^2 it cannot stand on limb1.* % of its weight are lacking, by all that its motors give"
    with pytest.raises(NoStancesError, match=words) as why:
        plan_climb(weak, plan.scene, start, goal, options)
    assert why.value.cause == "start"
    model = machine.robot.model.copy()
    for k in range(1, model.njoints):
        model.inertias[k] = pin.Inertia.Zero()
    bare = dataclasses.replace(machine, robot=dataclasses.replace(machine.robot, model=model))
    assert bare.center_of_mass(plan.q[0]) == pytest.approx(bare.body_pose(plan.q[0]).translation)
    with pytest.raises(RangeError, match="has no masses"):
        plan_climb(bare, plan.scene, start, goal, options)


def test_a_plan_that_motors_do_not_bear_says_when_and_what_lacks() -> None:
    plan = gait([(0,), (3,)], 0.02, machine=climber("wall_climber"))
    check_borne(plan)
    with pytest.raises(RangeError, match=r"9\.81 m/s\^2 it cannot stand on limb\d.* N m of limb\d_joint\d.*lacking"):
        check_borne(plan, 0.03)
    heavy = dataclasses.replace(plan, scene=dataclasses.replace(plan.scene, gravity=np.array([0.0, 0.0, -90.0])))
    with pytest.raises(RangeError, match=r"on limb2 and limb3 and limb4: .* % of its weight are lacking, at 0.20 s"):
        ClimbLoop(heavy, climb_plant("pinocchio", heavy.climber, heavy.scene))
    # By velocities nobody asks for it
    ClimbLoop(heavy)
    weightless = dataclasses.replace(plan, scene=dataclasses.replace(plan.scene, gravity=np.zeros(3)))
    check_borne(weightless)
