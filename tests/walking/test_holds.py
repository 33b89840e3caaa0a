"""Holds as they are declared: rolls in grips, hands that lean, and a walk over holds of all kinds."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest

from wbc.errors import RangeError
from wbc.robots import Walker
from wbc.walking import ArmKinematics, Structure
from wbc.walking.body_path import BodyPath, grid_path
from wbc.walking.checker import Rules, check_walk
from wbc.walking.checker.body import Hands, estimate
from wbc.walking.checker.holds import HoldTable
from wbc.walking.loop.closed_chain import ClosedChain
from wbc.walking.loop.stack import WalkStack
from wbc.walking.loop.walk import Tick, Walk
from wbc.walking.planner.grips.rolls import ANY, frame_on, turns
from wbc.walking.planner.grips.table import Grips, find_grips, grip_slices
from wbc.walking.planner.grips.tilt import TILT_PART, leaning
from wbc.walking.planner.planner import plan_walk
from wbc.walking.planner.slices import drained
from wbc.walking.run.recording import WalkRecorder

INCH = 0.0254


@pytest.fixture(scope="module")
def path() -> BodyPath:
    return grid_path([(13, 11), (13, 13)], 4 * INCH)


def declared(structure: Structure, *kinds: tuple[str | int, float]) -> Structure:
    """The structure with other kinds of holds, in turn."""
    holds = [(hold, kinds[k % len(kinds)]) for k, hold in enumerate(structure.holds)]
    return replace(structure, holds=tuple(replace(hold, roll=roll, max_tilt=tilt) for hold, (roll, tilt) in holds))


def hands(walker: Walker, path: BodyPath, grips: Grips, grip: int) -> np.ndarray:
    """Poses of the hand along a grip, in the structure ``[samples, 4, 4]``."""
    samples = np.arange(grips.first[grip], grips.last[grip] + 1)
    postures = grips.posture(np.full(len(samples), grip), samples)
    base = walker.arms[grips.arm[grip]].base.homogeneous
    return np.asarray(path.poses[samples] @ base @ ArmKinematics(walker.arm_data).forward(postures))


def test_a_hand_that_holds_keeps_its_roll_where_another_would_do(machine: Walker, structure: Structure) -> None:
    """Of several rolls the table has the best; a hand that is there already cannot change."""
    held, path = declared(structure, (8, 0.0)), grid_path([(13, 12), (13, 12.3)], 4 * INCH)
    best = find_grips(machine, held, path)
    limit = machine.data.position_limits[5] - machine.margins.held_angle
    grip = next(g for g in range(len(best)) if best.first[g] == 0 and best.postures[best.offset[g], 5] < limit - 1.0)
    arm, hold, branch = (int(of[grip]) for of in (best.arm, best.hold, best.branch))
    angle = float(best.posture_at(grip, 0)[5]) + np.pi / 4

    def rolls(grips: Grips) -> set[int]:
        mine = (grips.arm == arm) & (grips.hold == hold) & (grips.branch == branch)
        near = [g for g in np.flatnonzero(mine) if abs(grips.posture_at(g, 0)[5] - angle) < 1e-6]
        return {int(grips.roll[g]) for g in near}

    kept = drained(grip_slices(machine, held, path, holding={(arm, hold): (0, angle)}))
    assert rolls(best) == set()
    assert rolls(kept) == {(int(best.roll[grip]) + 1) % 8}
    assert len(kept) == len(best) + 1


@pytest.mark.parametrize(("roll", "tilt"), [("fixed", 0.0), (4, 0.0), (4, 0.05)])
def test_grips_have_the_roll_of_their_hold(
    machine: Walker, structure: Structure, path: BodyPath, roll: str | int, tilt: float
) -> None:
    held = declared(structure, (roll, tilt))
    grips = find_grips(machine, held, path)
    limit, rate = machine.data.position_limits[5], machine.data.joint_rates[5]
    assert len(grips) > 50
    numbers = set()
    for grip in range(len(grips)):
        wanted = frame_on(held, int(grips.hold[grip]), int(grips.roll[grip]))
        placed = hands(machine, path, grips, grip)
        assert np.abs(placed[:, :3, 3] - wanted[:3, 3]).max() < 1e-9
        # x is nearest to its direction; a hand that leans takes it with it
        assert np.abs(placed[:, :3, 0] @ wanted[:3, 1]).max() < 1e-9 + tilt**2
        assert (placed[:, :3, 2] @ wanted[:3, 2]).min() > np.cos(TILT_PART * tilt) - 1e-12
        sixth = grips.posture(np.array(grip), np.arange(grips.first[grip], grips.last[grip] + 1))[:, 5]
        assert np.abs(sixth).max() < limit
        assert np.abs(np.diff(sixth)).max() < rate * path.spacing
        numbers.add(int(grips.roll[grip]))
    assert numbers == ({0} if roll == "fixed" else {0, 1, 2, 3})
    assert set(find_grips(machine, structure, path).roll.tolist()) == {ANY}


def test_a_compliant_hold_can_be_held_wherever_the_exact_one_can(
    machine: Walker, structure: Structure, path: BodyPath
) -> None:
    exact, ball = find_grips(machine, structure, path), find_grips(machine, declared(structure, ("free", 0.05)), path)
    spans: dict[tuple[int, int, int], list[tuple[int, int]]] = {}
    for k in range(len(ball)):
        key = int(ball.arm[k]), int(ball.hold[k]), int(ball.branch[k])
        spans.setdefault(key, []).append((int(ball.first[k]), int(ball.last[k])))
    for k in range(len(exact)):
        key = int(exact.arm[k]), int(exact.hold[k]), int(exact.branch[k])
        assert any(a <= exact.first[k] and exact.last[k] <= b for a, b in spans[key])
    assert (ball.last - ball.first + 1).sum() > (exact.last - exact.first + 1).sum()


def test_a_hand_leans_as_far_as_it_needs_and_may() -> None:
    kinematics = ArmKinematics()
    # Out of reach by little: sideways of the shoulder, the hand straight down
    points, axes = np.array([[0.83, 0.15, 0.85]] * 3), np.array([[0.0, 0.0, 1.0]] * 3)
    reach = float(kinematics.wrist_reach(kinematics.wrist_of(points, axes))[0])
    out = leaning(kinematics, points, axes, np.array([0.0, 0.02, 0.3]), reach + 0.005)
    angle = np.arccos(out[:, 2])
    assert angle[0] == 0.0
    assert angle[1] == pytest.approx(TILT_PART * 0.02)
    assert TILT_PART * 0.02 < angle[2] < TILT_PART * 0.3
    after = kinematics.wrist_reach(kinematics.wrist_of(points, out))
    assert after[2] == pytest.approx(reach + 0.005, abs=5e-4)
    assert reach < after[1] < after[2]


def test_turns_of_joint_6() -> None:
    whole = 2 * np.pi
    ramp = np.linspace(-1.0, 1.0, 41)
    (both, other) = turns(ramp + np.pi, (0.0,), 4.7, 0.1, 3)  # half a turn off: two ways, both whole
    assert {round(float(both.angles[0] - other.angles[0]), 9)} <= {round(whole, 9), round(-whole, 9)}
    (one,) = turns(ramp + 3.0, (0.0, whole / 4, whole / 2, 3 * whole / 4), 4.7, 0.1, 3)
    assert np.abs(one.angles).max() < 1.0 + whole / 8 + 1e-9
    assert (one.first, one.last, one.ends) == (0, 40, "")
    # Farther than the joint goes: pieces that overlap by what two turns share
    pieces = sorted(turns(np.linspace(0.0, 12.0, 241), (0.0,), 4.7, 0.1, 3), key=lambda piece: piece.first)
    assert pieces[0].first == 0
    assert pieces[-1].last == 240
    assert all(a.last >= b.first and a.ends == "limit" for a, b in pairwise(pieces))
    jump = np.r_[np.zeros(10), np.full(10, 0.5)]
    assert [(t.first, t.last, t.ends) for t in turns(jump, (0.0,), 3.0, 0.1, 3)] == [(0, 9, "rate"), (10, 19, "")]


@pytest.mark.parametrize("roll", ["free", 3])
def test_ball_holds_fix_the_hands_places_exactly(
    machine: Walker, structure: Structure, path: BodyPath, roll: str | int
) -> None:
    """Joints that lean the hands: origins are kept, the roll too, and the checker finds the same body."""
    held = declared(structure, (roll, 0.05))
    grips, rng = find_grips(machine, held, path), np.random.default_rng(3)
    chain, body = ClosedChain(machine, held), path.poses[0]
    q = np.array(machine.robot.neutral)
    q[:3], q[3:7] = body[:3, 3], pin.Quaternion(body[:3, :3]).coeffs()
    holds: dict[int, int] = {}
    kinematics = ArmKinematics(machine.arm_data)
    for arm in range(3):
        grip = int(next(g for g in grips.of_arm(arm) if grips.first[g] == 0 and grips.hold[g] not in holds.values()))
        holds[arm] = int(grips.hold[grip])
        frame = pin.SE3(frame_on(held, holds[arm], int(grips.roll[grip])))
        lean = pin.exp3(np.append(rng.uniform(-0.02, 0.02, 2), 0.0))
        local = (pin.SE3(body) * machine.arms[arm].base).inverse() * frame * pin.SE3(lean, np.zeros(3))
        found, valid = kinematics.inverse(local.homogeneous[None])
        q[machine.arms[arm].q] = found[0, int(np.argmax(valid[0]))]
    moved = q.copy()
    moved[:3] += 0.004  # what is left is found from the joints
    out, slip = chain.settle(moved, holds)
    assert slip < 1e-6
    assert np.abs(out[:3] - body[:3, 3]).max() < 1e-6
    count = np.array([0 if roll == "free" else roll] * len(held))
    table = HoldTable(held.positions, held.frames[:, :3, :3], count, held.tilts)
    here = pin.Quaternion(out[3:7]).matrix()
    turns_of = [np.column_stack([x, np.cross(z, x), z]) for x, z in zip(chain.x_axes, chain.axes, strict=True)]
    local_hands = Hands((chain.origins - out[:3]) @ here, here.T @ np.array(turns_of))
    near = Hands(local_hands.position[None], local_hands.rotation[None])
    rows, yes = np.array([[holds[arm] for arm in range(3)]]), np.ones((1, 3), dtype=bool)
    checked = estimate(near, rows, yes, table, moved[None, :3], here[None])
    # A turn about an axis across z has a little roll, the product of its parts
    assert np.abs(checked.position[0] - body[:3, 3]).max() < 1e-5
    assert not checked.open.any()


def test_a_walk_over_holds_of_all_kinds(machine: Walker, structure: Structure, tmp_path) -> None:  # type: ignore[no-untyped-def]
    sums = [sum(int(n) for n in hold.id.split(",")) % 3 for hold in structure.holds]
    mixed = declared(structure, *([("fixed", 0.0), (4, 0.05), ("free", 0.05)][k] for k in sums))
    stack = WalkStack(machine, mixed, collisions=False)
    walk = Walk(machine, mixed, plan_walk(machine, mixed, grid_path([(13, 10), (13, 14)], 5 * INCH)), stack=stack)
    recorder, ticks = WalkRecorder(walk, 0, {}), list[Tick]()

    def on_tick(tick: Tick) -> None:
        ticks.append(tick)
        recorder.tick(tick)

    assert walk.run(on_tick) == "arrived"
    assert all(tick.status == "solved" for tick in ticks)
    assert max(tick.slip for tick in ticks) < 0.001
    used = {mixed.holds[hold].roll for tick in ticks for hold in tick.holds}
    assert len(used) == 3
    log, _ = recorder.log()
    report = check_walk(log, machine.urdf(tmp_path / "robot.urdf"), mixed, Rules(sub_samples=1))
    assert report.ok, str(report)
    assert report["held hand's roll"].worst < np.radians(0.25)


def test_a_stack_knows_what_it_was_compiled_for(machine: Walker, structure: Structure, stack: WalkStack) -> None:
    stack.structure = declared(structure, (4, 0.0))
    with pytest.raises(RangeError, match="compiled for holds of the kinds axis"):
        stack.hold(0, 3, 1)
    stack.structure = structure
    stack.hold(0, 3)
