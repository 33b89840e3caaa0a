"""The checker of walks: an honest walk passes, and every fault that is put into it is found by the check for it."""

from __future__ import annotations

import ast
import sys
from collections.abc import Callable
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from tests.project.layout import ROOT
from tests.project.test_floors import imported
from tests.walking.honest import DT, HOLD, LATCH, MACHINE, SWING, honest
from tests.walking.trials.structures import surface_of
from wbc.clearance import TriangleMesh
from wbc.errors import RobotFileError, ShapeError, StructureFileError, UnknownNameError, UnsupportedJointError
from wbc.shapes import Box, Capsule, Cylinder, Sphere
from wbc.walking import Obstacle, PlaneSurface, Structure, save_structure
from wbc.walking.checker import Report, Rules, check_run, check_walk
from wbc.walking.checker.clock_and_joints import FAST, SPIN_FAST
from wbc.walking.log.log import CLOSED, CLOSING, OPEN, WalkLog, WalkLogError

Walk = tuple[WalkLog, Structure]
#: Between ticks fewer samples than the default, where what is between them is not the point
FEW = Rules(sub_samples=1)
OFF, TILTED, ROLLED = "held hand off its hold", "held hand's tilt beyond max_tilt", "held hand's roll"
STRUCTURE = "clearance of the structure"
SWEPT, SWEPT_STRUCTURE = "swept clearance of links", "swept clearance of the structure"
#: The tick at which the hand closes, and one in the middle of the swing
CLOSES, MIDDLE = round((HOLD + LATCH + SWING) / DT), round((HOLD + LATCH + SWING / 2) / DT)


@pytest.fixture(scope="module")
def urdf(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return MACHINE.urdf(tmp_path_factory.mktemp("robot") / "robot.urdf")


@pytest.fixture(scope="module")
def walk() -> Walk:
    return honest()


def kinds(report: Report) -> set[str]:
    return {finding.kind for finding in report.violations}


def with_rates(log: WalkLog, q: np.ndarray) -> WalkLog:
    """The log with other joints and the rates that belong to them."""
    return replace(log, q=q, v=np.append(np.diff(q, axis=0) / DT, np.zeros((1, q.shape[1])), axis=0))


def rows(log: WalkLog, which: Any) -> dict[str, np.ndarray]:
    """Some ticks of every array of ticks."""
    names = ("t", "pose_body_in_structure", "q", "v", "twist_body", "hand_state", "hand_hold", "body_fixed")
    return {name: getattr(log, name)[which] for name in (*names, "command", "command_kind")}


def changed(log: WalkLog, name: str, place: Any, value: Any) -> WalkLog:
    """The log with some numbers of one array set."""
    array = np.array(getattr(log, name))
    array[place] = value
    return replace(log, **{name: array})  # type: ignore[arg-type]


@pytest.mark.parametrize(("roll", "tilt"), [("free", 0.0), ("fixed", 0.0), (4, 0.0), ("free", 0.05)])
def test_an_honest_walk_passes(urdf: Path, roll: str | int, tilt: float) -> None:
    log, ground = honest(roll, tilt)
    report = check_walk(log, urdf, ground)
    assert kinds(report) == set(), str(report)
    assert report.ok
    assert (report.ticks, report.samples) == (len(log), 11 * len(log) - 10)
    # Two ball holds leave the turn about the line between them open, while the third hand swings
    swinging = (log.hand_state[:, 0] != CLOSED).sum()
    assert report.open_freedoms == (11 * swinging if tilt else 0)
    assert report["joint rate / limit"].worst == pytest.approx(0.987, abs=0.002)
    assert report["hands that hold"].worst == 2
    assert 0.0254 < report[STRUCTURE].worst < 0.027
    # Between ticks the joints are interpolated: a closed chain opens by the chord of an arc, at most
    assert 0.0 < report[OFF].worst < 5e-6
    with pytest.raises(UnknownNameError):
        report["joint"]


def test_the_report_is_a_table_of_all_checks(urdf: Path, walk: Walk) -> None:
    good, bad = (check_walk(log, urdf, walk[1], FEW) for log in (walk[0], changed(walk[0], "v", (7, 3), 9.0)))
    assert str(good).splitlines()[0].startswith("the walk holds: 191 ticks, 381 samples, 1.90 s")
    assert str(bad).splitlines()[0].startswith("2 of 35 checks are violated")
    line = next(line for line in str(bad).splitlines() if "joint rate / limit" in line)
    assert line.split() == ["joint", "rate", "/", "limit", "2.262", "1", "0.070", "arm1_joint4", "1"]
    lines = str(good).splitlines()
    assert all(any(finding.kind in line for line in lines) for finding in good.findings)


def test_clearances_are_proven_between_ticks(urdf: Path, walk: Walk) -> None:
    """A bead in the way of the swinging hand, between two ticks; a hand no deeper in the surface than it may be."""
    log, ground = walk
    honest_one = check_walk(log, urdf, ground, FEW)
    for kind in (SWEPT, SWEPT_STRUCTURE):
        assert honest_one[kind].ok, kind
        assert honest_one[kind].worst < 1.0
    model = pin.buildModelFromUrdf(str(urdf), pin.JointModelFreeFlyer())
    data, hand, between = model.createData(), model.getFrameId(log.hands[0]), []
    for k in (MIDDLE, MIDDLE + 1):
        q = np.concatenate([log.pose_body_in_structure[k], log.q[k]])
        pin.framesForwardKinematics(model, data, q)
        between.append(data.oMf[hand].translation.copy())
    ball = Obstacle("bead", Sphere(1e-4), pin.SE3(np.eye(3), (between[0] + between[1]) / 2))
    found = check_walk(log, urdf, Structure("bead", ground.holds, (ball,), ground.surface), FEW)[SWEPT_STRUCTURE]
    assert not found.ok
    assert found.where == "arm1_link6 and obstacle bead"
    assert found.worst < 0.0
    for deep, touched in ((0.004, False), (0.006, True), (0.014, True)):
        there = pin.SE3(np.eye(3), np.array([0.0, 0.0, deep]))
        higher = Structure("higher", ground.holds, (), PlaneSurface(there))
        worst = check_walk(log, urdf, higher, FEW)[SWEPT_STRUCTURE].worst
        assert (worst < 0.0) == touched, deep
    # Where time stands still there is no motion
    times = np.array(log.t)
    times[5] = times[4]
    assert np.isnan(check_walk(replace(log, t=times), urdf, ground, FEW)[SWEPT].worst)


def test_jumps_of_the_bodys_velocity_are_found(urdf: Path, walk: Walk) -> None:
    """A body that moves by 0.5 mm and 0.5 mrad more a tick from one on."""
    log, ground = walk
    assert check_walk(log, urdf, ground, FEW).ok
    on = np.maximum(np.arange(len(log)) - 40.0, 0.0)
    pose = np.array(log.pose_body_in_structure)
    pose[:, 0] += 5e-4 * on
    pose[:, 3:] = [
        (pin.Quaternion(row) * pin.Quaternion(pin.exp3(np.array([0.0, 0.0, 5e-4 * k])))).coeffs()
        for row, k in zip(pose[:, 3:], on, strict=True)
    ]
    moved = replace(log, pose_body_in_structure=pose)
    report, jumps = (
        check_walk(moved, urdf, ground, FEW),
        ("jump of the body's velocity", "jump of the body's turn rate"),
    )
    assert kinds(report) > set(jumps)
    unheeded = check_walk(moved, urdf, ground, replace(FEW, observe=jumps))
    assert kinds(unheeded) == kinds(report) - set(jumps)
    assert {finding.kind for finding in unheeded.observed} == set(jumps)
    with pytest.raises(UnknownNameError, match="observe"):
        check_walk(log, urdf, ground, replace(FEW, observe=("jump",)))
    for kind in jumps:
        found = report[kind]
        assert kind in str(unheeded)
        assert (found.time, found.where) == (pytest.approx(log.t[40]), "body")
        # Ticks of 10 ms, beside what the honest body does by itself
        assert found.worst == pytest.approx(0.05, abs=0.01)


def test_joints_that_speed_up_faster_than_they_can(urdf: Path, walk: Walk) -> None:
    log, ground = walk
    steps = np.abs(np.diff(log.v, axis=0, prepend=np.zeros((1, log.v.shape[1])))) / log.dt
    most = dict(zip(log.joints, steps.max(axis=0).tolist(), strict=True))
    kind = "joint acceleration / limit"
    assert np.isnan(check_walk(log, urdf, ground, FEW)[kind].worst)
    limits = {name: max(most[name], 1e-3) for name in most}
    assert check_walk(log, urdf, ground, replace(FEW, accelerations=limits)).ok
    joint = max(most, key=lambda name: most[name])
    found = check_walk(log, urdf, ground, replace(FEW, accelerations={**limits, joint: 0.5 * most[joint]}))[kind]
    assert (found.worst, found.where) == (pytest.approx(2.0), joint)
    assert not found.ok


@pytest.mark.parametrize("joint", range(6))
def test_a_joint_that_is_a_degree_off_for_a_while(urdf: Path, joint: int) -> None:
    log, ground = honest("fixed")
    log = replace(log, **rows(log, slice(0, 60)))  # type: ignore[arg-type]
    # Put in and taken out slowly: no rate gives it away
    ramp = np.radians(1.0) * np.clip(np.minimum(np.arange(60) - 10, 50 - np.arange(60)) / 10, 0.0, 1.0)
    q = np.array(log.q)
    q[:, 6 + joint] += ramp
    found = check_walk(with_rates(log, q), urdf, ground, FEW)
    assert kinds(found) <= {OFF, TILTED, ROLLED, "body position", "body turn", "drift", "drift of the angle"}
    assert not found[OFF].ok or not found[TILTED].ok or not found[ROLLED].ok
    assert "arm2: hold under 2" in {f.where.split(",")[0] for f in found.violations}
    assert not found["body turn"].ok
    assert 0.2 <= found["body turn"].time <= 0.5
    # Nor do the rates of the honest log explain these joints
    assert (
        check_walk(replace(log, q=q), urdf, ground, FEW)["joint step less rate x dt"].where == f"arm2_joint{joint + 1}"
    )


def test_a_held_hand_whose_free_roll_changes_is_no_fault(urdf: Path, walk: Walk) -> None:
    log, ground = walk
    q = np.array(log.q)
    q[:, 11] += 0.3
    assert check_walk(with_rates(log, q), urdf, ground, FEW).ok


def drop(log: WalkLog) -> WalkLog:
    return changed(changed(log, "hand_state", (slice(80, 100), 1), OPEN), "hand_hold", (slice(80, 100), 1), -1)


def swap_hands(log: WalkLog) -> WalkLog:
    return replace(log, hand_hold=log.hand_hold[:, [0, 2, 1]])


def swap_arms(log: WalkLog) -> WalkLog:
    order = [*range(6), *range(12, 18), *range(6, 12)]
    return replace(log, q=log.q[:, order], v=log.v[:, order])


def speed_up(log: WalkLog) -> WalkLog:
    meta = {**log.meta, "dt": DT / 1.05}
    return replace(log, t=log.t / 1.05, v=log.v * 1.05, twist_body=log.twist_body * 1.05, meta=meta)


def share(log: WalkLog) -> WalkLog:
    return changed(log, "hand_hold", (slice(CLOSES, None), 0), 1)


def vanish(log: WalkLog) -> WalkLog:
    return changed(log, "presence_span", (1, 1), 0.805)


def lose_tick(log: WalkLog) -> WalkLog:
    return replace(log, **rows(log, np.arange(len(log)) != MIDDLE))  # type: ignore[arg-type]


def hide_lost_tick(log: WalkLog) -> WalkLog:
    return replace(lose_tick(log), t=log.t[:-1])


def shift(log: WalkLog) -> WalkLog:
    return changed(log, "pose_body_in_structure", (slice(None), 1), log.pose_body_in_structure[:, 1] + 0.005)


def close_early(log: WalkLog) -> WalkLog:
    return changed(log, "hand_state", (slice(CLOSES - 20, CLOSES), 0), CLOSING)


def latch_short(log: WalkLog) -> WalkLog:
    return changed(log, "hand_state", (slice(CLOSES + 4, None), 0), CLOSED)


def stand_still(log: WalkLog) -> WalkLog:
    return changed(log, "t", 51, log.t[50])


def full_turn(log: WalkLog) -> WalkLog:
    return changed(log, "q", (slice(None), 5), log.q[:, 5] + 2 * np.pi)


def other_rate(log: WalkLog) -> WalkLog:
    return changed(log, "v", (MIDDLE, 4), log.v[MIDDLE, 4] + 1e-3)


def asked(log: WalkLog, speed: float, turn_rate: float) -> WalkLog:
    return replace(log, meta={**log.meta, "request": {"kind": "path", "speed": speed, "turn_rate": turn_rate}})


def asked_slower(log: WalkLog) -> WalkLog:
    """The body goes at up to 99 mm/s."""
    return asked(log, 0.08, 0.05)


def asked_to_turn_slower(log: WalkLog) -> WalkLog:
    """The logged body turns at 0.05 rad/s."""
    poses = [pin.XYZQUATToSE3(pose) for pose in log.pose_body_in_structure]
    turned = [pin.SE3(pose.rotation @ pin.exp3(np.array([0, 0, 0.05 * t])), pose.translation)
              for t, pose in zip(log.t, poses, strict=True)]  # fmt: skip
    spun = changed(log, "pose_body_in_structure", slice(None), [pin.SE3ToXYZQUAT(pose) for pose in turned])
    return asked(spun, 0.2, 0.02)


def driven(log: WalkLog, speed: float, spin: float) -> WalkLog:
    """The walk as one that commands of these rates drive."""
    rates = np.zeros_like(log.command)
    rates[:, 1], rates[:, 5] = speed, spin
    return replace(log, command=rates, meta={**log.meta, "request": {"kind": "drive"}})


def driven_slower(log: WalkLog) -> WalkLog:
    return driven(log, 0.08, 0.05)


def driven_to_turn_slower(log: WalkLog) -> WalkLog:
    return driven(asked_to_turn_slower(log), 0.2, 0.02)


def other_twist(log: WalkLog) -> WalkLog:
    return replace(log, twist_body=1.3 * log.twist_body)


def other_turn(log: WalkLog) -> WalkLog:
    return changed(log, "twist_body", (slice(None), 4), 0.03)


def move_hold(log: WalkLog) -> WalkLog:
    return changed(log, "hold_pose", (3, 0), log.hold_pose[3, 0] + 1e-6)


def rename_hold(log: WalkLog) -> WalkLog:
    return replace(log, hold_id=(*log.hold_id[:3], "nowhere"))


def declare_fixed(log: WalkLog) -> WalkLog:
    return changed(log, "body_fixed", slice(90, 100), True)


def hold_nothing(log: WalkLog) -> WalkLog:
    return changed(log, "hand_hold", (slice(10, 20), 2), -1)


def change_hold(log: WalkLog) -> WalkLog:
    return changed(log, "hand_hold", (slice(40, None), 1), 3)


FAULTS: list[tuple[Callable[[WalkLog], WalkLog], set[str], str, str]] = [
    (drop, {"hands that hold", "hand state"}, "hands that hold", "tick 80"),
    (swap_hands, {OFF}, OFF, "arm"),
    (swap_arms, {OFF}, OFF, "arm"),
    (speed_up, {"joint rate / limit", "joint step rate / limit"}, "joint rate / limit", "arm1_joint2"),
    (share, {"shared hold", OFF}, "shared hold", "arm1 and arm2: hold under 2"),
    (vanish, {"hold is there", "hands that hold"}, "hold is there", "arm2: hold under 2 is gone"),
    (lose_tick, {"time step is dt", "joint step less rate x dt"}, "time step is dt", f"tick {MIDDLE}"),
    (hide_lost_tick, {"joint step less rate x dt"}, "joint step less rate x dt", "arm1_joint"),
    (shift, {OFF, "body position"}, "body position", "from all holding hands"),
    (close_early, {"closing distance", "closing speed"}, "closing distance", "arm1: hold ahead"),
    (latch_short, {"latch time"}, "latch time", "arm1: closing at hold ahead"),
    (stand_still, {"time increases", "time step is dt"}, "time increases", "tick 51"),
    (full_turn, {"joint beyond its limit"}, "joint beyond its limit", "arm1_joint6"),
    (other_rate, {"joint step less rate x dt"}, "joint step less rate x dt", "arm1_joint5"),
    (other_twist, {"twist speed"}, "twist speed", "body"),
    (asked_slower, {FAST}, FAST, "body"),
    (asked_to_turn_slower, {SPIN_FAST}, SPIN_FAST, "body"),
    (driven_slower, {FAST}, FAST, "body"),
    (driven_to_turn_slower, {SPIN_FAST}, SPIN_FAST, "body"),
    (other_turn, {"twist turn rate"}, "twist turn rate", "body"),
    (move_hold, {"table of holds"}, "table of holds", "hold ahead"),
    (rename_hold, {"table of holds"}, "table of holds", "hold nowhere"),
    (declare_fixed, {"body declared fixed"}, "body declared fixed", "tick 90"),
    (hold_nothing, {"hand state"}, "hand state", "arm3: closed to closed at no hold"),
    (change_hold, {"hand state", OFF}, "hand state", "arm2: closed to closed at hold ahead"),
]


@pytest.mark.parametrize("by", [asked, driven])
def test_a_walk_as_fast_as_was_asked_passes(urdf: Path, walk: Walk, by: Callable[..., WalkLog]) -> None:
    report = check_walk(by(walk[0], 0.099, 0.01), urdf, walk[1], FEW)
    assert report.ok, str(report)
    assert abs(report[FAST].worst) < 0.001


@pytest.mark.parametrize(("fault", "expected", "kind", "where"), FAULTS, ids=[fault[0].__name__ for fault in FAULTS])
def test_a_fault_is_found(
    urdf: Path, walk: Walk, fault: Callable[[WalkLog], WalkLog], expected: set[str], kind: str, where: str
) -> None:
    report = check_walk(fault(walk[0]), urdf, walk[1], FEW)
    assert expected <= kinds(report), str(report)
    assert report[kind].where.startswith(where), report[kind]
    assert not report.ok


def test_first_grasps_with_the_body_declared_fixed(urdf: Path, walk: Walk) -> None:
    log, before = walk[0], 20
    still = rows(log, np.maximum(np.arange(-before, len(log)), 0))
    still["t"] = DT * np.arange(len(log) + before)
    still["hand_state"] = np.array(still["hand_state"])
    still["hand_state"][:10], still["hand_state"][10:before] = OPEN, CLOSING
    still["v"], still["twist_body"] = np.array(still["v"]), np.array(still["twist_body"])
    still["v"][:before], still["twist_body"][:before] = 0.0, 0.0
    fixed = np.arange(len(log) + before) < before
    good = replace(log, **still)  # type: ignore[arg-type]
    assert check_walk(replace(good, body_fixed=fixed), urdf, walk[1], FEW).ok
    assert kinds(check_walk(good, urdf, walk[1], FEW)) == {"hands that hold"}
    # Declared a tick longer than until enough hands hold, or moved meanwhile
    late = replace(good, body_fixed=np.arange(len(fixed)) < before + 2)
    assert kinds(check_walk(late, urdf, walk[1], FEW)) == {"body declared fixed"}
    pose = np.array(good.pose_body_in_structure)
    pose[:5, 0] += 1e-4
    moved = replace(good, body_fixed=fixed, pose_body_in_structure=pose)
    assert check_walk(moved, urdf, walk[1], FEW)["body declared fixed"].where == "tick 4"


def test_a_hand_two_inches_in_the_surface(urdf: Path) -> None:
    log, ground = honest(lift=0.0)
    report = check_walk(log, urdf, ground, FEW)
    assert kinds(report) == {STRUCTURE, SWEPT_STRUCTURE}
    # The hand's capsule leans, and its lower end is a ball of 2 in about the surface
    assert report[STRUCTURE].worst == pytest.approx(-2 * 0.0254, abs=1e-4)
    assert report[STRUCTURE].where == "arm1_link6 and surface"
    # Without a structure the planes of the holds, which lean by 0.35 rad, stand for it
    alone = check_walk(log, urdf, None, FEW)
    assert not alone[STRUCTURE].ok
    assert alone[STRUCTURE].where == "arm1_link6 and plane of a hold"
    assert np.isnan(alone["table of holds"].time)


def test_links_two_inches_in_an_obstacle(urdf: Path, walk: Walk) -> None:
    log, ground = walk
    place = MACHINE.arms[0].base.copy()
    place.rotation, place.translation = np.eye(3), np.array([1.1, 0.0, 1.0])
    for shape in (Box((0.4, 0.2, 0.6)), Capsule(0.2, 0.4)):
        bare = Structure("obstacle", ground.holds, (Obstacle("tank", shape, place),), ground.surface)
        there = check_walk(log, urdf, bare, FEW)[STRUCTURE]
        # Pushed from where it is to two inches in the link
        place.translation[0] += (there.worst + 2 * 0.0254) * (-1.0 if there.worst > 0.0 else 0.0)
        pushed = Structure("obstacle", ground.holds, (Obstacle("tank", shape, place),), ground.surface)
        found = check_walk(log, urdf, pushed, FEW)
        assert kinds(found) == {STRUCTURE, SWEPT_STRUCTURE}
        assert found[STRUCTURE].where.endswith("and tank")
        assert found[STRUCTURE].worst < 0.0
    # Bodies that the capsule is within
    block = TriangleMesh(surface_of(np.array(list(product((-0.2, 0.2), (-0.2, 0.2), (-0.4, 0.4))))), solid=True)
    for larger in (Sphere(0.4), Cylinder(0.2, 0.8), block):
        around = Structure("obstacle", ground.holds, (Obstacle("tank", larger, place),), ground.surface)
        about = check_walk(log, urdf, around, FEW)
        assert kinds(about) == {STRUCTURE, SWEPT_STRUCTURE}
        assert about[STRUCTURE].where.endswith("and tank")
        assert about[STRUCTURE].worst < 0.0


def test_links_in_each_other(urdf: Path, walk: Walk) -> None:
    # The open hand folded back to its own neck
    log, ground = walk
    q = np.array(log.q)
    q[MIDDLE, :6] = np.radians([-29.0, -135.0, -89.0, 85.0, -87.0, -130.0])
    report = check_walk(replace(log, q=q), urdf, ground, FEW)
    found = report["clearance of links"]
    assert not found.ok
    assert found.where == "arm1_link1 and arm1_link6"
    assert found.worst == pytest.approx(-0.143, abs=0.005)
    assert found.time == pytest.approx(log.t[MIDDLE])


def test_a_creeping_hand_drifts(urdf: Path) -> None:
    log, ground = honest(creep=0.0035)
    report = check_walk(log, urdf, ground, FEW)
    assert "drift" in kinds(report)
    assert report["drift"].where in ("arm2: hold under 2", "arm3: hold under 3")


def test_a_vanished_hold_that_is_let_go_at_once_is_no_fault_of_the_hand(urdf: Path, walk: Walk) -> None:
    log, ground = walk
    log = changed(vanish(log), "hand_state", (slice(81, None), 1), OPEN)
    report = check_walk(log, urdf, ground, FEW)
    assert kinds(report) == {"hands that hold"}
    assert report["hands that hold"].worst == 1
    rules = replace(FEW, min_holds=1)
    assert check_walk(log, urdf, ground, rules).ok


def test_a_hand_may_come_to_rest_where_its_hold_has_vanished(urdf: Path, walk: Walk) -> None:
    """The hold vanishes while the hand is farther from it than it may touch things, and it still comes nearer."""
    log, ground = walk
    hold, frame = int(log.hand_hold[CLOSES, 0]), log.hands[0]
    model = pin.buildModelFromUrdf(str(urdf), pin.JointModelFreeFlyer())
    data, gaps = model.createData(), []
    for pose, q in zip(log.pose_body_in_structure, log.q, strict=True):
        pin.framesForwardKinematics(model, data, np.concatenate([pose, q]))
        there = data.oMf[model.getFrameId(frame)].translation
        gaps.append(float(np.linalg.norm(there - log.hold_pose[hold, :3])))
    gone = next(k for k in range(MIDDLE, CLOSES) if gaps[k] < 0.085)
    end = next(k for k in range(gone, CLOSES) if gaps[k] < 0.04)
    assert gaps[gone] > FEW.exempt_distance
    short = replace(log, **rows(log, slice(end)))
    short = changed(short, "hand_hold", (slice(gone, None), 0), -1)
    assert not check_walk(short, urdf, ground, FEW)[SWEPT_STRUCTURE].ok
    row = int(np.flatnonzero(log.presence_hold == hold)[0])
    vanished = changed(short, "presence_span", (row, 1), log.t[gone] - 0.5 * DT)
    assert check_walk(vanished, urdf, ground, FEW)[SWEPT_STRUCTURE].ok
    # One that does not stop, but comes again, is not spared
    again = {
        name: np.concatenate([a[:gone], a[gone - 2 : gone], a[gone:]])
        for name, a in rows(vanished, slice(None)).items()
    }
    again["t"] = log.t[0] + DT * np.arange(len(again["t"]))
    again["hand_hold"][gone : gone + 2, 0] = -1
    assert not check_walk(replace(vanished, **again), urdf, ground, FEW)[SWEPT_STRUCTURE].ok


def test_a_runs_folder_is_checked(urdf: Path, walk: Walk, tmp_path: Path) -> None:
    log, ground = walk
    with pytest.raises(WalkLogError, match=r"there is no run\.npz"):
        check_run(tmp_path, FEW)
    log.save(tmp_path)
    with pytest.raises(StructureFileError):
        check_run(tmp_path, FEW)
    save_structure(ground, tmp_path / "structure.csv")
    with pytest.raises(RobotFileError):
        check_run(tmp_path, FEW)
    (tmp_path / "robot.urdf").write_text(urdf.read_text())
    assert check_run(tmp_path, FEW).ok
    assert str(check_run(tmp_path, FEW)) == str(check_walk(log, urdf, ground, FEW))


def test_what_cannot_be_checked_is_refused(walk: Walk, urdf: Path, tmp_path: Path) -> None:
    log, ground = walk
    with pytest.raises(UnknownNameError, match="arm1_joint9"):
        check_walk(replace(log, joints=("arm1_joint9", *log.joints[1:])), urdf, ground)
    with pytest.raises(UnknownNameError, match="paw"):
        check_walk(replace(log, hands=("paw", *log.hands[1:])), urdf, ground)
    less = replace(log, joints=log.joints[:-1], q=log.q[:, :-1], v=log.v[:, :-1])
    with pytest.raises(ShapeError, match="arm3_joint6"):
        check_walk(less, urdf, ground)
    text = urdf.read_text()
    for old, new, error in (
        ("<sphere radius", "<cone radius", RobotFileError),
        ('type="revolute"', 'type="planar"', UnsupportedJointError),
        ('xyz="0 0 1"', 'xyz="0 0 0"', RobotFileError),
        ('xyz="0 0 1"', 'xyz="0 0"', RobotFileError),
        ('<parent link="body" />', '<parent link="arm1_hand" />', RobotFileError),
        ("</robot>", "", RobotFileError),
    ):
        assert old in text
        bad = tmp_path / "bad.urdf"
        bad.write_text(text.replace(old, new))
        with pytest.raises(error):
            check_walk(log, bad, ground)
    for name, value in (("min_holds", -1), ("sub_samples", 0), ("clearance", -1.0), ("latch_time", np.nan)):
        with pytest.raises(Exception, match=name) as caught:
            Rules(**{name: value})  # type: ignore[arg-type]
        assert caught.type.__module__ == "wbc.errors"


def test_the_checker_shares_no_code_with_planning_and_control() -> None:
    """Whatever the checker imports, itself or through other modules, is neither planner nor stack nor controller."""
    allowed = {
        *("wbc.errors", "wbc.validation", "wbc.shapes", "wbc.robot", "wbc.clearance", "wbc.geometry", "wbc.log"),
        "wbc.multibody",
        *("wbc.walking.log.log", "wbc.walking.log.ticks"),
        *(f"wbc.walking.holds.{name}" for name in ("hold", "obstacle", "structure", "files", "surface")),
        "wbc.walking.checker",
    }
    start = sorted((ROOT / "wbc/walking/checker").glob("*.py"))
    assert len(start) > 5
    left, seen = list(start), set(start)
    while left:
        path = left.pop()
        for _, target in imported(path):
            assert any(target == name or target.startswith(f"{name}.") for name in allowed), f"{path.name}: {target}"
            file = ROOT / (target.replace(".", "/") + ".py")
            if "wbc/walking" in str(file) and file.exists() and file not in seen:
                seen.add(file)
                left.append(file)
        if path in start:
            outside = {
                name.split(".")[0]
                for node in ast.walk(ast.parse(path.read_text()))
                for name in (
                    [alias.name for alias in node.names]
                    if isinstance(node, ast.Import)
                    else [node.module or ""]
                    if isinstance(node, ast.ImportFrom)
                    else []
                )
            }
            packages = {"numpy", "pinocchio", "rich", "wbc"}
            assert outside <= packages | set(sys.stdlib_module_names)
