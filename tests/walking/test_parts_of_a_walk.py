"""The parts of a walk, each one alone."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from tests.simulation.lagging import LaggingPlant
from wbc.errors import ShapeError
from wbc.robots import Walker
from wbc.simulation import PlantError, PlantState
from wbc.walking import Structure
from wbc.walking.body_path import BodyPath, grid_path
from wbc.walking.loop.body_command import BodyMotion
from wbc.walking.loop.hands import TRIES, Hands
from wbc.walking.loop.machine import Machine
from wbc.walking.loop.progress import PlanProgress
from wbc.walking.loop.replanner import BodyReplanner
from wbc.walking.loop.stack import DT, WalkStack
from wbc.walking.loop.state import Manual, Swinging
from wbc.walking.loop.stopping import Stops
from wbc.walking.planner.plan import Plan
from wbc.walking.planner.planner import plan_walk
from wbc.walking.planner.slices import drained


@pytest.fixture(scope="module")
def plan(machine: Walker, structure: Structure) -> Plan:
    return plan_walk(machine, structure, grid_path([(13, 9), (13, 14)], 0.1016))


@pytest.fixture
def progress(machine: Walker, plan: Plan) -> PlanProgress:
    return PlanProgress(machine, plan)


@pytest.fixture
def standing(machine: Walker, structure: Structure, progress: PlanProgress) -> Machine:
    out, q = Machine(machine, structure, DT), np.array(machine.robot.neutral)
    pose = progress.pose
    q[:3], q[3:7] = pose.translation, pin.Quaternion(pose.rotation).coeffs()
    for arm, grip in zip(machine.arms, progress.grip, strict=True):
        q[arm.q] = progress.grips.posture_at(grip, 0)
    out.begin(q, {arm: int(progress.grips.hold[grip]) for arm, grip in enumerate(progress.grip)}, 2.0)
    return out


def test_held_hands_place_the_body_of_a_machine(standing: Machine) -> None:
    assert standing.time == 2.0
    assert not standing.fixed
    before = standing.q.copy()
    assert standing.move(np.zeros(len(standing.v))) < 1e-4
    np.testing.assert_allclose(standing.q, before, atol=1e-9)
    # The body goes where the joints and the holds have it, whatever is commanded of itself
    pushed = np.zeros(len(standing.v))
    pushed[:6] = 1.0
    standing.move(pushed)
    np.testing.assert_allclose(standing.q, before, atol=1e-9)
    assert standing.time == pytest.approx(2.0 + 2 * DT)
    standing.open(0)
    standing.open(1)
    assert len(standing.held) == 1
    standing.rest()
    assert not standing.v.any()


def test_a_machine_that_holds_nothing_is_fixed(machine: Walker, structure: Structure) -> None:
    free, v = Machine(machine, structure, DT), np.full(machine.robot.nv, 0.1)
    q = np.array(machine.robot.neutral)
    free.begin(q, {})
    assert free.fixed
    free.move(v)
    assert (free.q[:7] == q[:7]).all()
    np.testing.assert_allclose(free.q[7:], q[7:] + 0.1 * DT)
    assert not free.v[:6].any()
    for arm in range(machine.min_holds):
        free.close(arm, arm)
    assert not free.fixed


def test_what_a_machine_did_is_the_mean_of_a_period(machine: Walker, structure: Structure) -> None:
    free = Machine(machine, structure, DT, LaggingPlant(machine.robot, 0.02, 0, 0.0))
    free.begin(np.array(machine.robot.neutral), {})
    before = free.q.copy()
    free.move(np.full(machine.robot.nv, 0.1))
    np.testing.assert_allclose(free.q[7:] - before[7:], free.rates[6:] * DT, atol=1e-15)
    assert (free.rates[6:] < 0.1).all()


def test_a_plan_is_carried_out_step_by_step(progress: PlanProgress, plan: Plan) -> None:
    step = progress.step
    assert step is plan.regrasps[0]
    arm = progress.arm_of(step)
    old, grip = progress.grip[arm], progress.next_grip(arm)
    progress.lift(arm)
    assert grip == plan.chain[arm][1] != old
    assert progress.grip[arm] == old
    progress.land(Swinging(arm, 0, grip, plan.laws[0], 0.0))
    assert progress.grip[arm] == grip
    assert progress.step is plan.regrasps[1]
    progress.path_time = 1.0
    assert progress.travelled == 1.0
    assert progress.sample == pytest.approx(1.0 / plan.path.spacing)
    behind = progress.behind()
    np.testing.assert_allclose(behind[0], progress.pose.homogeneous)
    np.testing.assert_allclose(behind[-1], plan.path.poses[0])
    # Over to another path: what was done is behind
    progress.take(Plan(BodyPath(plan.path.poses[20:]), plan.start, (), True, 1.0, "", plan.grips, plan.chain), None)
    assert (progress.path_time, progress.next, progress.travelled) == (0.0, 0, pytest.approx(1.0))


def test_a_plan_without_grips_is_no_plan_to_carry_out(machine: Walker, plan: Plan) -> None:
    with pytest.raises(ShapeError, match="plan of the planner"):
        PlanProgress(machine, Plan(plan.path, plan.start, plan.regrasps, True, plan.path.duration))


@pytest.mark.parametrize("left", [0.05, 0.2, 1.0])
def test_a_body_comes_to_rest_within_what_is_left(plan: Plan, left: float) -> None:
    body, u = BodyMotion(DT, Stops(DT)), 0.0
    while u < 1.0:
        body.choose(10.0, 10.0, None, False)
        _, u = body.go(plan.path, u)
    assert body.pace == 1.0
    end, paces = u + max(left, Stops(DT).brake + 0.05), [1.0]
    for _ in range(400):
        body.choose(max(end - u, 0.0), max(end - u, 0.0), None, False)
        _, u = body.go(plan.path, u)
        paces.append(body.pace)
    assert abs(end - u) < 0.01
    assert np.diff(paces).max() <= 1e-12


def test_a_body_waits_for_a_hand_and_stops_when_told(plan: Plan) -> None:
    body = BodyMotion(DT, Stops(DT))
    for _ in range(100):
        body.choose(10.0, 10.0, (0.5, 1.0), False)
    assert body.pace == pytest.approx(0.5)
    for _ in range(100):
        body.choose(10.0, 10.0, None, True)
    assert (body.pace, body.wanted) == (0.0, 0.0)
    assert body.go(plan.path, 0.3)[1] == 0.3


class Switches:
    """A stack that keeps what it is told."""

    def __init__(self) -> None:
        self.said: list[tuple[Any, ...]] = []

    def __getattr__(self, name: str) -> Any:
        return lambda *arguments: self.said.append((name, *arguments[:2]))


def test_hands_open_close_and_miss(standing: Machine) -> None:
    stack, closes = Switches(), [False, True]
    hands = Hands(standing, stack, lambda _arm, _hold: closes.pop(0))  # type: ignore[arg-type]
    hands.begin([0, 0, 0])
    assert [said[0] for said in stack.said] == ["hold"] * 3
    assert hands.states() == ("closed",) * 3
    hold = standing.held[1]
    hands.open(1)
    assert [said[:2] for said in stack.said[-2:]] == [("release", 1), ("rest", 1)]
    law = SimpleNamespace(at=lambda _t: None, duration=1.0)
    swinging = hands.swinging = hands.going(1, (7, hold, -1), law, latch=0.02)  # type: ignore[arg-type]
    assert (hands.states()[1], hands.holds()[1]) == ("opening", hold)
    for _ in range(2):
        swinging.open_on(0.01)
    assert swinging.state == "open"
    assert not hands.close(1, hold, 0)
    assert [hands.missed(swinging) for _ in range(TRIES)] == [False] * (TRIES - 1) + [True]
    assert hands.close(1, hold, 0)
    assert standing.held[1] == hold
    assert hands.just_landed(1)
    standing.move(np.zeros(len(standing.v)))
    assert not hands.just_landed(1)
    hands.drop()
    assert hands.swinging is swinging
    assert swinging.dropped
    assert hands.holds()[1] == -1
    swinging.pace = 0.0
    assert not hands.settle(swinging)
    assert hands.swinging is None
    hands.manual = Manual(2, "open", -1)
    assert (hands.states()[2], hands.holds()[2]) == ("open", -1)


def test_a_replanner_follows_what_it_is_given(standing: Machine, progress: PlanProgress, plan: Plan) -> None:
    replanner = BodyReplanner(standing, progress)
    with pytest.raises(ShapeError, match="a BodyPath"):
        replanner.go("13,12")
    back = grid_path([(13, 9), (13, 8)], 0.1016)
    replanner.go(back)
    found = next(first for first in replanner.rest() if first is not None)
    np.testing.assert_allclose(found.path.poses[-1], back.poses[-1])
    replanner.taken()
    rest = next(first for first in replanner.rest() if first is not None)
    np.testing.assert_allclose(rest.path.poses[-1], plan.path.poses[-1])
    replanner.stand()
    assert np.ptp(drained(replanner.rest()).path.poses[:, :3, 3], axis=0).max() < 1e-9


class Dying(LaggingPlant):
    """Has no reading any more after a while."""

    def read(self) -> PlantState:
        state = super().read()
        return PlantState(state.q, state.v, state.time, valid=self.time < 0.5)


def test_a_walk_whose_plant_fails_leaves_what_there_is(machine: Walker, stack: WalkStack) -> None:
    from wbc.walking.run import PathRequest, Site, perform_walk

    plant = Dying(machine.robot, 0.01, 0, 0.0)
    run = perform_walk(PathRequest(Site(rigid=True), "13,9", ("13,10",)), machine, stack=stack, plant=plant)
    assert run.outcome == "plant failed"
    assert "no valid reading" in run.reason
    assert run.log is not None
    assert run.log.t[-1] == pytest.approx(0.49)
    assert not plant._last.any(), "it was commanded to rest"
    with pytest.raises(PlantError):
        Machine(machine, run.structure, DT, plant).move(np.zeros(machine.robot.nv))


class Heavy(LaggingPlant):
    """Has masses, and says after a while that something has failed; one joint does not stop."""

    def move(self, v: np.ndarray) -> None:
        self.v = v.copy()

    def failing(self) -> str:
        return "a motor is dead" if self.time > 0.3 else ""

    def advance(self, dt: float) -> None:
        before = self.q[-1]
        super().advance(dt)
        if self.failing():
            self.q[-1], self.v[-1] = before + 0.2 * dt, 0.2
            self._read = PlantState(self.q, self.v, self.time)


def test_what_has_not_come_to_rest_is_named_and_logged(machine: Walker, stack: WalkStack) -> None:
    from wbc.walking.run import PathRequest, Site, perform_walk

    plant = Heavy(machine.robot, 0.01, 0, 0.0)
    run = perform_walk(PathRequest(Site(rigid=True), "13,9", ("13,10",)), machine, stack=stack, plant=plant)
    assert run.outcome == "plant failed"
    name = machine.robot.dof_names[-1]
    assert "a motor is dead; not all of it came to rest" in run.reason
    assert f"{name} at " in run.reason
    assert run.log is not None
    # It goes on as it did: the log does not claim that it stands
    assert run.log.v[-1] == pytest.approx(run.log.v[-2])
    assert run.log.v[-1, -1] > 0.1
