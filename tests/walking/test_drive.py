"""Velocity mode: the body does what it is told, as long as hands can be planned for it."""

from __future__ import annotations

import pathlib
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import wbc.walking.modes.drive as driving
from wbc.errors import NotFiniteError, RangeError, ShapeError
from wbc.robots import Walker
from wbc.walking import Structure, plane, remove_rows
from wbc.walking.checker import Rules, check_walk
from wbc.walking.holds.built_in import grid_pose
from wbc.walking.loop.stack import WalkStack
from wbc.walking.loop.walk import Tick, Walk
from wbc.walking.modes.commands import CommandTable, NumberTableError, read_commands
from wbc.walking.modes.courses import Course, course_slices
from wbc.walking.modes.drive import Drive, standing_plan
from wbc.walking.modes.steering import Steering
from wbc.walking.planner.plan import NoPlanError, Plan
from wbc.walking.run.recording import WalkRecorder

INCH = 0.0254
HEIGHT = 52 * INCH


@pytest.fixture(scope="module")
def begin(machine: Walker, structure: Structure) -> Plan:
    return standing_plan(machine, structure, grid_pose(13, 11, 100 * INCH + HEIGHT))


def drive_on(drive: Drive, recorder: WalkRecorder, seconds: float, *rates: float) -> list[Tick]:
    """Ticks with one command."""
    out, end = list[Tick](), drive.walk.time + seconds
    while drive.walk.time < end - 1e-9:
        drive.steer(*rates)
        out.append(drive.tick())
        recorder.tick(out[-1])
    return out


def speeds(ticks: Sequence[Tick]) -> np.ndarray:
    """(round, along) [m/s] from the first to the last tick of a body over row 13."""
    way = ticks[-1].q[:3] - ticks[0].q[:3]
    return np.array([way[0], -way[2]]) / (ticks[-1].time - ticks[0].time)


def test_there_and_back_and_stop(
    machine: Walker, structure: Structure, stack: WalkStack, begin: Plan, tmp_path: pathlib.Path
) -> None:
    walk = Walk(machine, structure, begin, stack=stack)
    drive, recorder = Drive(walk), WalkRecorder(walk)
    still = drive_on(drive, recorder, 0.5, 0.0, 0.0, 0.0)
    there = drive_on(drive, recorder, 2.0, 0.0, 4 * INCH, 0.0)
    back = drive_on(drive, recorder, 2.5, 0.0, -4 * INCH, 0.0)
    last = drive_on(drive, recorder, 0.5, 0.0, 0.0, 0.0)
    ticks = (*still, *there, *back, *last)
    assert np.abs(still[-1].q - still[0].q).max() < 1e-6
    # After a ramp it keeps the pace, and it turns when the hand in the air is down
    assert speeds(there[75:])[1] == pytest.approx(4 * INCH, rel=0.02)
    assert speeds(back[150:220])[1] == pytest.approx(-4 * INCH, rel=0.02)
    assert np.abs(np.diff([tick.q[0] for tick in ticks])).max() < 1e-4
    assert max(tick.body_error for tick in ticks) < 0.002
    assert max(tick.slip for tick in ticks) < 0.001
    assert np.abs(last[-1].q[:3] - last[-10].q[:3]).max() < 1e-5
    assert sum(event.what == "lift" for event in walk.events) == len(walk.progress.steps) >= 1
    log, _ = recorder.log()
    report = check_walk(log, machine.urdf(tmp_path / "robot.urdf"), structure, Rules(sub_samples=1))
    assert report.ok, str(report)


def test_a_second_walk_on_a_stack_is_as_the_first(machine: Walker, structure: Structure, begin: Plan) -> None:
    stack, found = WalkStack(machine, structure, collisions=False), []
    for _ in range(2):
        walk = Walk(machine, structure, begin, stack=stack)
        drive, recorder = Drive(walk), WalkRecorder(walk)
        found.append([tick.q for tick in drive_on(drive, recorder, 1.5, 0.0, 4 * INCH, 0.0)])
        assert walk.swinging is not None or walk.events
    np.testing.assert_array_equal(found[0], found[1])


def test_a_hand_that_could_not_hold_on_the_new_way_lands_first(
    machine: Walker, structure: Structure, stack: WalkStack
) -> None:
    walk = Walk(
        machine, structure, standing_plan(machine, structure, grid_pose(13, 12, 100 * INCH + HEIGHT)), stack=stack
    )
    drive = Drive(walk)
    drive.steer(0.1, 0.0, 0.0)
    while walk.swinging is None or walk.swinging.clock < 0.3:
        drive.tick()
    path, arm, hold = walk.plan.path, walk.swinging.arm, walk.swinging.hold
    drive.steer(-0.1, 0.0, 0.0)
    reasons = []
    for _ in range(4):
        drive.tick()
        reasons.append(drive.reason)
    # There is a plan at once all the same
    assert "cannot hold it on the new path" in " ".join(reasons)
    assert walk.plan.path is not path
    while walk.swinging is not None:
        drive.tick()
    assert walk.held[arm] == hold
    turned, place = walk.time, walk.q[0]
    while walk.time < turned + 2.0:
        drive.tick()
    assert walk.q[0] < place - 0.05


def test_a_body_goes_aside_and_tilts_as_far_as_it_may_and_comes_back(
    machine: Walker, structure: Structure, stack: WalkStack, begin: Plan, monkeypatch: pytest.MonkeyPatch
) -> None:
    walk = Walk(machine, structure, begin, stack=stack)
    drive, recorder = Drive(walk), WalkRecorder(walk)
    with monkeypatch.context() as patch:
        patch.setattr(driving, "ALTERNATIVES", ((1.0, (0.0, 1.0, 0.0, 1.0)),))
        away = drive_on(drive, recorder, 2.2, 0.0, 0.08, 0.0)
    back = drive_on(drive, recorder, 2.2, 0.0, 0.081, 0.0)
    first = pin.XYZQUATToSE3(away[0].q[:7])
    tilts = [np.linalg.norm(pin.log3(first.rotation.T @ pin.XYZQUATToSE3(t.q[:7]).rotation)) for t in (*away, *back)]
    aside = np.array([abs(tick.q[0] - away[0].q[0]) for tick in (*away, *back)])
    assert tilts[len(away) - 1] == pytest.approx(np.radians(3.0), abs=1e-3)
    assert aside[len(away) - 1] == pytest.approx(2 * INCH, abs=1e-3)
    assert max(tilts) < np.radians(3.0) + 1e-3
    assert aside.max() < 2 * INCH + 1e-3
    assert tilts[-1] < 1e-3
    assert aside[-1] < 1e-3


def test_it_slows_down_before_a_gap_and_says_why(
    machine: Walker, structure: Structure, stack: WalkStack, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Slower, lower and higher are what is taken here
    monkeypatch.setattr(driving, "ALTERNATIVES", [driving.ALTERNATIVES[k] for k in (0, 1, 2, 3, 4)])
    gap = remove_rows(structure, "15-22")
    begin = standing_plan(machine, gap, grid_pose(13, 13, 100 * INCH + HEIGHT))
    walk = Walk(machine, gap, begin, stack=stack)
    drive = Drive(walk)
    drive.steer(0.0, 0.2, 0.0)
    places = [walk.q[:3].copy()]
    standing = 0
    while not drive.reason or standing < 200:
        drive.tick()
        places.append(walk.q[:3].copy())
        standing = standing + 1 if walk.pace == 0.0 else 0
        assert walk.time < 30.0
    off = np.array(places) - places[0]
    assert np.abs(off[:, 0]).max() < 1e-4  # not aside
    assert np.abs(np.hypot(*np.array(places)[:, :2].T) - 152 * INCH).max() < 0.052  # nor higher or lower than it may
    assert -off[-1, 2] > 0.05
    assert len(walk.held) >= 2
    assert "no hand can be moved in time" in drive.reason
    lifts = len(walk.progress.steps)
    drive.steer(0.0, 0.0, 0.0)
    for _ in range(100):
        drive.tick()
    assert drive.standing
    assert len(walk.held) == 3
    assert len(walk.progress.steps) == lifts


def test_a_body_stands_when_its_joints_can_be_at_rest_in_a_tick(
    machine: Walker, structure: Structure, stack: WalkStack, begin: Plan
) -> None:
    walk = Walk(machine, structure, begin, stack=stack)
    drive, most = Drive(walk), machine.robot.limits.acceleration[6:] * walk.dt
    assert drive.standing
    walk.machine.v[6:] = 0.9 * most
    assert drive.standing
    walk.machine.v[8] = -2.8 * most[2]
    assert not drive.standing


def test_directions_and_rates() -> None:
    rates, spacing = np.array([0.03, 0.05, 0.1, 0.01]), 0.05
    for structure, pose in ((plane(), pin.SE3(np.diag([1.0, -1.0, -1.0]), np.array([2.0, 1.0, 1.3]))), (None, None)):
        if structure is None or pose is None:
            from wbc.walking import cylinder

            structure, pose = cylinder(), grid_pose(14, 9, 4.0, 0.3)
        steering = Steering.on(structure, pose)
        first, second = steering.ahead(pose.homogeneous, np.repeat(rates[None], 2, axis=0), spacing)
        assert steering.rates(first, second, spacing) == pytest.approx(rates, abs=1e-6)
        assert steering.lower(second) == pytest.approx(2 * rates[3] * spacing, abs=1e-9)
    along = Steering.on(structure, pose).ahead(pose.homogeneous, np.array([[0.0, 0.1, 0.0, 0.0]]), 1.0)[0]
    assert along[:3, 3] - pose.translation == pytest.approx([0.0, 0.0, -0.1])  # +A is -z
    more = Steering.on(structure, pose).ahead(pose.homogeneous, np.array([[0.1, 0.0, 0.0, 0.0]]), 1.0)[0]
    aside = grid_pose(14 + np.degrees(0.1 / 4.0) / 5, 9, 4.0, 0.3)
    assert more == pytest.approx(aside.homogeneous, abs=1e-9)  # round is +T


def test_commands_from_files(tmp_path: pathlib.Path) -> None:
    text = tmp_path / "commands.csv"
    text.write_text("# a drive\nt, T, A, spin\n0, 0, 0.1, 0\n2, 0.05, 0, -0.02\n3, 0, 0, 0\n")
    table = read_commands(text)
    np.savez(tmp_path / "commands.npz", t=table.times, T=table.values[:, 0], A=table.values[:, 1], spin=[0, -0.02, 0])
    for source in (table, read_commands(tmp_path / "commands.npz")):
        assert source.rates(0.0) == pytest.approx([0.0, 0.1, 0.0])
        assert source.rates(1.99) == pytest.approx([0.0, 0.1, 0.0])
        assert source.rates(2.0) == pytest.approx([0.05, 0.0, -0.02])
        assert source.rates(3.0) is None
    for bad, told in (
        ("t,T,A\n0,0,0\n", "expected the columns t, T, A, spin"),
        ("t,T,A,spin\n0,0,x,0\n", "line 2.A"),
        ("t,T,A,spin\n0,0,0\n", "line 2: expected 4 numbers"),
        ("t,T,A,spin\n0,0,nan,0\n", "row 1.A: expected a finite number"),
        ("t,T,A,spin\n", "there are no rows"),
    ):
        text.write_text(bad)
        with pytest.raises(NumberTableError, match=told):
            read_commands(text)
    with pytest.raises(NumberTableError, match="cannot be read"):
        read_commands(tmp_path / "none.csv")
    np.savez(tmp_path / "commands.npz", t=[0.0, 1.0], T=[0.0, 1.0], A=[0.0, 1.0])
    with pytest.raises(NumberTableError, match="spin"):
        read_commands(tmp_path / "commands.npz")
    with pytest.raises(RangeError, match="times that rise"):
        CommandTable(np.array([0.0, 0.0]), np.zeros((2, 3)))


def test_a_bad_command_changes_nothing(machine: Walker, structure: Structure, stack: WalkStack, begin: Plan) -> None:
    drive = Drive(Walk(machine, structure, begin, stack=stack))
    drive.steer(0.0, 0.05, 0.0)
    with pytest.raises(NotFiniteError):
        drive.steer(0.0, np.nan, 0.0)
    with pytest.raises(ShapeError):
        drive.steer("fast", 0.0, 0.0)  # type: ignore[arg-type]
    assert drive.command == pytest.approx([0.0, 0.05, 0.0])


def test_a_hand_that_swings_lands_on_another_path_with_its_elbow_bent(
    machine: Walker, structure: Structure, begin: Plan
) -> None:
    """Hands that hold may have straight elbows; a hand that is to land then goes on to where it can."""
    straight = replace(machine, margins=replace(machine.margins, landing_elbow=3.0))
    hands, here = tuple((chain[0],) for chain in begin.chain), (0,) * len(machine.arms)
    for walker, swings, possible in ((machine, 0, True), (straight, -1, True), (straight, 0, False)):
        begun = Course(0.0, 0.0, 0, (), (), hands, here, swings)
        slices = course_slices(walker, structure, begin, begun, begin.path, quick=True)
        if possible:
            assert next(plan for plan in slices if plan is not None).start == begin.start
            continue
        with pytest.raises(NoPlanError, match="cannot hold it on the new path"):
            list(slices)
