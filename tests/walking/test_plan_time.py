"""The least time of whole plans: their joint path is that of the plan, and the law along it keeps every limit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import wbc
from wbc.errors import NotFiniteError, ShapeError
from wbc.robots import Walker, WalkerData
from wbc.walking import ArmKinematics, Structure
from wbc.walking.body_path import BodyPath, grid_path, standing_path
from wbc.walking.planner.follow import follow_plan
from wbc.walking.planner.plan import NoPlanError, Plan
from wbc.walking.planner.plan_time import PlanTime, least_plan_time, planned_joints
from wbc.walking.planner.planner import plan_walk
from wbc.walking.planner.swings.swings import SETTLE

INCH = 0.0254


@pytest.fixture(scope="module")
def made(machine: Walker, structure: Structure) -> Plan:
    return plan_walk(machine, structure, grid_path([(13, 9), (14, 13, 0.2)], 4 * INCH))


@pytest.fixture(scope="module")
def found(machine: Walker, made: Plan) -> PlanTime:
    return least_plan_time(machine, made)


def when(found: PlanTime, places: list[float]) -> np.ndarray:
    """Times of the law at which it is at times of the plan."""
    times = np.linspace(0.0, found.least, 40001)
    return np.interp(places, found.at(times), times)


def farthest(machine: Walker, structure: Structure, plan: Plan, path_time: np.ndarray, joints: np.ndarray) -> float:
    """Of holding hands from their holds [m]; joints ``[n, 18]`` at path times ``[n]``."""
    kinematics, far = ArmKinematics(machine.arm_data), []
    bodies = plan.path.blended(path_time / plan.path.spacing)
    for k, arm in enumerate(machine.arms):
        hands = (bodies @ arm.base.homogeneous @ kinematics.forward(joints[:, 6 * k : 6 * k + 6]))[:, :3, 3]
        steps = [step for step in plan.regrasps if step.arm == arm.name]
        holds = [plan.start[k], *(step.target for step in steps)]
        begins, ends = [0.0, *(step.land for step in steps)], [*(step.lift for step in steps), plan.path.duration]
        for hold, begin, end in zip(holds, begins, ends, strict=True):
            held = (path_time >= begin) & (path_time <= end)
            assert held.any()
            far.append(np.linalg.norm(hands[held] - structure.positions[structure.index(hold)], axis=1).max())
    return float(max(far))


def test_hands_are_on_their_holds_all_along_the_path(
    machine: Walker, structure: Structure, made: Plan, found: PlanTime
) -> None:
    # Without delays the plan's time is the path time; between waypoints the spline is looked at
    assert len(made.regrasps) >= 2
    assert made.delay == 0.0
    time = np.linspace(0.0, found.planned, 1001)
    assert farthest(machine, structure, made, time, found.law.path.evaluate(time)[:, :-1]) < 2e-5


def test_a_body_that_has_to_wait_is_late(machine: Walker, structure: Structure) -> None:
    plan = plan_walk(machine, structure, grid_path([(13, 6), (13, 18)], 6 * INCH))
    assert plan.delay > 0.1
    table = planned_joints(machine, plan)
    assert table.time[-1] == pytest.approx(plan.path.duration + plan.delay, abs=0.05)
    assert table.path_time[-1] == plan.path.duration
    assert farthest(machine, structure, plan, table.path_time, table.joints) < 2e-5
    found = least_plan_time(machine, plan)
    assert found.law.certificate.satisfied
    assert found.factor < 1.0


def test_a_swinging_hand_follows_its_law(machine: Walker, made: Plan, found: PlanTime) -> None:
    kinematics, data = ArmKinematics(machine.arm_data), machine.arm_data
    assert isinstance(data, WalkerData)
    for step, law in zip(made.regrasps, made.laws, strict=True):
        k = [arm.name for arm in machine.arms].index(step.arm)
        since = np.linspace(0.0, law.duration, 101)
        time = step.lift + data.latch_time + since
        bodies = made.path.blended(time / made.path.spacing) @ machine.arms[k].base.homogeneous
        hands = bodies @ kinematics.forward(found.law.path.evaluate(time)[:, 6 * k : 6 * k + 6])
        aims = np.array([law.at(float(t)).position for t in since])
        assert np.linalg.norm(aims[50] - aims[0]) > 0.1
        assert np.linalg.norm(hands[:, :3, 3] - aims, axis=1).max() < 2e-3


def test_limits_hold_along_the_law(machine: Walker, found: PlanTime) -> None:
    # Differences of positions are means of rates and of accelerations, so no limit is exceeded by them either
    data, step = machine.data, 5e-4
    assert isinstance(data, WalkerData)
    joints = found.law.at(np.arange(0.0, found.least, step)).position[:, :-1].reshape(-1, 3, 6)
    rates = np.abs(np.diff(joints, axis=0)) / step / np.array(data.joint_rates)
    pushes = np.abs(np.diff(joints, 2, axis=0)) / step**2 / np.array(data.joint_accelerations)
    assert rates.max() < 1.0 + 1e-6
    assert pushes.max() < 1.0 + 1e-5
    assert found.law.certificate.satisfied
    # It is fast: at nearly every time something is at its limit
    assert sum(found.binding.values()) > 0.85
    assert max(rates.max(), pushes.max()) > 0.99


def test_latches_keep_their_length(machine: Walker, made: Plan, found: PlanTime) -> None:
    data = machine.data
    assert isinstance(data, WalkerData)
    for step in made.regrasps:
        opens, opened, settles, closed = when(
            found, [step.lift, step.lift + data.latch_time, step.land - data.latch_time - SETTLE, step.land]
        )
        assert opened - opens > data.latch_time - 1e-4
        assert closed - settles > data.latch_time + SETTLE - 1e-4
    assert found.at(np.array([0.0, found.least])) == pytest.approx([0.0, found.planned])
    assert (np.diff(found.at(np.linspace(0.0, found.least, 2000))) > 0.0).all()


def test_a_plan_at_half_the_speed_has_the_same_least_time_but_for_its_latches(
    machine: Walker, structure: Structure, made: Plan, found: PlanTime
) -> None:
    fine = BodyPath(made.path.blended(0.5 * np.arange(2 * len(made.path) - 1)), made.path.spacing)
    steps = tuple(
        replace(s, lift=2 * s.lift, land=2 * s.land, until=2 * s.until, margin=2 * s.margin) for s in made.regrasps
    )
    slow = least_plan_time(machine, follow_plan(machine, structure, replace(made, path=fine, regrasps=steps)))
    data = machine.data
    assert isinstance(data, WalkerData)
    latches = len(steps) * (2 * data.latch_time + SETTLE)
    assert slow.planned == pytest.approx(2 * found.planned)
    assert found.factor < 0.6
    assert slow.factor < 0.3
    # In the time of a latch it goes half as far, so more of the way is left for the rest
    assert -0.01 * found.least < slow.least - found.least < latches * found.factor
    # Without latches nothing of the kind
    short = [
        least_plan_time(machine, plan_walk(machine, structure, grid_path([(13, 9), (13, 10)], v * INCH)))
        for v in (2, 4)
    ]
    assert short[0].planned == pytest.approx(2 * short[1].planned, rel=0.02)
    assert short[0].least == pytest.approx(short[1].least, rel=0.01)


def test_what_binds_is_the_slowest(machine: Walker, made: Plan, found: PlanTime) -> None:
    data = machine.data
    assert isinstance(data, WalkerData)
    name = next(iter(found.binding))
    joint = int(name[-1]) - 1
    rates = [1.2 * rate if k == joint else rate for k, rate in enumerate(data.joint_rates)]
    faster = least_plan_time(wbc.robots.walker(data=replace(data, joint_rates=tuple(rates))), made)
    assert faster.least < 0.99 * found.least


def test_a_body_that_stands_is_done_at_once(machine: Walker, structure: Structure) -> None:
    plan = plan_walk(machine, structure, standing_path(grid_path([(13, 9)], INCH).poses[0], 3.0))
    stands = least_plan_time(machine, plan)
    assert stands.least < 0.06 * stands.planned
    assert list(stands.binding) == ["pace"]


def test_bad_input_is_told(machine: Walker, made: Plan, found: PlanTime) -> None:
    with pytest.raises(ShapeError, match="follow_plan"):
        least_plan_time(machine, replace(made, grips=None))
    with pytest.raises(ShapeError, match="grips and laws"):
        planned_joints(machine, replace(made, laws=()))
    with pytest.raises(ShapeError, match="body with arms"):
        least_plan_time(wbc.robots.walker(two_ended=True), made)
    with pytest.raises(NoPlanError, match="too far"):
        least_plan_time(machine, replace(made, complete=False, reason="too far"))
    with pytest.raises(NotFiniteError):
        found.at(np.array([0.0, np.nan]))
