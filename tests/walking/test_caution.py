"""What the loop proves before it does it: foreseen motions are those that follow, and what is too near is not begun."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from wbc.errors import RangeError
from wbc.robots import Walker, WalkerData
from wbc.shapes import Sphere
from wbc.walking import Obstacle, PlaneSurface, Structure
from wbc.walking.arms.fits import check_fits
from wbc.walking.arms.puma import limb_of
from wbc.walking.body_path import BodyPath, grid_path, straight_path
from wbc.walking.loop.body_command import BENDING, BodyMotion, Corners
from wbc.walking.loop.caution import RATE, SETTLED, Caution, Course
from wbc.walking.loop.closed_chain import ClosedChain
from wbc.walking.loop.coasting import Coasting
from wbc.walking.loop.foresight import LAGS, Foresight
from wbc.walking.loop.hand_pace import LEAST_PACE, RAMP_AGAIN, hand_pace
from wbc.walking.loop.rest import quickest
from wbc.walking.loop.stack import DT, WalkStack
from wbc.walking.loop.state import AFTER_PAUSE, State, Swinging
from wbc.walking.loop.stopping import Stops
from wbc.walking.loop.walk import Walk
from wbc.walking.planner.plan import NoPlanError, Plan
from wbc.walking.planner.planner import plan_walk
from wbc.walking.planner.swings.law import SwingLaw


@pytest.fixture(scope="module")
def plan(machine: Walker, structure: Structure) -> Plan:
    return plan_walk(machine, structure, grid_path([(13, 6), (13, 12)], 0.1016))


def at_the_first_lift(walk: Walk, plan: Plan) -> Walk:
    """The walk stands where its first hand is lifted."""
    grips, sample = walk.progress.grips, round(plan.regrasps[0].lift / plan.path.spacing)
    walk.progress.path_time = sample * plan.path.spacing
    q = walk.machine.q.copy()
    q[:7] = pin.SE3ToXYZQUAT(walk.progress.pose)
    for arm, grip in zip(walk.walker.arms, walk.progress.grip, strict=True):
        q[arm.q] = grips.posture_at(grip, sample)
    walk.machine.begin(q, walk.held)
    walk.stack.begin(q)
    return walk


def test_swings_are_foreseen_as_they_are(
    machine: Walker, structure: Structure, stack: WalkStack, plan: Plan, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Joints of all arms at every instant of a swing, as its proof had them, within what is between two knots."""
    seen = list[tuple[float, np.ndarray, np.ndarray]]()
    nearest = Foresight.nearest

    def kept(sight, times, q, left, to=(), held=None):  # type: ignore[no-untyped-def]
        seen.append((walk.time, times, q))
        return nearest(sight, times, q, left, to, held)

    monkeypatch.setattr(Foresight, "nearest", kept)
    walk = Walk(machine, structure, plan, stack=stack)
    at_the_first_lift(walk, plan).tick()
    begin, times, rows = seen[-1]
    swinging, worst = walk.swinging, 0.0
    while walk.swinging is swinging and walk.time < begin + 1.0:
        foreseen = np.array([np.interp(walk.time - begin, times, column) for column in rows.T])
        # Joint 6 moves nothing, and what follows the hand is a tick behind
        moved = np.delete(np.arange(machine.robot.nq - 7), [5, 11, 17]) + 7
        worst = max(worst, float(np.abs(foreseen - walk.q)[moved].max()))
        assert np.linalg.norm(foreseen[:3] - walk.q[:3]) < 2e-3
        walk.tick()
    assert worst < 0.03


def test_a_hand_goes_on_from_a_pause_slowly_and_as_foreseen(
    machine: Walker, structure: Structure, stack: WalkStack, plan: Plan
) -> None:
    walk = Walk(machine, structure, plan, stack=stack)
    at_the_first_lift(walk, plan).tick()
    swinging = walk.swinging
    assert swinging is not None
    while swinging.clock < 0.6 * swinging.law.duration:
        walk.tick()
    swinging.pauses, swinging.paused = True, 1
    while swinging.pauses:
        walk.tick()
    begin, foreseen = walk.time, walk._caution._foreseen  # type: ignore[union-attr]
    paces = [swinging.pace]
    while walk.swinging is swinging:
        walk.tick()
        paces.append(swinging.pace)
    assert max(paces) == pytest.approx(AFTER_PAUSE)
    assert max(np.diff(paces)) <= DT / RAMP_AGAIN + 1e-12
    assert foreseen is not None
    assert walk.time - begin == pytest.approx(foreseen[1][-1], abs=0.1)


def test_a_swing_into_what_no_plan_knew_is_not_begun(
    machine: Walker, structure: Structure, stack: WalkStack, plan: Plan
) -> None:
    law = plan.laws[0]
    ball = Obstacle("ball", Sphere(0.05), pin.SE3(np.eye(3), law.places[len(law.places) // 2]))
    walk = Walk(machine, replace(structure, obstacles=(ball,)), plan, stack=stack)
    refused = list[str]()
    walk._stop = lambda: refused.append(walk._refused)  # type: ignore[method-assign]
    at_the_first_lift(walk, plan).tick()
    step = plan.regrasps[0]
    assert refused[0].startswith(f"{step.arm} from {step.source} to {step.target}: ")
    assert "and obstacle ball: " in refused[0]
    assert len(walk.held) == 3


def test_a_start_within_something_is_refused_at_once(
    machine: Walker, structure: Structure, stack: WalkStack, plan: Plan
) -> None:
    upside_down = PlaneSurface(pin.SE3(pin.utils.rotate("x", np.pi), plan.path.poses[0][:3, 3]))
    walk = Walk(machine, replace(structure, surface=upside_down), plan, stack=stack)
    with pytest.raises(NoPlanError, match=r"where it stands two bodies are too near: .* and the surface"):
        walk.tick()


def test_everything_comes_to_rest_from_its_velocity(machine: Walker, plan: Plan, structure: Structure) -> None:
    q, v = np.array(machine.robot.neutral), np.zeros(machine.robot.nv)
    v[:3], v[machine.arms[0].v] = (0.1, 0.0, 0.0), 0.5 * machine.robot.limits.velocity[machine.arms[0].v]
    assert Coasting.of(machine, structure, State(q, {}), 0.25, DT) is None
    coasting = Coasting.of(machine, structure, State(q, {1: 0, 2: 1}, v=v), 0.25, DT)
    assert coasting is not None
    assert coasting.free == [0]
    assert coasting.duration >= 0.25
    np.testing.assert_allclose(coasting.end.translation, q[:3] + 0.5 * 0.25 * v[:3])
    at_rest = coasting.state(State(q, {1: 0, 2: 1}, v=v))
    assert at_rest.v is None
    assert at_rest.time == coasting.duration


def test_a_hand_comes_to_rest_over_its_hold(machine: Walker, structure: Structure, plan: Plan) -> None:
    """One that comes down on a moving body, at several heights and paces, goes neither aside of its hold nor into it,
    and asks for no more than its joints' accelerations."""
    chain, grips, hands = ClosedChain(machine, structure), plan.grips, machine.robot.limits
    assert grips is not None
    arm, q, v = machine.arms[0], np.array(machine.robot.neutral), np.zeros(machine.robot.nv)
    q[:7] = pin.SE3ToXYZQUAT(pin.SE3(plan.path.poses[0]))
    for mine, grip in zip(machine.arms, plan.chain, strict=True):
        q[mine.q] = grips.posture_at(grip[0], 0)
    hold = structure.index(plan.start[0])
    lifted = limb_of(machine).follow(
        (plan.path.poses[0] @ arm.base.homogeneous)[None, None],
        (structure.positions[hold] - 0.05 * structure.axes[hold])[None, None],
        q[arm.q][None, None, 3:],
        machine.margins,
    )[0][0, 0]
    for posture, fast in ((lifted, 0.3), (lifted, -0.3), (lifted, 1.0), (q[arm.q].copy(), 0.2)):
        q[arm.q], v[:6], v[arm.v] = posture, [0.1, 0.02, 0.0, 0.0, 0.0, 0.05], fast * (q[arm.q] - lifted) / 0.2
        if fast == 0.2:
            v[arm.v][0] = 0.05
        state = State(q, {1: 0, 2: 1}, v=v)
        coasting = Coasting.of(machine, structure, state, 0.25, DT)
        assert coasting is not None
        assert coasting.over == {0: hold}
        chain.place(coasting.state(state).q)
        offset = chain.origins[0] - structure.positions[hold]
        height = float(-structure.axes[hold] @ offset)
        assert height > -1e-9
        assert np.linalg.norm(offset + height * structure.axes[hold]) < 1e-9
        rows = coasting._postures[0]
        rates = np.concatenate([v[arm.v][None], np.diff(rows, axis=0) / DT, np.zeros((1, 6))])
        assert (np.abs(np.diff(rates, axis=0)) <= DT * hands.acceleration[arm.v]).all()


def test_a_swing_waits_for_a_hand_that_leaves_its_hold_late() -> None:
    """Aims 10 mm ahead of a hand that may still be near to what it held are waited for; farther on they are not."""
    times = np.linspace(0.0, 1.0, 201)
    places = np.stack([np.zeros(201), np.zeros(201), times], axis=1)
    swinging = Swinging(0, 0, 0, SwingLaw(times, places, times), latch=0.0, state="open")
    for time, slow in ((0.05, True), (0.5, False)):
        swinging.aim = swinging.law.at(time)
        place = swinging.aim.position - [0.0, 0.0, 0.01]
        pace = hand_pace(swinging, place, True, 0.0, 1.0, (time - 0.01, 1.01 - time))
        assert pace == pytest.approx(LEAST_PACE if slow else 1.0)


def test_a_swing_is_proven_anew_where_the_body_is_to_stop_before_the_hand_holds(
    machine: Walker, structure: Structure, stack: WalkStack, plan: Plan, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As while another course is planned; and again when it may go on."""
    walk = Walk(machine, structure, plan, stack=stack)
    at_the_first_lift(walk, plan).tick()
    swinging, proven = walk.swinging, list[float]()
    assert swinging is not None
    real = Caution.swing
    monkeypatch.setattr(Caution, "swing", lambda *given: (proven.append(given[2].end), real(*given))[1])
    walk._foresee()
    assert proven == []
    for limit in ((walk.path_time + 0.05, 1), None):
        walk.limit = limit
        for _ in range(2):
            walk._foresee()
    assert proven == [pytest.approx(walk.path_time + 0.05), walk._before_landing(swinging)]


@pytest.mark.parametrize("lasts", [0.0, 1.0])
def test_a_swing_that_is_not_clear_is_refused_while_the_body_can_stop_within_the_grip_of_its_hand(
    machine: Walker, structure: Structure, stack: WalkStack, plan: Plan, monkeypatch: pytest.MonkeyPatch, lasts: float
) -> None:
    """An arm whose grip ends where it was to be lifted would be pulled straight; one that can hold on is not looked at
    before.
    """
    lift, spacing = plan.regrasps[0].lift, plan.path.spacing
    walk = Walk(machine, structure, plan, stack=stack)
    walk.progress.path_time, walk.body.pace = lift - 0.2, 1.0
    ends, grip = list(walk.progress.grips.ends_at(spacing)), walk.progress.grip[walk.progress.arm_of(plan.regrasps[0])]
    ends[grip] = lift + lasts
    monkeypatch.setattr(type(walk.progress.grips), "ends_at", lambda _self, _spacing: ends)
    lifts = list[tuple[float, float]]()

    def looked(_self: Caution, swinging: Swinging, course: Course) -> str:
        lifts.append((swinging.latch, course.lifts))
        return "something"

    refused = list[tuple[str, object]]()
    monkeypatch.setattr(Caution, "looked", looked)
    monkeypatch.setattr(Walk, "_refuse", lambda _self, *given: refused.append(given))
    for _ in range(2):
        walk._look_ahead(plan.regrasps[0])
    step = plan.regrasps[0]
    assert refused == ([] if lasts else [(f"{step.arm} from {step.source} to {step.target}", "something")])
    assert all(one == (machine.arm_data.latch_time, lift) for one in lifts)
    assert bool(lifts) is (lasts == 0.0)


def test_a_swing_is_foreseen_from_where_its_hand_is_lifted(
    machine: Walker, structure: Structure, stack: WalkStack, plan: Plan
) -> None:
    """Of a body that has hardly begun to move, as after a hand that was waited for, too: it speeds up until then."""
    step = plan.regrasps[0]
    walk = Walk(machine, structure, plan, stack=stack)
    walk.progress.path_time, walk.body.pace = step.lift - 0.05, 0.02
    caution, swinging = walk._caution, walk._next_swing(step)
    assert caution is not None
    for pace, stands in ((0.02, False), (1.0, False), (0.02, True)):
        walk.body.pace = pace
        when = caution.timing(swinging, walk._course(swinging)._replace(lifts=step.lift, stands=stands))
        opened = int(np.flatnonzero(when.clock > 0.0)[0])
        lifted = float(np.interp(step.lift, when.path_times, when.times)) if not stands else 0.0
        assert when.times[opened] == pytest.approx(lifted + machine.arm_data.latch_time, abs=0.06)
        assert stands or when.path_times[opened] >= step.lift


def test_a_slow_hand_and_the_body_that_waits_for_it_keep_their_order(
    machine: Walker, structure: Structure, stack: WalkStack, plan: Plan
) -> None:
    """A hand whose joints allow a part of its pace makes the body as slow, and is not early because that is."""
    walk = at_the_first_lift(Walk(machine, structure, plan, stack=stack), plan)
    walk.body.pace = 1.0
    step, caution = plan.regrasps[0], walk._caution
    assert caution is not None
    swinging = walk._next_swing(step)
    swinging.part = 0.6
    when = caution.timing(swinging, walk._course(swinging))
    planned = np.clip(when.path_times - step.lift - machine.arm_data.latch_time, 0.0, swinging.law.duration)
    assert np.abs(when.clock - planned).max() < 0.25
    swinging.state, left = "open", swinging.law.duration
    full = hand_pace(swinging, swinging.aim.position, True, left, 0.6, (1.0, 1.0))
    assert full == pytest.approx(1.0)
    assert hand_pace(swinging, swinging.aim.position, True, left, 0.5, (1.0, 1.0)) < 0.7


def test_a_body_slows_down_before_a_corner(plan: Plan) -> None:
    here, there = pin.SE3.Identity(), pin.SE3(np.eye(3), np.array([0.2, 0.0, 0.0]))
    path = straight_path([here, there, here], 0.1)
    corners = Corners(path, 0.25)
    assert corners.pace(0.0) == 1.0
    assert corners.pace(0.5 * path.duration) == pytest.approx(np.sqrt(BENDING * path.spacing / 0.2), rel=1e-6)
    body, u, places = BodyMotion(DT, Stops(DT)), 0.0, []
    while u < path.duration - 0.1:
        body.choose(10.0, 10.0, None, False, corners.pace(u))
        _, u = body.go(path, u)
        places.append(body.pose[:3].copy())
    speeds = np.diff(places, axis=0) / DT
    # Where it bends, and where it brakes
    most = max(BENDING, 0.1 / Stops(DT).brake) * DT
    assert np.abs(np.diff(speeds, axis=0)).max() < 1.2 * most
    smooth = Corners(BodyPath(plan.path.poses, plan.path.spacing), 0.25)
    assert min(smooth.pace(u) for u in np.linspace(0.0, plan.path.duration - 0.01, 50)) >= 1.0


def test_slow_joints_take_longer_to_stop(machine: Walker) -> None:
    assert Stops.of(machine, DT) == Stops(DT)
    slow = replace(machine, robot=machine.robot.with_limits(acceleration=machine.robot.limits.acceleration / 8.0))
    assert Stops.of(slow, DT).brake == pytest.approx(8.0 * Stops(DT).brake)


@pytest.mark.parametrize(("field", "value"), [("forearm_length", 0.5), ("acceleration_time", 2.0)])
def test_numbers_of_another_robot_are_refused(machine: Walker, field: str, value: float) -> None:
    check_fits(machine)
    with pytest.raises(RangeError, match="robot"):
        check_fits(replace(machine, data=WalkerData.read(**{field: value})))


def test_an_elbow_that_strays_is_seen_although_the_hand_does_not(
    machine: Walker, structure: Structure, stack: WalkStack, plan: Plan
) -> None:
    walk = Walk(machine, structure, plan, stack=stack)
    at_the_first_lift(walk, plan).tick()
    swinging, caution, limb = walk.swinging, walk._caution, limb_of(machine)
    assert swinging is not None
    assert caution is not None
    arm, q = machine.arms[swinging.arm], walk.machine.q.copy()
    caution._foreseen = walk.time, np.array([0.0, 1.0]), np.repeat(caution._places(swinging.arm, q[None]), 2, axis=0)
    assert not caution.strays(swinging)
    frame = (pin.XYZQUATToSE3(q[:7]) * arm.base).homogeneous
    guide = q[arm.q][limb.guided :] + [0.3, 0.1, 0.0]
    places = caution.sight.hand(swinging.arm, q[None])[None]
    walk.machine.q[arm.q] = limb.follow(frame[None, None], places, guide[None, None], machine.margins)[0][0, 0]
    np.testing.assert_allclose(caution.sight.hand(swinging.arm, walk.machine.q[None]), places[0], atol=1e-9)
    assert caution.strays(swinging)


def test_a_swing_is_slower_where_its_arm_has_no_room_to_lag(
    machine: Walker, structure: Structure, stack: WalkStack, plan: Plan, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Joints that need more than their accelerations; what the arm keeps from all else decides. A hand whose joints
    need more than their rates is slower anywhere.
    """
    walk = Walk(machine, structure, plan, stack=stack)
    at_the_first_lift(walk, plan).tick()
    swinging, caution = walk.swinging, walk._caution
    assert swinging is not None
    assert caution is not None
    course = walk._course(swinging)
    monkeypatch.setattr(Caution, "_needs", lambda _self, _swinging, _times: (0.9, 1.2))
    times, rows = np.array([0.0, 1.0]), np.repeat(walk.q[None], 2, axis=0)
    close = caution.sight.close(times, rows, swinging.arm)
    pairs = caution.sight._bringing[swinging.arm]
    here = caution.sight._sweeper.at(caution.sight.motion(times, rows), 0.0, pairs)
    assert close is (min(near.distance - near.required for near in here) < LAGS)
    for near_by in (False, True):
        monkeypatch.setattr(Foresight, "close", lambda *_given, near_by=near_by: near_by)
        assert caution.swing(swinging, course) is None
        assert (swinging.part < 1.0) is near_by
    swinging.part = 1.0
    monkeypatch.setattr(Caution, "_needs", lambda _self, _swinging, _times: (1.2, 0.0))
    monkeypatch.setattr(Foresight, "close", lambda *_given: False)
    assert caution.swing(swinging, course) is None
    assert swinging.part == pytest.approx(RATE / 1.2)


def test_a_hand_at_the_end_of_its_reach_comes_to_rest_nearer_to_the_body(
    machine: Walker, structure: Structure, plan: Plan
) -> None:
    """One that has just left its hold, from which the body goes away."""
    limb, grips, arm = limb_of(machine), plan.grips, machine.arms[0]
    assert grips is not None
    q, v = np.array(machine.robot.neutral), np.zeros(machine.robot.nv)
    q[:7] = pin.SE3ToXYZQUAT(pin.SE3(plan.path.poses[0]))
    for mine, grip in zip(machine.arms, plan.chain, strict=True):
        q[mine.q] = grips.posture_at(grip[0], 0)
    q[arm.q] = [0.0, 1.5, -0.15, 0.0, 0.5, 0.0]
    outward = q[:3] - pin.XYZQUATToSE3(q[:7]).act(arm.base.translation)
    v[:3] = pin.XYZQUATToSE3(q[:7]).rotation.T @ outward
    v[:3] *= 0.1 / np.linalg.norm(v[:3])
    coasting = Coasting.of(machine, structure, State(q, {1: 0, 2: 1}, v=v), 0.25, DT)
    assert coasting is not None
    assert limb.margins(coasting._postures[0][-1]).min() >= machine.margins.held_angle


def test_joints_come_to_rest_as_fast_as_they_can() -> None:
    rng = np.random.default_rng(0)
    for _ in range(100):
        q, v, end = rng.normal(size=(3, 4)) * [[0.1], [1.0], [0.1]]
        most = rng.uniform(3.0, 9.0, 4)
        rows = quickest(q, v, end, most, DT, 0.25)
        assert len(rows) >= 26
        np.testing.assert_array_equal(rows[0], q)
        np.testing.assert_allclose(rows[-1], end, atol=1e-12)
        rates = np.concatenate([v[None], np.diff(rows, axis=0) / DT, np.zeros((1, 4))])
        assert (np.abs(np.diff(rates, axis=0)) <= DT * most * (1.0 + 1e-9)).all()


def test_a_hand_that_swings_about_closes_when_it_has_rested_for_a_while(
    machine: Walker, structure: Structure, stack: WalkStack, plan: Plan, monkeypatch: pytest.MonkeyPatch
) -> None:
    hands, law = Walk(machine, structure, plan, stack=stack).hands, plan.laws[0]
    for steady, rested, closes in ((1, [False, True], 2), (3, [True, True, False, True, True, True], 6)):
        swinging = Swinging(0, 0, 0, law, latch=0.0, state="open", clock=law.duration, steady=steady)
        for tick, rests in enumerate(rested, start=1):
            monkeypatch.setattr(hands, "rests", lambda *_, rests=rests: rests)
            assert not hands.settle(swinging)
            assert (swinging.state == "closing") is (tick == closes)


def test_little_is_proven_twice(machine: Walker, structure: Structure, stack: WalkStack, plan: Plan) -> None:
    walk = Walk(machine, structure, plan, stack=stack)
    walk.tick()
    caution = walk._caution
    assert isinstance(caution, Caution)
    until = caution.until
    assert 0.0 < until <= 1.0
    assert caution.ahead(plan.path.duration) is None
    assert caution.until == until


def test_a_hand_whose_body_goes_elsewhere_is_no_faster_than_its_joints_can(
    machine: Walker, structure: Structure, stack: WalkStack, plan: Plan, monkeypatch: pytest.MonkeyPatch
) -> None:
    walk = Walk(machine, structure, plan, stack=stack)
    at_the_first_lift(walk, plan).tick()
    caution, swinging = walk._caution, walk.swinging
    assert caution is not None
    assert swinging is not None
    # Joint 1 speeds up four times as hard as it can; of joint 4, which does not lead the hand's place, only rates count
    times, arm = SETTLED + 1e-3 * np.arange(6), machine.arms[swinging.arm]
    for joint, fastest in ((0, 2.0), (3, 0.1)):
        caution._rows = np.zeros((6, machine.robot.nq))
        changes = 2.0 * machine.robot.limits.acceleration[arm.v.start + joint] * (times - SETTLED) ** 2
        caution._rows[:, arm.q.start + joint] = changes
        assert max(caution._needs(swinging, times)) == pytest.approx(fastest, rel=1e-6 if joint == 0 else 0.9)
    monkeypatch.setattr(caution, "_needs", lambda _swinging, _times: (0.5, 1.5))
    course = walk._course(swinging)
    assert caution.swing(swinging, course) is None
    assert swinging.part == 1.0
    # It was planned for the path that the body was on when it was lifted
    caution._known = None, swinging, False, course.end
    caution.swing(swinging, course)
    assert swinging.part == pytest.approx(RATE / 1.5)


def test_a_hand_may_be_near_what_a_hold_is_on_until_it_has_left_that_hold(
    machine: Walker, structure: Structure, stack: WalkStack, plan: Plan
) -> None:
    """A hand that comes back to a hold from beyond its neighbourhood is as far from everything as any link."""
    walk = Walk(machine, structure, plan, stack=stack)
    sight, arm = Foresight(machine, structure), machine.arms[1]
    place, held = structure.positions[walk.held[1]], {k: hold for k, hold in walk.held.items() if k != 1}
    near, far = walk.q.copy(), walk.q.copy()
    for q, up in ((near, 0.05), (far, 0.12)):
        pose = arm.base.actInv(pin.XYZQUATToSE3(q[:7]).actInv(lifted(walk, 1, up)))
        found, valid = limb_of(machine).inverse(pose.homogeneous[None])
        q[arm.q] = limb_of(machine).nearest(found, valid, q[arm.q])[0]
    times = np.array([0.0, 1.0, 2.0])
    left, to = [(1, place)], [(1, place)]
    assert sight.nearest(times, np.array([near, near, near]), left, held=held) is None
    assert sight.nearest(times, np.array([near, far, far]), left, held=held) is None
    assert sight.nearest(times, np.array([near, far, near]), left, held=held) is not None
    assert sight.nearest(times, np.array([near, far, near]), left, to, held) is None


def lifted(walk: Walk, arm: int, up: float) -> pin.SE3:
    """Of a hand that is moved off its hold along its own axis [m]."""
    origin, z, x = walk.machine.hand(arm)
    return pin.SE3(np.column_stack([x, np.cross(z, x), z]), origin - up * z)


def test_a_machine_forgets_the_holds_that_its_hands_have_left(
    machine: Walker, structure: Structure, stack: WalkStack, plan: Plan
) -> None:
    walk = Walk(machine, structure, plan, stack=stack)
    place, near = structure.positions[walk.held[1]], machine.arm_data.exempt_distance
    walk.machine.open(1)
    z = np.array([0.0, 0.0, 1.0])
    for before, now, kept in ((0.0, 0.9, 1), (1.2, 1.1, 1), (0.99, 1.01, 0)):
        walk.machine.left[1] = [place]
        walk.machine.chain.origins[1] = place + before * near * z
        walk.machine._place = at_once(walk, place + now * near * z)  # type: ignore[method-assign]
        walk.machine.move(np.zeros(machine.robot.nv))
        assert len(walk.machine.left[1]) == kept


def at_once(walk: Walk, place: np.ndarray):  # type: ignore[no-untyped-def]
    """What takes the second hand to a place."""

    def put(_joints: np.ndarray) -> float:
        walk.machine.chain.origins = walk.machine.chain.origins.copy()
        walk.machine.chain.origins[1] = place
        return 0.0

    return put
