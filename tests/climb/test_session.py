"""A climb from request to check and folder; requests that cannot be are refused by name."""

from __future__ import annotations

import json
import pathlib
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import wbc.log
from wbc.climb import machines
from wbc.climb.folder import PART, read_folder, resumed
from wbc.climb.grids import cylinder_grid, plane_grid
from wbc.climb.loop import ClimbLoop, ClimbOutcome
from wbc.climb.plan_files import PlanFileError, differences, read_plan, read_record, record_of, save_plan
from wbc.climb.rates import read_twists, round_surface, twists_of
from wbc.climb.request import (
    ClimberRequest,
    ClimbRequest,
    DriveRequest,
    LimbRequest,
    PathRequest,
    PlantRequest,
    SceneRequest,
    request_of,
)
from wbc.climb.scene_files import save_scene
from wbc.climb.search import NoStancesError
from wbc.climb.session import ClimbDone, ClimbHooks, check_folder, climb, climber_of, scene_of, setup_of
from wbc.climb.sources import still_to_go
from wbc.errors import RangeError, ShapeError, UnknownNameError, WbcError
from wbc.log import LogFileError
from wbc.multibody import pin

#: Two arms of one joint on a body that floats
URDF = """<robot name="two"><link name="body"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>{}</robot>"""
ARM = """<link name="arm{0}"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>
</inertial></link><joint name="joint{0}" type="revolute"><parent link="body"/><child link="arm{0}"/>
<origin xyz="{0} 0 0"/><axis xyz="0 0 1"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint>"""
SHORT = ClimbRequest(PathRequest(start="13,9", points=("13,13",)))


@pytest.fixture(scope="module")
def walked(tmp_path_factory: pytest.TempPathFactory) -> tuple[pathlib.Path, ClimbDone]:
    """A short walk of the published walker."""
    folder = tmp_path_factory.mktemp("climb") / "run"
    return folder, climb(SHORT, folder, backend="vm")


def test_a_climb_is_planned_carried_out_checked_and_kept(walked: tuple[pathlib.Path, ClimbDone]) -> None:
    folder, done = walked
    assert done.run.outcome is ClimbOutcome.ARRIVED, done.run.reason
    assert done.report is not None
    assert done.report.clean, str(done.report)
    assert {file.name for file in folder.iterdir()} == {"log.npz", "request.json", "plan.npz"}
    assert replace(read_folder(folder)) == replace(SHORT, mode=replace(SHORT.mode, speed=0.1016))
    log = wbc.log.load(folder)
    np.testing.assert_array_equal(log.array("q"), done.run.log.array("q"))
    report, ended = check_folder(folder)
    assert (str(report), ended) == (str(done.report), True)


def test_a_plan_in_a_file_is_carried_out_to_the_bit(walked: tuple[pathlib.Path, ClimbDone]) -> None:
    folder, done = walked
    mode = PathRequest(start="13,9", points=("13,13",), plan=str(folder / "plan.npz"))
    again = climb(ClimbRequest(mode), checked=False, backend="vm")
    np.testing.assert_array_equal(again.run.log.array("q"), done.run.log.array("q"))
    assert differences(record_of(again.plan), read_record(folder)) == []
    assert again.plan.margin == done.plan.margin


def test_a_plan_of_another_robot_or_scene_is_refused_by_name(
    walked: tuple[pathlib.Path, ClimbDone], tmp_path: pathlib.Path
) -> None:
    folder, done = walked
    climber, scene, file = done.plan.climber, done.plan.scene, folder / "plan.npz"
    used = {scene.footholds[row].id for row in done.plan.start} | {
        scene.footholds[move.lands].id for move in done.plan.moves
    }
    # Footholds that it does not use may be others
    less = scene.without(*(f.id for f in scene.footholds if f.id not in used))
    assert differences(record_of(read_plan(file, climber, less)), record_of(done.plan)) == []
    one = min(used)
    moved = [replace(f, pose=f.pose * pin.SE3(np.eye(3), np.array([1e-3, 0, 0]))) if f.id == one else f
             for f in scene.footholds]  # fmt: skip
    for machine, place, error, text in (
        (climber, scene.without(one), UnknownNameError, one),
        (climber, replace(scene, footholds=moved), PlanFileError, f"foothold {one} is 0.001 m"),
        (climber, plane_grid(), PlanFileError, "of scene cylinder_grid; here bodies or gravity are others"),
        (climber, replace(scene, gravity=np.array([0, -1.6, 0])), PlanFileError, "bodies or gravity"),
        (climber_of(ClimberRequest(arms=4)), scene, PlanFileError, "it is of robot walker; here the robot"),
    ):
        with pytest.raises(error, match=text):
            read_plan(file, machine, place)
    other = tmp_path / "other.npz"
    plan = replace(done.plan, moves=[replace(done.plan.moves[0], lands=scene.row("1,1")), *done.plan.moves[1:]])
    save_plan(plan, other)
    assert differences(read_record(file), read_record(other))[0].count(" to 1,1,") == 1
    np.savez(other, times=np.zeros(3))
    with pytest.raises(PlanFileError, match="no contact plan"):
        read_record(other)
    other.write_bytes(bytes(range(256)))
    with pytest.raises(PlanFileError, match="no log of this package: File is not a zip file") as refused:
        read_record(other)
    assert str(refused.value).count("(got ") == 1
    with pytest.raises(PlanFileError, match="no such file"):
        read_record(tmp_path / "none.npz")


def test_a_run_that_was_killed_is_read_checked_and_gone_on_with(
    tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tick = ClimbLoop.tick

    def killed(self: ClimbLoop) -> None:
        if self.time > 2.8:
            raise SystemExit(137)
        tick(self)

    monkeypatch.setattr(ClimbLoop, "tick", killed)
    request = replace(SHORT, plant=PlantRequest(vanish=("15,13 at 2", "15,12 at 4")))
    with pytest.raises(SystemExit):
        climb(request, tmp_path / "run", backend="vm")
    monkeypatch.setattr(ClimbLoop, "tick", tick)
    assert (tmp_path / "run" / PART).is_file()
    report, ended = check_folder(tmp_path / "run")
    assert (report.clean, ended) == (True, False), str(report)
    onward = resumed(tmp_path / "run")
    assert onward.earlier is not None
    assert onward.earlier.at == wbc.log.load(tmp_path / "run")["t"][-1] > 2.0
    done = climb(onward, tmp_path / "more", backend="vm")
    assert (done.run.outcome, done.report is not None and done.report.clean) == ("arrived", True), str(done.report)
    # What vanished is gone, and what was to vanish does so at its time
    log = done.run.log
    later = log.array("contact")[log["t"] > 4.05 - onward.earlier.at]
    held = {log.meta["footholds"][int(row)] for row in np.unique(later) if row >= 0}
    assert not held & {"15,13", "15,12"}
    end = done.plan.climber.body_pose(log.array("q")[-1]).translation
    assert np.linalg.norm(end - setup_of(SHORT).way[-1].translation) < 0.03
    assert check_folder(tmp_path / "more")[0].clean
    again = resumed(tmp_path / "more", 0.5)
    assert again.earlier is not None
    assert again.earlier.passed == onward.earlier.at


def test_a_walk_that_arrived_stays_there(walked: tuple[pathlib.Path, ClimbDone]) -> None:
    done = climb(resumed(walked[0]), backend="vm")
    assert done.run.outcome is ClimbOutcome.ARRIVED, done.run.reason
    assert done.plan.moves == []


def test_a_drive_ends_with_a_limb_in_the_air_that_holds_no_more() -> None:
    mode, plant = DriveRequest(rate=("0.04,0,0,0,0,0 for 2",)), PlantRequest(fail=("arm2 at 1",))
    done = climb(ClimbRequest(mode, ClimberRequest(arms=5), plant=plant), backend="vm")
    assert done.run.outcome is ClimbOutcome.ARRIVED, done.run.reason
    assert done.report is not None
    assert done.report.clean, str(done.report)


def test_a_run_that_was_ended_before_it_moved_is_begun_again(tmp_path: pathlib.Path) -> None:
    def stop(*_: Any) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        climb(SHORT, tmp_path, backend="vm", hooks=ClimbHooks(compiled=stop))
    assert resumed(tmp_path) == read_folder(tmp_path)
    with pytest.raises(RangeError, match="begun again"):
        resumed(tmp_path, 1.0)
    with pytest.raises(LogFileError, match=r"no request\.json"):
        resumed(tmp_path / "nothing")


def test_a_scene_of_a_file_goes_along(tmp_path: pathlib.Path) -> None:
    file = save_scene(plane_grid(8, 10), tmp_path / "mine.csv")
    request = ClimbRequest(PathRequest("4,4", ("4,7",), speed=0.1), scene=SceneRequest(scene=str(file), remove=0.05))
    assert climb(request, tmp_path / "run", backend="vm").run.outcome is ClimbOutcome.ARRIVED
    file.unlink()
    assert check_folder(tmp_path / "run")[0].clean
    with pytest.raises(ShapeError, match="a file has no ends"):
        setup_of(replace(read_folder(tmp_path / "run"), mode=PathRequest(start="4,4")))


@pytest.mark.parametrize(
    "request_",
    [
        SHORT,
        ClimbRequest(DriveRequest(rate=("0.1,0,0,0,0,0 for 1",)), ClimberRequest(set=("hand_radius=0.04",))),
        ClimbRequest(LimbRequest("arm2", ("hold 1,1",)), scene=SceneRequest(gravity=(0.0, -1.6, 0.0))),
    ],
)
def test_requests_are_plain_data(request_: ClimbRequest) -> None:
    plain = json.loads(json.dumps(request_.plain()))
    assert request_of(plain) == request_
    for junk in (None, {}, {**plain, "kind": "jump"}, {**plain, "mode": {"jump": 1}}, {**plain, "plant": 3}):
        with pytest.raises(LogFileError):
            request_of(junk)


def test_robots_that_cannot_be_are_refused(tmp_path: pathlib.Path) -> None:
    file = tmp_path / "two.urdf"
    file.write_text(URDF.format(ARM.format(1) + ARM.format(2)))
    refused: list[tuple[dict[str, Any], type[WbcError], str]] = [
        ({"robot": "hexapot"}, UnknownNameError, "hexapod"),
        ({"limbs": ("a", "b"), "robot": "hexapod"}, ShapeError, "has limbs of its own"),
        ({"robot": "hexapod", "arms": 4}, RangeError, "of the robot 'walker'"),
        ({"robot": "hexapod", "set": ("a=1",)}, RangeError, "of the robot 'walker'"),
        ({"arms": 7}, RangeError, "arms"),
        ({"robot": str(file)}, ShapeError, "two limbs or more"),
        ({"robot": str(file), "limbs": ("arm1,arn2",)}, UnknownNameError, "arm2"),
        ({"robot": str(file), "limbs": ("arm1,body",)}, ShapeError, "no chain"),
    ]
    for options, error, text in refused:
        with pytest.raises(error, match=text):
            climber_of(ClimberRequest(**options))
    machine = climber_of(ClimberRequest())
    with pytest.raises(UnknownNameError, match="stairs"):
        scene_of(SceneRequest(scene="stair"), machine)
    with pytest.raises(UnknownNameError, match="foothold"):
        setup_of(
            ClimbRequest(PathRequest(points=("nowhere",)), ClimberRequest("hexapod"), SceneRequest(scene="stairs"))
        )
    assert len(climber_of(ClimberRequest(str(file), limbs=("arm1, arm2",), hold="grip")).limbs) == 2


def test_a_body_that_goes_where_its_limbs_take_it_is_not_driven() -> None:
    mode = DriveRequest(rate=("0.02,0,0,0,0,0 for 2",))
    with pytest.raises(RangeError, match="no rates of its own"):
        climb(ClimbRequest(mode, ClimberRequest("two_ended"), SceneRequest(scene="row")))


def test_feet_that_only_press_do_not_hold_what_does_not_weigh() -> None:
    request = ClimbRequest(climber=ClimberRequest("hexapod"), scene=SceneRequest(scene="stairs", gravity=(0, 0, 0)))
    with pytest.raises(NoStancesError, match=r"not borne.*nothing weighs, and feet that only press"):
        climb(request)


def test_joints_without_a_limit_of_speed_get_one_that_is_said(
    tmp_path: pathlib.Path, caplog: pytest.LogCaptureFixture
) -> None:
    """As no MJCF file has one; those that are known stay."""
    leg = '<body pos="{} 0 0"><joint name="j{}" axis="0 1 0"/><geom size="0.1"/><site name="foot{}"/></body>'
    file = tmp_path / "legs.xml"
    body = "<freejoint/><geom size='0.1'/>" + leg.format(1, 1, 1) + leg.format(-1, 2, 2)
    file.write_text(f"<mujoco><worldbody><body>{body}</body></worldbody></mujoco>")
    limits = climber_of(ClimberRequest(str(file), limbs=("foot1", "foot2"))).robot.limits
    assert limits.velocity[6:].tolist() == [machines.RATE] * 2
    assert limits.acceleration[6:].tolist() == [machines.QUICK] * 2
    assert np.isinf(limits.velocity[:6]).all()
    assert "at 10 rad/s or m/s at most: j1, j2" in caplog.text


def test_what_is_left_of_a_way() -> None:
    way = [pin.SE3(np.eye(3), np.array(place, dtype=float)) for place in ((0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 0, 0))]
    for place, left in (((0, 0, 0), 3), ((1, 0.1, 0), 3), ((2, 0, 0), 2), ((2.1, 1, 0), 2), ((1.2, 1.3, 0), 1)):
        assert len(still_to_go(way, pin.SE3(np.eye(3), np.array(place, dtype=float)))) == left, place


def test_rates_of_files_and_texts_are_the_same(tmp_path: pathlib.Path) -> None:
    table, file = twists_of(("0.1,0,0,0,0,0 for 2", "0,0,0,0,0,0.2 for 1")), tmp_path / "rates.csv"
    file.write_text("t,vx,vy,vz,wx,wy,wz\n0,0.1,0,0,0,0,0\n2,0,0,0,0,0,0.2\n3,0,0,0,0,0,0\n")
    columns = dict(zip(["t", "vx", "vy", "vz", "wx", "wy", "wz"], np.c_[table.times, table.twists].T, strict=True))
    np.savez(tmp_path / "rates.npz", **columns)
    for other in (read_twists(file), read_twists(tmp_path / "rates.npz")):
        np.testing.assert_array_equal(other.times, table.times)
        np.testing.assert_array_equal(other.twists, table.twists)
    assert table.at(3.0) is None
    for text, error, told in (
        ("t,vx\n0,1\n", ShapeError, "missing vy"),
        ("t,vx,vy,vz\n0,1,1,1\n", RangeError, "two times or more"),
        ("t,vx,vy,vz\n1,1,1,1\n0,1,1,1\n", RangeError, "that rise"),
        ("t,vx,vy,vz\n0,1,nan,1\n1,1,1,1\n", WbcError, "line 2"),
        ("", WbcError, "has no rates"),
    ):
        file.write_text(text)
        with pytest.raises(error, match=told):
            read_twists(file)


def test_a_body_that_goes_round_a_cylinder_keeps_its_distance() -> None:
    scene, rng = cylinder_grid(), np.random.default_rng(0)
    for _ in range(20):
        pose = pin.SE3(pin.exp3(rng.normal(size=3)), np.array([*(4.0 * rng.normal(size=2)), rng.normal()]))
        away = np.array([*pose.translation[:2], 0.0])
        # Along the surface: nothing towards the axis
        speed = rng.normal(size=3)
        speed -= (speed @ away) * away / (away @ away)
        twist = round_surface(scene, pose, np.r_[pose.rotation.T @ speed, np.zeros(3)])
        later = pose * pin.exp6(pin.Motion(0.5 * twist))
        assert np.linalg.norm(later.translation[:2]) == pytest.approx(np.linalg.norm(away), abs=1e-9)
        assert later.translation[2] - pose.translation[2] == pytest.approx(0.5 * speed[2], abs=1e-9)
    flat = np.arange(6.0)
    assert round_surface(plane_grid(), pin.SE3.Identity(), flat) is flat
