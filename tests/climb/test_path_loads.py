"""Motions whose accelerations contacts can bear: against scipy's program and Pinocchio's inverse dynamics."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from scipy.interpolate import CubicSpline
from scipy.linalg import block_diag
from scipy.optimize import linprog

from tests.climb.bearing import slack_by_scipy
from tests.climb.test_balance import around
from tests.repeats import covering, repeats
from wbc.climb import BodyPlace, ClimbOptions, StanceOptions, find_stances, first_stance, plan_climb, scenes
from wbc.climb.balance import Equilibrium
from wbc.climb.loop import PlanReference
from wbc.climb.machines import climber
from wbc.climb.motion import MotionOptions, Mover
from wbc.climb.plan import ContactPlan
from wbc.climb.scene import size_of
from wbc.climb.stance import FREE_LIMB
from wbc.climb.time_law import MotionSpeeds, fastest
from wbc.trajectory.least_time.reachability import SpeedProgram
from wbc.trajectory.least_time.rows import PathRows
from wbc.validation import Array

#: Time between configurations of which accelerations are differences [s]
H = 1e-3
#: Instants of a plan that are looked at
INSTANTS = 60
#: Motors of a quadruped that bind as it walks [N m]
WEAK = 50.0
#: What differences of cubics between knots of 20 ms are off, in weights
DIFFERENCES = 2e-3


@pytest.mark.parametrize(("name", "seed"), covering(("anymal_c", "talos_hands", "hexapod_grips"), range(repeats(2))))
def test_slacks_of_wrenches_are_those_of_weights_elsewhere_and_their_bounds_hold(name: str, seed: int) -> None:
    """A wrench without a moment along its force is a weight in another direction, at another place."""
    robot, rng = climber(name), np.random.default_rng(seed)
    scene = around(robot, rng, lean=0.3, most=0.7)
    balance, contacts = Equilibrium(robot, scene), list(range(len(robot.limbs)))
    point = rng.uniform(-0.2, 0.2, 3)
    center, wrenches, wanted = robot.center_of_mass(robot.rest), [], []
    for _ in range(repeats(10)):
        force = np.array([0.0, 0.0, 1.0]) + rng.uniform(-0.3, 0.3, 3)
        wrenches.append(np.concatenate([force, np.cross(center - point, force)]))
        size = float(np.linalg.norm(force))
        # Cones without limits grow with the weight, and the slack with them
        elsewhere = replace(scene, gravity=-9.81 * force / size)
        wanted.append(size * slack_by_scipy(robot, elsewhere, contacts, robot.rest))
    slacks, bounds = balance.wrench_slacks(contacts, robot.rest, point, np.array(wrenches))
    if name == "anymal_c":
        np.testing.assert_allclose(slacks, np.minimum(wanted, 1.0), atol=1e-6)
    at_all = bounds[:, :1] + bounds[:, 1:] @ np.array(wrenches).T
    assert (at_all >= slacks - 1e-7).all()
    np.testing.assert_allclose(np.diag(at_all), slacks, atol=1e-7)


def _slack_in_motion(
    balance: Equilibrium, plan: ContactPlan, reference: PlanReference, time: float
) -> tuple[float, float]:
    """Slack [weights] at rest and in motion, of the contacts that hold."""
    robot = plan.climber
    model, data = robot.robot.model, robot.robot.model.createData()
    before, q, after = (reference.q(time + k * H) for k in (-1, 0, 1))
    rates = pin.difference(model, before, q) / H, pin.difference(model, q, after) / H
    own = pin.rnea(model, data, q, (rates[0] + rates[1]) / 2, (rates[1] - rates[0]) / H)
    pin.forwardKinematics(model, data, q)
    wrench = data.oMi[1].act(pin.Force(own[:6]))
    held = plan.contacts_at(time)
    center, weight = robot.center_of_mass(q), robot.mass * 9.81
    needed = np.concatenate([wrench.linear, wrench.angular - np.cross(center, wrench.linear)]) / weight
    still = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    slacks, _ = balance.wrench_slacks(held, q, center, np.array([still, needed]))
    return float(slacks[0]), float(slacks[1])


@pytest.mark.parametrize(("name", "seed"), covering(("a1", "hexapod"), range(repeats(1))))
def test_motions_keep_their_share_of_slack(name: str, seed: int) -> None:
    robot = climber(name)
    course = scenes.draw("stepping_stones", size_of(robot), seed)
    start = first_stance(robot, course.scene, scenes.placed(robot, course.start))
    ahead = robot.body_pose(start.q).translation + [0.3 * size_of(robot), 0.0, 0.0]
    balance, least, used = Equilibrium(robot, course.scene), np.inf, 0.0
    for share in (0.5, 0.2):
        options = ClimbOptions(motion=MotionOptions(inertia=share, speeds=MotionSpeeds(dwell=0.1)))
        plan = plan_climb(robot, course.scene, start, BodyPlace(ahead), options)
        reference = PlanReference(plan, robot.robot)
        # Half-way between knots, as accelerations jump at some of these
        middles = (plan.times[1:] + plan.times[:-1])[np.diff(plan.times) > 4 * H] / 2
        for time in middles[:: max(1, len(middles) // INSTANTS)]:
            still, moving = _slack_in_motion(balance, plan, reference, float(time))
            least = min(least, moving - (1.0 - share) * still)
            used = max(used, (still - moving) / still)
        assert plan.margin is not None
        assert plan.margin > 0.0
    assert least > -DIFFERENCES
    assert used > 0.4, "least time uses what it may"


def _driven(plan: ContactPlan, reference: PlanReference, time: float, friction: float) -> float:
    """The least share of the efforts by which motors and point feet carry out a plan at a time."""
    robot, held = plan.climber.robot, plan.contacts_at(time)
    model, data = robot.model, robot.model.createData()
    before, q, after = (reference.q(time + k * H) for k in (-1, 0, 1))
    rates = pin.difference(model, before, q) / H, pin.difference(model, q, after) / H
    own = pin.rnea(model, data, q, (rates[0] + rates[1]) / 2, (rates[1] - rates[0]) / H)
    pin.computeJointJacobians(model, data, q)
    pulls, cones = [], []
    for limb, row in zip(plan.climber.limbs, held, strict=True):
        if row == FREE_LIMB:
            continue
        frame = model.getFrameId(limb.frame)
        pin.updateFramePlacement(model, data, frame)
        rotation = plan.scene.footholds[row].pose.rotation
        jacobian = pin.getFrameJacobian(model, data, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        arm = data.oMf[frame].rotation @ limb.placement.translation
        arm = arm - limb.contact.height * rotation[:, 2]
        pulls.append((jacobian[:3] - pin.skew(arm) @ jacobian[3:]).T @ rotation)
        cones.append(limb.contact.lower(plan.scene.footholds[row].friction, friction).cone()[0][:9, :3])
    pulled, most = np.hstack(pulls), robot.limits.effort[6:, None]
    cone = np.hstack([block_diag(*cones), np.zeros((9 * len(cones), 1))])
    rows = np.vstack([np.hstack([-pulled[6:], -most]), np.hstack([pulled[6:], -most]), cone])
    sides = np.concatenate([-own[6:], own[6:], np.zeros(len(cone))])
    count = pulled.shape[1]
    answer = linprog(np.append(np.zeros(count), 1.0), rows, sides, np.hstack([pulled[:6], np.zeros((6, 1))]), own[:6],
                     [(None, None)] * count + [(0.0, None)])  # fmt: skip
    return float(answer.fun) if answer.status == 0 else np.inf


def test_moves_are_as_fast_as_motors_allow() -> None:
    strong = climber("anymal_c")
    robot = replace(strong, robot=strong.robot.with_limits(effort=WEAK))
    course, options = scenes.draw("stepping_stones", size_of(robot), 0), ClimbOptions.by_torques()
    start = first_stance(robot, course.scene, scenes.placed(robot, course.start), options.stances)
    ahead = robot.body_pose(start.q).translation + [0.3 * size_of(robot), 0.0, 0.0]
    plan = plan_climb(robot, course.scene, start, BodyPlace(ahead), options)
    reference = PlanReference(plan, robot.robot)
    middles = (plan.times[1:] + plan.times[:-1])[np.diff(plan.times) > 4 * H] / 2
    shares = [_driven(plan, reference, float(time), 0.75) for time in middles[:: max(1, len(middles) // 300)]]
    # Of what is left at rest motion uses half
    assert 0.75 < max(shares) < 0.5 * (1.0 + 0.75) + 0.02


@pytest.mark.parametrize("count", [1, 3, 8])
def test_least_time_with_rows_of_one_side_is_that_of_linear_programs(count: int) -> None:
    rng = np.random.default_rng(count)

    def ends(rows: Array) -> Array:
        return np.stack([rows[:-1], rows[1:]], axis=1)

    for _ in range(repeats(5)):
        q = CubicSpline(np.linspace(0.0, 1.0, 7), rng.normal(size=(7, count)))
        s = (1 - np.cos(np.linspace(0, np.pi, 41))) / 2
        a, b = q(s, 1) / 20.0, q(s, 2) / 20.0
        c, d = (rng.normal(0.0, scale, (1, 5)) * (1.0 + 0.3 * np.sin(7.0 * s))[:, None] for scale in (2.0, 8.0))
        squared = 1.0 / np.maximum((np.abs(q(s, 1)) / 3.0).max(axis=1), 1e-9) ** 2
        rows = [PathRows(ends(a), ends(b), np.zeros_like(ends(a))),
                PathRows(ends(c), ends(d), np.zeros_like(ends(c)), both=False)]  # fmt: skip
        wanted = SpeedProgram(s, rows, squared).fastest().speed
        np.testing.assert_allclose(fastest(s, a, b, squared, (c, d)), wanted, rtol=1e-6, atol=1e-7)
        assert (wanted < fastest(s, a, b, squared) * (1 - 1e-6)).any()


def test_a_body_leans_over_the_foot_that_holds() -> None:
    robot = climber("talos")
    course = scenes.draw("stairs", size_of(robot))
    start = first_stance(robot, course.scene, scenes.placed(robot, course.start))
    goal = BodyPlace(robot.body_pose(scenes.placed(robot, course.goal)).translation)
    stances = find_stances(robot, course.scene, start, goal, StanceOptions(apart=0.001)).stances
    balance = Equilibrium(robot, course.scene)
    mover, least = Mover(robot, course.scene, MotionOptions(), balance), np.inf
    # On two of these three moves the straight way of the body is not borne
    for one, other in itertools.pairwise(stances[13:17]):
        timed, _ = mover.moved(one, other)
        held = tuple(a if a == b else FREE_LIMB for a, b in zip(one.contacts, other.contacts, strict=True))
        least = min(least, *(balance.margin(held, q) for q in timed.q))
    assert least > 0.0
