"""A walk goes on from states of its log, and from a state in which nothing is held."""

from __future__ import annotations

import pathlib
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings, strategies as st

from tests.repeats import repeats
from wbc.errors import RangeError
from wbc.robots import Walker
from wbc.walking import Structure
from wbc.walking.arms.puma import limb_of
from wbc.walking.body_path import BodyPath, grid_path
from wbc.walking.checker import Rules, check_walk
from wbc.walking.log.body_paths import path_of
from wbc.walking.log.log import CLOSED, CLOSING, OPEN, OPENING, WalkLog, WalkLogError
from wbc.walking.loop.stack import WalkStack
from wbc.walking.loop.state import State
from wbc.walking.loop.walk import Walk
from wbc.walking.modes.first_grasps import free_state, plan_from_state
from wbc.walking.planner.plan import Plan
from wbc.walking.planner.planner import plan_walk
from wbc.walking.report.folder import save_run
from wbc.walking.run import PathRequest, ResumeRequest, Site, WalkRun, path_mode, perform_walk
from wbc.walking.run.recording import WalkRecorder
from wbc.walking.run.resume_mode import resumed_state

INCH = 0.0254


def test_first_grasps(machine: Walker, structure: Structure, stack: WalkStack, tmp_path: pathlib.Path) -> None:
    path = grid_path([(13, 9), (13, 10)], 4 * INCH)
    state = free_state(machine, path.poses[0])
    walk = Walk(machine, structure, plan_from_state(machine, structure, path, state), stack=stack, state=state)
    recorder, body = WalkRecorder(walk), state.q[:7].copy()
    assert walk.held == {}
    while not walk.done:
        tick = walk.tick()
        recorder.tick(tick)
        if tick.fixed:
            assert (tick.q[:7] == body).all()
            assert (tick.v[:6] == 0.0).all()
        assert walk.time < 30.0
    lands = [event for event in walk.events if event.what == "land"]
    log, _ = recorder.log()
    assert log.body_fixed.sum() == round(lands[1].time / walk.dt)  # until the second hand holds
    assert len(lands) == 3
    report = check_walk(log, machine.urdf(tmp_path / "robot.urdf"), structure, Rules(sub_samples=1))
    assert report.ok, str(report)


@pytest.fixture(scope="module")
def walked(machine: Walker, stack: WalkStack, tmp_path_factory: pytest.TempPathFactory) -> tuple[WalkRun, pathlib.Path]:
    folder = tmp_path_factory.mktemp("run")
    request = PathRequest(Site(rigid=True), "13,9", ("13,13",))
    run = perform_walk(request, machine, stack=stack)
    save_run(run, folder, check=False)
    return run, folder


@pytest.fixture(scope="module")
def stretched(machine: Walker, tmp_path_factory: pytest.TempPathFactory) -> pathlib.Path:
    """A walk in which an arm is nearly straight as it is lifted."""
    folder = tmp_path_factory.mktemp("stretched")
    run = perform_walk(PathRequest(Site(), (13.0, 6.0, 0.0), ((13.0, 18.0, 0.0),), 0.1016), machine)
    assert run.outcome == "arrived"
    save_run(run, folder, check=False)
    return folder


@pytest.mark.parametrize("before", [0.05, 0.0, -0.1])
def test_a_walk_goes_on_from_where_an_arm_is_about_to_be_straight(
    stretched: pathlib.Path, machine: Walker, structure: Structure, before: float, tmp_path: pathlib.Path
) -> None:
    """An arm that cannot hold on while the body comes to rest lets go, as it was about to; as one that has just let
    go, it neither gets straight nor brings its hand too deep.
    """
    log, bend = WalkLog.load(stretched), limb_of(machine).elbow_bend
    opened = [
        (row, arm)
        for arm in range(3)
        for row in np.flatnonzero(np.diff((log.hand_state[:, arm] == OPENING).astype(int)) == 1) + 1
    ]
    column = {name: k for k, name in enumerate(log.joints)}
    bends = [float(bend(log.q[row, [column[joint] for joint in machine.arms[arm].joints]])) for row, arm in opened]
    row, arm = opened[int(np.argmin(bends))]
    assert min(bends) < 0.2
    again = perform_walk(ResumeRequest(stretched, float(log.t[row]) - before), machine)
    assert again.outcome == "arrived"
    assert again.log is not None
    report = check_walk(again.log, machine.urdf(tmp_path / "robot.urdf"), again.structure)
    assert report.ok, str(report)
    since = row - round(before / log.dt)
    joints = again.log.q[since : since + 50, [column[joint] for joint in machine.arms[arm].joints]]
    assert bend(joints).min() > 0.0


@pytest.mark.parametrize("state", [OPENING, OPEN, CLOSING])
def test_a_walk_goes_on_from_any_state(
    walked: tuple[WalkRun, pathlib.Path], machine: Walker, stack: WalkStack, state: int, tmp_path: pathlib.Path
) -> None:
    run, folder = walked
    assert run.log is not None
    rows = np.flatnonzero((run.log.hand_state == state).any(axis=1))
    row = int(rows[len(rows) // 2])
    again = perform_walk(ResumeRequest(folder, float(run.log.t[row])), machine, stack=stack)
    assert again.outcome == "arrived"
    assert again.log is not None
    assert (again.log.q[: row + 1] == run.log.q[: row + 1]).all()
    np.testing.assert_allclose(np.diff(again.log.q, axis=0), again.log.v[:-1] * again.log.dt, atol=1e-9)
    goal = run.path.poses[-1][:3, 3]
    assert np.linalg.norm(again.log.pose_body_in_structure[-1, :3] - goal) < 0.002
    assert again.ticks is not None
    assert len(again.ticks.cost) == len(again.log) - 1
    report = check_walk(again.log, machine.urdf(tmp_path / "robot.urdf"), again.structure, Rules(sub_samples=1))
    assert report.ok, str(report)


@pytest.fixture(scope="module")
def walks(
    machine: Walker, stack: WalkStack, tmp_path_factory: pytest.TempPathFactory
) -> list[tuple[WalkLog, pathlib.Path]]:
    """A walk whose hands hold at the beginning, and one that begins with nothing held."""
    out = []
    for free in (False, True):
        folder = tmp_path_factory.mktemp("walks")
        request = PathRequest(Site(rigid=True), "13,9", ("13,12",), free_start=free)
        run = perform_walk(request, machine, stack=stack)
        save_run(run, folder, check=False)
        assert run.log is not None
        out.append((run.log, folder))
    return out


@settings(max_examples=repeats(4), deadline=None, derandomize=True)
@given(free=st.booleans(), part=st.floats(0.0, 1.0))
def test_a_walk_goes_on_from_any_instant(
    walks: list[tuple[WalkLog, pathlib.Path]], machine: Walker, stack: WalkStack, free: bool, part: float
) -> None:
    log, folder = walks[free]
    row = 1 + round(part * (len(log) - 2))
    again = perform_walk(ResumeRequest(folder, float(log.t[row])), machine, stack=stack)
    assert again.outcome == "arrived", again.reason
    assert again.log is not None
    assert again.ticks is not None
    assert again.ticks.solved.all()
    assert again.ticks.slip.max() < 0.001
    assert (again.log.q[: row + 1] == log.q[: row + 1]).all()
    # Positions follow from the rates alone, over the seam too; two hands hold wherever the body is not declared fixed
    np.testing.assert_allclose(np.diff(again.log.q, axis=0), again.log.v[:-1] * again.log.dt, atol=1e-9)
    holding = (again.log.hand_state == CLOSED).sum(axis=1)
    assert (holding[~again.log.body_fixed] >= 2).all()
    end = again.log.pose_body_in_structure[-1, :3]
    assert np.linalg.norm(end - log.pose_body_in_structure[-1, :3]) < 0.002


def test_a_hand_nearer_to_its_reach_than_plans_let_it_holds(machine: Walker, structure: Structure) -> None:
    """A body that was stopped where a hand has millimetres of its reach left."""
    limb, margins, path = limb_of(machine), machine.margins, grid_path([(13, 6), (13, 9)], 0.1016)
    plan = plan_walk(machine, structure, path)
    grips, q = plan.grips, np.array(machine.robot.neutral)
    assert grips is not None
    q[:7] = pin.SE3ToXYZQUAT(pin.SE3(path.poses[0]))
    for arm, grip in zip(machine.arms, plan.chain, strict=True):
        q[arm.q] = grips.posture_at(grip[0], 0)
    held = {k: structure.index(hold) for k, hold in enumerate(plan.start)}
    # The first arm's hold goes where it has a third of the margin left
    arm, hold = machine.arms[0], held[0]
    base = path.poses[0] @ arm.base.homogeneous
    axis = base[:3, :3].T @ structure.axes[hold]
    away = q[:3] - structure.positions[hold]
    away -= structure.axes[hold] * (structure.axes[hold] @ away)
    for far in np.arange(0.0, 1.0, 0.0005):
        place = structure.positions[hold] - far * away / np.linalg.norm(away)
        point = (base[:3, :3].T @ (place - base[:3, 3]))[None]
        if float(limb.wrist_reach(limb.wrist_of(point, axis[None]))[0]) < margins.held_reach / 3:
            break
    pose = structure.holds[hold].pose.copy()
    pose.translation = place
    moved = replace(structure.holds[hold], pose=pose)
    near = [k for k in range(len(structure.holds)) if np.linalg.norm(structure.positions[k] - place) < 0.05]
    others = tuple(one for k, one in enumerate(structure.holds) if k not in (*near, hold))
    there = replace(structure, holds=(*others, moved))
    found, _ = limb.held(point, axis[None])
    q[arm.q] = found[0, int(np.abs(found[0, :, 3:5] - q[arm.q][3:5]).sum(axis=1).argmin())]
    state = State(q, {k: there.index(hold) for k, hold in enumerate(plan.start)})
    assert plan_from_state(machine, there, path, state).complete


def test_a_walk_that_went_round_goes_on_round(
    machine: Walker, stack: WalkStack, tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    request = PathRequest(Site(rigid=True), "13,10", ("13,12",))
    round_about = grid_path([(13, 10), (13.5, 11), (13, 12)], 4 * INCH)

    def found(walker: Walker, structure: Structure, path: BodyPath, **more: object) -> Plan:
        return plan_walk(walker, structure, round_about, objective="destination")

    monkeypatch.setattr(path_mode, "plan_walk", found)
    run = perform_walk(request, machine, stack=stack)
    save_run(run, tmp_path, check=False)
    again = perform_walk(ResumeRequest(tmp_path, 1.0), machine, stack=stack)
    assert again.outcome == "arrived"
    assert again.log is not None
    corner = round_about.poses[:, :3, 3][np.abs(round_about.poses[:, 0, 3] - round_about.poses[0, 0, 3]).argmax()]
    off = np.linalg.norm(again.log.pose_body_in_structure[:, :3] - corner, axis=1)
    assert off.min() < 0.01, "it passes where the way round has its corner"
    with pytest.raises(WalkLogError, match="no path of a body"):
        path_of({"spacing": 0.05, "poses": [[1.0, 2.0]]})


def test_what_cannot_be_resumed_is_named(
    walked: tuple[WalkRun, pathlib.Path], machine: Walker, structure: Structure, tmp_path: pathlib.Path
) -> None:
    run, folder = walked
    assert run.log is not None
    with pytest.raises(RangeError, match=r"resume.at: expected a time from 0.01"):
        perform_walk(ResumeRequest(folder, 1e3), machine)
    with pytest.raises(WalkLogError, match=r"there is no run\.npz"):
        perform_walk(ResumeRequest(tmp_path), machine)
    gone = [run.log.hold_id[hold] for hold in run.log.hand_hold[5][:2]]
    with pytest.raises(RangeError, match="1 hands hold there, 2 must"):
        resumed_state(run.log, 5, machine, structure.without(gone))
