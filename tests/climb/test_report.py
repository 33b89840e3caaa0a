"""What a climb leaves: its figures against its log, its pictures, its map of footholds in reach, and its page."""

from __future__ import annotations

import functools
import json
import pathlib

import numpy as np
import pytest
from PIL import Image

from tests.climb.by_hand import TRIPODS, gait
from wbc.climb import machines, report
from wbc.climb.checker import check
from wbc.climb.grids import cylinder_grid
from wbc.climb.loop import ClimbLoop, ClimbRun
from wbc.climb.places import body_frames
from wbc.climb.reach import LimbReach
from wbc.climb.report import pictures
from wbc.climb.report.figures import body_speed, rate_shares
from wbc.climb.report.pictures import ClimbPictures
from wbc.climb.report.reach_map import footholds_in_reach
from wbc.climb.report.surroundings import (
    body_triangles,
    link_colours,
    near_footholds,
    stud_triangles,
    surface_triangles,
)
from wbc.climb.scenes import draw
from wbc.extras import MissingPackageError
from wbc.multibody import pin
from wbc.symbolic.joint_steps import place
from wbc.viewer.walks import save_climb_page

#: What is there without pictures
ALWAYS = {"log.npz", "check.txt", "figures.json", "report.html"}
PLOTS = {"contacts.png", "speed.png", "rates.png"}


@functools.cache
def walked() -> ClimbRun:
    """A hexapod on tripods."""
    return ClimbLoop(gait(TRIPODS), backend="vm").run()


@pytest.fixture(autouse=True)
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pictures, "PICTURE_SIZE", (240, 160))
    monkeypatch.setattr(pictures, "MOST_FRAMES", 4)
    monkeypatch.setattr("wbc.climb.report.reach_map.PICTURE_SIZE", (240, 160))


def test_a_folder_has_figures_pictures_and_a_page(tmp_path: pathlib.Path) -> None:
    run = walked()
    found = check(run.log, run.plans[0].climber, run.scene)
    about = {"robot": "hexapod", "scene": "stones", "speed": 0.1, "planning": 0.25}
    written = report.write(run, found, about, tmp_path, replay=save_climb_page)
    names = {file.name for file in written}
    film = {"climb.gif", "climb.mp4"} & names
    assert len(film) == 1
    stills = {name for name in names if name.startswith("still_")}
    assert names - stills - film == ALWAYS | PLOTS | {"climb.png", "reach.png", "replay.html"}
    assert 1 <= len(stills) <= 3
    assert all(any(file.match(pattern) for pattern in report.WRITTEN) for file in written)
    assert Image.open(tmp_path / "climb.png").size == (240, 160)
    figures = json.loads((tmp_path / "figures.json").read_text())
    assert figures["outcome"] == "arrived"
    assert figures["violations"] == [str(finding) for finding in found.violations]
    assert figures["steps"] == len(run.plans[0].moves)
    assert figures["planning"] == 0.25
    way = np.linalg.norm(np.diff(run.log.array("q")[:, :3], axis=0), axis=1).sum()
    assert figures["speed"]["mean"] == pytest.approx(way / run.log["t"][-1], rel=0.2)
    assert figures["speed"]["kept"] == pytest.approx(figures["speed"]["mean"] / 0.1)
    assert figures["checks"]["clearance of links"]["worst"] >= 0.0
    page = (tmp_path / "report.html").read_text()
    assert page.count("data:image/png") >= 6
    assert "all 12 rules are kept" in page or "clearance of links" in page


def test_pictures_end_where_they_are_asked_to_and_missing_packages_are_named(
    tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run, asked = walked(), list[str]()
    stop = functools.partial(lambda: len(asked) > 1)
    written = report.write(run, None, {}, tmp_path, True, lambda what, _share: asked.append(what), stop=stop)
    assert asked == ["plots", "overview"]
    assert {file.name for file in written} == (ALWAYS | PLOTS | {"climb.png"}) - {"check.txt"}
    figures = json.loads((tmp_path / "figures.json").read_text())
    assert figures["violations"] is None
    assert "kept" not in figures["speed"]

    def missing(*_: object) -> None:
        raise MissingPackageError("plots", "matplotlib", "a plot needs this package")

    monkeypatch.setattr("wbc.climb.report.folder.save_plots", missing)
    monkeypatch.setattr("wbc.climb.report.folder.require", missing)
    other = tmp_path / "bare"
    other.mkdir()
    assert {file.name for file in report.write(run, None, {}, other)} == ALWAYS - {"check.txt"}
    assert "a plot needs this package" in (other / "report.html").read_text()


def test_speeds_and_rates_are_those_of_the_log() -> None:
    run = walked()
    times, speed, turning = body_speed(run.log)
    t, q = run.log["t"], run.log.array("q")
    row = int(speed.argmax())
    first, last = (int(np.abs(t - (times[row] + part)).argmin()) for part in (-0.05, 0.05))
    assert speed[row] == pytest.approx(np.linalg.norm(q[last, :3] - q[first, :3]) / 0.1, rel=1e-9)
    turn = pin.log3(pin.Quaternion(q[first, 3:7]).matrix().T @ pin.Quaternion(q[last, 3:7]).matrix())
    assert turning[row] == pytest.approx(np.linalg.norm(turn) / 0.1, abs=1e-6)
    robot = run.plans[0].climber.robot
    largest = np.abs(run.log.array("v")[:, 6:] / robot.limits.velocity[6:]).max()
    assert max(share.max() for share in rate_shares(run).values()) == pytest.approx(largest)


def test_footholds_in_reach_are_those_that_postures_are_found_for() -> None:
    climber, scene = machines.climber("walker"), cylinder_grid()
    body = body_frames(climber, scene, ["13,9"])[0]
    reached = footholds_in_reach(climber, scene, [body])
    assert 0 < reached.sum() < reached.size
    reach, rng = LimbReach(climber), np.random.default_rng(0)
    for row in rng.integers(0, len(scene.footholds), 40):
        for limb in range(3):
            angles, solved = reach.postures(limb, place(body.actInv(scene.footholds[row].pose))[None])
            assert bool(solved[0, 0]) == reached[row, limb]
            if solved[0, 0]:
                pose = climber.contact_pose(
                    climber.with_limb(climber.with_body(climber.rest, body), limb, angles[0, 0]), limb
                )
                assert np.linalg.norm(pose.translation - scene.positions[row]) < 1e-6
    # From twice as many poses no less is reached
    more = footholds_in_reach(climber, scene, [body, body * pin.SE3(np.eye(3), np.array([0.3, 0.0, 0.0]))])
    assert (more | ~reached).all()


def test_what_is_drawn_is_near_the_way_and_of_the_limbs() -> None:
    run = walked()
    climber, scene = run.plans[0].climber, run.scene
    drawn = ClimbPictures(run)
    assert set(np.unique(run.log.array("contact")).astype(int)) - {-1} <= set(drawn.near.tolist())
    # Up in pictures is against gravity
    assert drawn.turn[2] == pytest.approx(-np.array(scene.gravity) / 9.81)
    colours = link_colours(climber)
    assert {colours[link] for link in colours if link.startswith("limb1")}.isdisjoint(
        {colours[link] for link in colours if link.startswith("limb2")}
    )
    grid = cylinder_grid()
    rows = near_footholds(grid, grid.positions[[300]] + 0.5 * grid.normals[[300]], 0.6)
    assert 300 in rows
    assert (np.linalg.norm(grid.positions[rows] - grid.positions[300], axis=1) < 0.8).all()
    corners = surface_triangles(grid, rows, 2.0).reshape(-1, 3)
    assert np.ptp(np.linalg.norm(corners[:, :2], axis=1)) < 0.01
    assert len(stud_triangles(grid, rows, 0.03)) == 30 * len(rows)


def test_bodies_under_footholds_that_are_drawn_are_drawn() -> None:
    scene = draw("rubble", 1.0).scene
    # From high above, footholds count along their surfaces
    way, corners = np.array([[1.5, 0.0, 1.2]]), {}
    rows = near_footholds(scene, way, 1.0).tolist()
    for name, given in (("near", ()), ("under", rows)):
        corners[name] = body_triangles(scene, way, 1.0, given).reshape(-1, 3)
    for row in rows:
        on = scene.bodies[scene.footholds[row].on].placement.translation
        assert np.linalg.norm(corners["under"] - on, axis=1).min() < 0.4
    assert len(corners["near"]) < len(corners["under"])
