"""The loop of climbing: plans arrive, late limbs are waited for, and what goes wrong is said."""

from __future__ import annotations

import dataclasses
import itertools
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from tests.climb.arriving import arrives
from tests.climb.by_hand import TRIPODS, climber, gait, level, posture
from tests.climb.walkers import over
from wbc.climb import FREE_LIMB, ClimbScene, ContactMove, ContactPlan, Foothold, Stance, first_stance, machines
from wbc.climb.checker import check
from wbc.climb.drive import standing_plan
from wbc.climb.grids import cylinder_grid
from wbc.climb.limb_work import plan_limb_work
from wbc.climb.loop import TRANSITIONS, Cause, ClimbLoop, ClimbOutcome, ClimbRun, LimbState, PlanReference
from wbc.climb.loop.limb_state import after
from wbc.errors import RangeError
from wbc.shapes import Box, PlacedShape
from wbc.simulation import KinematicPlant


class Lagging(KinematicPlant):
    """Joints and body come to a commanded rate with a time constant [s]."""

    def __init__(self, robot, lag: float) -> None:  # type: ignore[no-untyped-def]
        self.lag = lag
        super().__init__(robot)

    def apply(self, command) -> None:  # type: ignore[no-untyped-def]
        self._v = self._v + 0.01 / (self.lag + 0.01) * (command.values - self._v)


@pytest.mark.parametrize("steps", [TRIPODS * 2, [(k,) for k in (0, 3, 4, 1)], [(0, 5), (2, 3), (1, 4)]])
def test_a_plan_is_carried_out_and_checked(steps: list[tuple[int, ...]]) -> None:
    plan = gait(steps)
    run = ClimbLoop(plan).run()
    arrives(run, plan.climber, plan.scene)
    assert not run.reason
    assert run.log["kept"].all()
    assert abs(len(run.log) * 0.01 - plan.times[-1]) < 0.03
    # Ticks go exactly where the plan does, so that what they miss does not grow with the robot
    reference, model = PlanReference(plan, plan.climber.robot), plan.climber.robot.model
    for time, q in zip(run.log["path_time"], run.log.array("q"), strict=True):
        assert np.abs(pin.difference(model, reference.q(time), q)).max() < 1e-6
    last = list(plan.start)
    for move in plan.moves:
        last[move.limb] = move.lands
    assert run.log.array("contact")[-1].tolist() == last


def test_changes_are_those_of_the_table_and_in_the_log() -> None:
    run = ClimbLoop(gait(TRIPODS)).run()
    states = dict.fromkeys(run.log.group("state"), LimbState.HELD)
    for _, limb, state, cause in run.changes:
        assert TRANSITIONS[states[limb], cause] is state
        states[limb] = state
    seen = {LimbState(k) for column in run.log.group("state").values() for k in np.unique(column)}
    assert seen == {LimbState.HELD, LimbState.SWINGING, LimbState.REACHING}
    for state, cause in itertools.product(LimbState, Cause):
        if (state, cause) not in TRANSITIONS:
            with pytest.raises(RangeError, match="changes by"):
                after(state, cause)


@pytest.mark.parametrize("lag", [0.05, 0.1])
def test_a_plan_waits_for_limbs_that_are_late(lag: float) -> None:
    plan = gait(TRIPODS)
    run = ClimbLoop(plan, Lagging(plan.climber.robot, lag)).run(most=20.0)
    assert run.outcome is ClimbOutcome.ARRIVED, run.reason
    assert len(run.log) * 0.01 > plan.times[-1] + 0.05
    assert (np.diff(run.log["path_time"]) >= 0.0).all()


def test_a_robot_at_rest_keeps_to_a_plan_that_begins_in_motion() -> None:
    plan = gait(TRIPODS)
    first = int(np.abs(plan.v[plan.times < plan.moves[0].land]).max(axis=1).argmax())
    now, aloft = plan.times[first], {move.limb for move in plan.moves if move.lift < plan.times[first]}
    moves = [dataclasses.replace(move, lift=max(move.lift - now, 0.0), land=move.land - now) for move in plan.moves]
    start = tuple(FREE_LIMB if limb in aloft else row for limb, row in enumerate(plan.start))
    parts = {"times": plan.times[first:] - now, "q": plan.q[first:], "v": plan.v[first:]}
    plan = dataclasses.replace(plan, start=start, moves=moves, **parts)
    run = ClimbLoop(plan).run()
    assert run.outcome is ClimbOutcome.ARRIVED, run.reason
    reference = PlanReference(plan, plan.climber.robot)
    for time, q in zip(run.log["path_time"], run.log.array("q"), strict=True):
        assert np.abs(pin.difference(plan.climber.robot.model, q, reference.q(time))).max() < 1e-3


def test_a_limb_that_never_comes_is_named_with_its_distance() -> None:
    plan = gait(TRIPODS)
    row = plan.moves[0].lands
    away = list(plan.scene.footholds)
    moved = pin.SE3(np.eye(3), away[row].pose.translation + [0.004, 0.0, 0.0])
    away[row] = dataclasses.replace(away[row], pose=moved)
    run = ClimbLoop(dataclasses.replace(plan, scene=dataclasses.replace(plan.scene, footholds=away))).run()
    assert run.outcome is ClimbOutcome.STOPPED
    assert f"limb1 did not come to p{row}: 4.0" in run.reason


def _stands(run: ClimbRun) -> None:
    assert np.abs(run.log.array("u")[-1]).max() < 5e-3


def test_a_foothold_that_is_gone_before_it_is_held_stops_the_robot_and_says_so() -> None:
    plan = gait(TRIPODS)
    loop = ClimbLoop(plan)
    for _ in range(50):
        loop.tick()
    loop.see(dataclasses.replace(plan.scene, footholds=plan.scene.footholds[:6] + plan.scene.footholds[7:]))
    run = loop.run()
    assert run.outcome is ClimbOutcome.STOPPED
    assert "the foothold p6 that limb1 was to land on is gone, and no planner was given" in run.reason
    assert len(run.log) < 80
    _stands(run)
    assert run.log["contact.limb1"][-1] == FREE_LIMB


def _back_down(scene: ClimbScene, stance: Stance) -> ContactPlan:
    """Free limbs go straight to the nearest foothold that is free; the body stands."""
    machine, now = climber(), stance.q.copy()
    taken, moves = set(stance.contacts), []
    places = np.array([machine.contact_pose(now, k).translation for k in range(6)])
    for limb, row in enumerate(stance.contacts):
        if row == FREE_LIMB:
            near = min((k for k in range(len(scene.footholds)) if k not in taken),
                       key=lambda k: np.linalg.norm(scene.footholds[k].pose.translation - places[limb]))  # fmt: skip
            taken.add(near)
            moves.append(ContactMove(limb, FREE_LIMB, near, 0.1, 0.9))
            places[limb] = scene.footholds[near].pose.translation
    end = posture(machine, now[:3], places, now)
    times = np.array([0.0, 0.1, 0.9, 1.0])
    return ContactPlan(machine, scene, stance.contacts, moves, times, np.array([now, now, end, end]),
                       np.zeros((4, 24)))  # fmt: skip


def test_a_planner_is_asked_from_the_stance_that_the_robot_is_in() -> None:
    plan = gait(TRIPODS)
    asked: list[Stance] = []

    def planner(scene: ClimbScene, stance: Stance) -> ContactPlan:
        asked.append(stance)
        return _back_down(scene, stance)

    loop = ClimbLoop(plan, replan=planner)
    for _ in range(60):
        loop.tick()
    left = dataclasses.replace(plan.scene, footholds=plan.scene.footholds[:6] + plan.scene.footholds[7:])
    loop.see(left)
    run = loop.run(most=10.0)
    assert run.outcome is ClimbOutcome.ARRIVED, run.reason
    assert [stance.contacts for stance in asked] == [(FREE_LIMB, 1, FREE_LIMB, 3, FREE_LIMB, 5)]
    assert len(run.plans) == 2
    assert run.log["kept"].all()
    # The log names footholds by their rows in the first plan's scene, whatever the second plan has left of it
    assert run.scene is plan.scene
    second = run.plans[1]
    last = [second.start[k] if second.start[k] >= 0 else second.moves[[m.limb for m in second.moves].index(k)].lands
            for k in range(6)]  # fmt: skip
    rows = run.log.array("contact")[-1]
    assert [run.scene.footholds[row].id for row in rows] == [second.scene.footholds[row].id for row in last]
    assert check(run.log, plan.climber, run.scene).clean
    assert {cause for *_, cause in run.changes} >= {Cause.NEW_PLAN, Cause.AT_FOOTHOLD}


@pytest.mark.parametrize(("found", "said"), [(RangeError("goal", "x", "nothing within 0.3 m"), "nothing within 0.3 m"),
                                             (None, "expected a ContactPlan")])  # fmt: skip
def test_a_planner_that_finds_nothing_ends_the_run_with_its_reason(found: RangeError | None, said: str) -> None:
    def planner(scene: ClimbScene, stance: Stance) -> Any:
        if found is not None:
            raise found

    plan = gait(TRIPODS)
    loop = ClimbLoop(plan, replan=planner)
    for _ in range(30):
        loop.tick()
    stone = PlacedShape(Box((0.1, 0.1, 0.1)), pin.SE3(np.eye(3), np.array([2.0, 0.0, 0.0])))
    loop.see(dataclasses.replace(plan.scene, bodies={**plan.scene.bodies, "stone": stone}))
    run = loop.run()
    assert run.outcome is ClimbOutcome.STOPPED
    assert said in run.reason
    assert "the bodies of the scene are others" in run.reason
    _stands(run)


@pytest.mark.parametrize("change", [{"start": (1, 0, 2, 3, 4, 5)}, {"q": 0.06}])
def test_a_plan_that_begins_elsewhere_is_not_begun(change: dict[str, Any]) -> None:
    def after(scene: ClimbScene, stance: Stance) -> ContactPlan:
        then = standing_plan(plan.climber, scene, stance)
        q = then.q + np.r_[change.get("q", 0.0), np.zeros(plan.climber.robot.nq - 1)]
        return dataclasses.replace(then, q=q, start=change.get("start", then.start))

    plan = standing_plan(climber(), gait(TRIPODS).scene, Stance(gait(TRIPODS).start, gait(TRIPODS).q[0]))
    run = ClimbLoop(plan, onward=after, backend="vm").run(2.0)
    assert run.outcome is ClimbOutcome.STOPPED
    assert "nothing comes after the plan; plan." in run.reason


def test_a_foothold_that_breaks_off_frees_its_limb() -> None:
    plan = gait(TRIPODS)
    loop = ClimbLoop(plan, replan=_back_down)
    for _ in range(5):
        loop.tick()
    spare = Foothold("spare", pin.SE3(np.eye(3), plan.scene.footholds[1].pose.translation + [0.0, 0.02, 0.0]), "floor")
    loop.see(dataclasses.replace(plan.scene, footholds=[spare, *plan.scene.footholds[2:], plan.scene.footholds[0]]))
    run = loop.run(most=5.0)
    assert run.outcome is ClimbOutcome.ARRIVED, run.reason
    time, *change = run.changes[0]
    assert abs(time - 0.05) < 1e-6
    assert change == ["limb2", LimbState.FREE, Cause.HOLD_LOST]
    assert run.plans[1].start[0] == len(plan.scene.footholds) - 1
    assert [foothold.id for foothold in run.scene.footholds[len(plan.scene.footholds) :]] == ["spare"]
    assert [run.scene.footholds[row].id for row in run.log.array("contact")[0]] == ["p0", "p1", "p2", "p3", "p4", "p5"]


def test_the_reference_is_the_plan_at_its_knots_and_smooth_between() -> None:
    plan = gait(TRIPODS)
    model = plan.climber.robot.model
    rng = np.random.default_rng(3)
    turned = np.array([pin.integrate(model, q, np.r_[np.zeros(3), 0.3 * np.sin(t + np.arange(3)), np.zeros(18)])
                       for q, t in zip(plan.q, plan.times, strict=True)])  # fmt: skip
    v = rng.normal(0.0, 0.5, plan.v.shape)
    reference = PlanReference(dataclasses.replace(plan, q=turned, v=v), plan.climber.robot)
    for k, t in enumerate(plan.times[1:-1], start=1):
        assert np.abs(pin.difference(model, turned[k], reference.q(t))).max() < 1e-12
        before = pin.difference(model, reference.q(t - 1e-6), turned[k]) / 1e-6
        later = pin.difference(model, turned[k], reference.q(t + 1e-6)) / 1e-6
        assert np.abs(before - v[k]).max() < 1e-3
        assert np.abs(later - v[k]).max() < 1e-3


def test_plans_that_are_none_are_refused_by_name() -> None:
    plan = gait(TRIPODS)
    for change, what in (
        ({"start": (0, 1)}, "plan.start"),
        ({"moves": [ContactMove(9, 0, 1, 0.1, 0.2)]}, r"plan.moves\[0\]"),
        ({"moves": [ContactMove(0, 0, 1, 0.2, 0.1)]}, "lift < land"),
        ({"start": (1, 0, 2, 3, 4, 5)}, "m and 0 rad off p1"),
    ):
        with pytest.raises(RangeError, match=what):
            ClimbLoop(dataclasses.replace(plan, **change))
    other = dataclasses.replace(level([np.zeros(3)]), gravity=np.zeros(3))
    with pytest.raises(RangeError, match="gravity"):
        ClimbLoop(plan).see(other)
    footholds = [dataclasses.replace(one, pose=one.pose * pin.SE3(np.eye(3), np.ones(3))) for one in other.footholds]
    with pytest.raises(RangeError, match="p0: it was elsewhere"):
        ClimbLoop(plan).see(dataclasses.replace(plan.scene, footholds=footholds))


def test_a_stop_is_even_where_no_lift_is_near() -> None:
    loop = ClimbLoop(gait(TRIPODS), backend="vm")
    while loop.path_time < 0.4:
        loop.tick()
    loop.stop("the operator stopped it")
    for _ in range(30):
        loop.tick()
    rates = np.diff(loop.result().log["path_time"]) / loop.dt
    assert loop.still
    assert np.diff(rates).min() > -0.0501


def test_a_limb_that_lifts_again_at_once_lands_first() -> None:
    scene, walker = cylinder_grid(), machines.climber("walker")
    stance = first_stance(walker, scene, walker.with_body(walker.rest, over(13, 8)))
    near = np.argsort(np.linalg.norm(scene.positions - scene.positions[stance.contacts[0]], axis=1))
    ids = [scene.footholds[row].id for row in near if row not in stance.contacts][:2]
    plan = plan_limb_work(walker, scene, stance, walker.limbs[0].name, ids)
    run = ClimbLoop(plan, period=0.03, backend="vm").run()
    assert run.outcome is ClimbOutcome.ARRIVED, run.reason
    latched = next(time for time, _, state, _ in run.changes if state is LimbState.LATCHING)
    row = int(np.searchsorted(run.log["t"], latched + 1e-9, side="right")) - 1
    assert run.log["path_time"][row] <= plan.moves[0].land + 1e-9
