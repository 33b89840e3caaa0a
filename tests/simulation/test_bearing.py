"""What holds and motors bear at rest: over a plan, and before a hand lets go."""

from __future__ import annotations

from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import linprog

import wbc.robots
from tests.simulation.machines import HANDS
from wbc.simulation import GripKind, PinocchioPlant
from wbc.walking import cylinder
from wbc.walking.body_path import grid_path
from wbc.walking.planner.planner import plan_walk
from wbc.walking.torque.bearing import SHARE, Bearing
from wbc.walking.torque.loop import TorqueLoop
from wbc.walking.torque.stack import TorqueStack

MOON = wbc.robots.with_masses(wbc.robots.walker(), (0.0, -1.62, 0.0))
AXIS = dict.fromkeys(HANDS, GripKind.AXIS)


@cache
def stack() -> TorqueStack:
    return TorqueStack(MOON, [GripKind.AXIS], backend="vm")


def most_gravity(q: np.ndarray, hands: tuple[str, ...]) -> float:
    """The part of its gravity that the robot bears, by a linear program over Pinocchio's rows."""
    robot, rating = MOON.robot, wbc.robots.hold_rating()
    data = robot.model.createData()
    weight = pin.computeGeneralizedGravity(robot.model, data, q)
    rows = [pin.computeFrameJacobian(robot.model, data, q, robot.model.getFrameId(hand))[:5] for hand in hands]
    push, torque = np.vstack(rows).T, SHARE * robot.limits.effort[6:]
    inside = np.hstack([-push[6:], weight[6:, None]])
    box = SHARE * np.array([rating.force] * 3 + [rating.torque] * 2)
    found = linprog(
        np.append(np.zeros(push.shape[1]), -1.0),
        A_ub=np.vstack([inside, -inside]),
        b_ub=np.tile(torque, 2),
        A_eq=np.hstack([push[:6], -weight[:6, None]]),
        b_eq=np.zeros(6),
        bounds=[(-most, most) for most in np.tile(box, len(hands))] + [(0.0, None)],
    )
    return float(found.x[-1])


@pytest.mark.parametrize("seed", range(6))
def test_what_it_bears_is_what_a_linear_program_says(seed: int) -> None:
    random, robot = np.random.default_rng(seed), MOON.robot
    hands = HANDS[: 2 + seed % 2]
    bearing, q = Bearing(stack()), robot.neutral.copy()
    q[7:] += random.uniform(-0.5, 0.5, robot.nq - 7)
    q[3:7] = pin.Quaternion(pin.exp3(random.uniform(-1.0, 1.0, 3))).coeffs()
    share = most_gravity(q, hands)
    short = bearing.lacking(q, dict.fromkeys(hands, GripKind.AXIS))
    assert (not short) == (share >= 1.0)


def test_a_hand_that_the_others_need_is_not_opened() -> None:
    loop, q = TorqueLoop(stack(), PinocchioPlant(MOON.robot)), MOON.robot.neutral
    loop.reset(q, 0.0)
    for hand in HANDS:
        loop.grasp(hand, MOON.robot.pose(q, hand), GripKind.AXIS)
    loop.release(HANDS[0])
    assert not loop.holds_without(HANDS[1])
    assert "cannot stand on arm3: " in loop.failing()
    assert " N m of the motor of arm3_joint" in loop.failing()
    assert loop.bearing.words((), ()).startswith("under 1.62 m/s^2 it cannot stand on no hand")


def test_a_plan_that_is_not_borne_says_where_and_what_is_lacking() -> None:
    walker, structure = wbc.robots.walker(), cylinder(rigid=True)
    plan = plan_walk(walker, structure, grid_path([(13, 9), (13, 14)], 0.1016))
    assert plan.complete
    text = Bearing(stack()).of_plan(plan, structure)
    assert "under 1.62 m/s^2 it cannot stand on arm" in text
    assert " s of the plan" in text
    light = TorqueStack(wbc.robots.with_masses(walker), [GripKind.AXIS], backend="vm")
    assert Bearing(light).of_plan(plan, structure) == ""
