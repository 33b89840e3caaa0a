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
from wbc.walking.body_path import BodyPath, grid_path, straight_path
from wbc.walking.loop.body_command import BENDING, BodyMotion, Corners
from wbc.walking.loop.caution import Caution
from wbc.walking.loop.coasting import Coasting
from wbc.walking.loop.foresight import Foresight
from wbc.walking.loop.hand_pace import RAMP_AGAIN
from wbc.walking.loop.stack import DT, WalkStack
from wbc.walking.loop.state import AFTER_PAUSE, State
from wbc.walking.loop.stopping import Stops
from wbc.walking.loop.walk import Walk
from wbc.walking.planner.plan import NoPlanError, Plan
from wbc.walking.planner.planner import plan_walk


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

    def kept(sight, times, q, at, held=None):  # type: ignore[no-untyped-def]
        seen.append((walk.time, times, q))
        return nearest(sight, times, q, at, held)

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
    np.testing.assert_allclose(coasting.end.translation, q[:3] + 0.5 * coasting.duration * v[:3])
    at_rest = coasting.state(State(q, {1: 0, 2: 1}, v=v))
    assert at_rest.v is None
    assert at_rest.time == coasting.duration


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


def test_little_is_proven_twice(machine: Walker, structure: Structure, stack: WalkStack, plan: Plan) -> None:
    walk = Walk(machine, structure, plan, stack=stack)
    walk.tick()
    caution = walk._caution
    assert isinstance(caution, Caution)
    until = caution.until
    assert 0.0 < until <= 1.0
    assert caution.ahead(plan.path.duration) is None
    assert caution.until == until
