"""``wbc walk`` and ``wbc walk compare`` as a user types them, within this process."""

from __future__ import annotations

import functools
import json
import os
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.image import imread
from PIL import Image

import wbc
from tests.cli.test_commands import run
from tests.formats.runs import ticks_and_reasons
from wbc import style
from wbc.robots import WalkerData
from wbc.robots.walker_data import WALKER_DIGEST
from wbc.walking.checker.report import Finding, Report
from wbc.walking.holds.built_in import plane
from wbc.walking.log.log import WalkLog
from wbc.walking.loop.walk import Walk
from wbc.walking.planner.detours import ALONG, beside, route as detours
from wbc.walking.report.figures import CHECKED
from wbc.walking.run.places import over_holds
from wbc.walking.run.request import Site

SHORT = ["--from", "13,9", "--to", "13,14"]


#: Pictures as small as can be looked at by a test
SMALL = {
    "wbc.walking.report.stills.COUNT": 1,
    "wbc.walking.report.stills.SIZE": (300, 200),
    "wbc.walking.report.animation.SIZE": (300, 200),
    "wbc.walking.report.animation.MOST": 6,
    "wbc.viewer.runs.PAGE_STATES": 30,
    "wbc.track.scene.SUPERSAMPLING": 1,
    "wbc.track.render.SHADOW_MAP": 300,
    "wbc.style.SETTINGS": {**style.SETTINGS, "savefig.dpi": 50},
}


@functools.cache
def short_walk(folder: Path) -> tuple[int, str, str]:
    """One walk with all that it leaves, for all tests of this file; no slower film than needed."""
    return run("walk", *SHORT, "--mcap", "--out", folder)


@pytest.fixture(scope="module")
def walked(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, tuple[int, str, str]]:
    folder = tmp_path_factory.mktemp("walk") / "run"
    patch = pytest.MonkeyPatch()
    for name, value in SMALL.items():
        patch.setattr(name, value)
    done = short_walk(folder)
    patch.undo()
    return folder, done


def test_a_walk_leaves_its_folder(walked: Any) -> None:
    folder, (code, out, err) = walked
    assert code == 0, err
    names = {path.name for path in folder.iterdir()}
    assert {"run.npz", "plan.json", "structure.csv", "robot.urdf", "check.txt"} <= names
    assert {"summary.json", "summary.txt", "walk.gif", "replay.html", "walk.png", "still_1.png"} <= names
    plots = {"holds", "margins", "joints", "rates", "drift", "wrists", "speed", "tick_time", "reach_map"}
    assert {f"{plot}.png" for plot in plots} <= names
    for text in ("arrived", "re-grasps", "WalkerData", "real-time factor", "external checker"):
        assert text in out
    ticks, said = ticks_and_reasons(folder / "ticks.mcap")
    assert ticks == len(wbc.Recording(folder / "ticks.npz").status) > 100
    assert any(" hold " in text for text in said)


def test_the_summary_is_that_of_the_log(walked: Any) -> None:
    folder, _ = walked
    log, told = WalkLog.load(folder), json.loads((folder / "summary.json").read_text())
    assert told["outcome"] == "arrived"
    assert told["duration"] == log.t[-1]
    assert told["robot"] == log.meta["robot_digest"]
    assert told["speed"]["part"] > 0.5
    assert told["body_error"] < 0.005
    assert told["slip"] < 0.002
    steps = json.loads((folder / "plan.json").read_text())["regrasps"]
    landed = np.diff((log.hand_state == 2).astype(int), axis=0) == 1
    assert told["plan"]["regrasps"] == len(steps) == landed.sum() >= 1
    # Positions follow from the rates that were commanded, and from nothing else
    np.testing.assert_allclose(np.diff(log.q, axis=0), log.v[:-1] * log.dt, atol=1e-12)


def test_pictures_show_something(walked: Any) -> None:
    folder, _ = walked
    for name in ("walk", "still_1", "reach_map", "holds", "joints"):
        pixels = imread(folder / f"{name}.png")[..., :3]
        assert pixels.std() > 0.03, name
        assert pixels[:5, :5].min() > 0.8, name
    with Image.open(folder / "walk.gif") as film:
        first, count = np.array(film.convert("RGB"), dtype=int), film.n_frames
        film.seek(count - 1)
        last = np.array(film.convert("RGB"), dtype=int)
    assert count == 6
    assert (np.abs(first - last).max(axis=-1) > 40).mean() > 0.002  # it moves
    assert np.abs(first - last)[-20:].max() < 40  # and what stands still does not


def test_the_page_needs_no_network(walked: Any) -> None:
    folder, _ = walked
    page = (folder / "replay.html").read_text()
    assert "__VISER_EMBED_DATA__" in page
    assert 0.5e6 < len(page) < 5e6
    assert 'src="http' not in page
    assert 'href="http' not in page


def test_a_folder_with_a_run_is_kept(walked: Any) -> None:
    folder, _ = walked
    code, _, err = run("walk", *SHORT, "--out", folder)
    assert code == 2
    assert "--force" in err


def test_plans_are_compared(walked: Any, tmp_path: Path) -> None:
    folder, _ = walked
    plan = folder / "plan.json"
    code, out, _ = run("walk", "compare", plan, plan)
    assert (code, out.startswith("the same")) == (0, True)
    other = json.loads(plan.read_text())
    other["regrasps"][0]["target"] = "1,1"
    (tmp_path / "plan.json").write_text(json.dumps(other))
    code, out, _ = run("walk", "compare", plan, tmp_path / "plan.json")
    assert code == 1
    assert out.startswith("re-grasp 1: ")
    assert "1,1" in out
    (tmp_path / "plan.json").write_text("{}")
    assert run("walk", "compare", plan, tmp_path / "plan.json")[0] == 2


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--structure", "cylindre"], "did you mean 'cylinder'"),
        (["--structure", "there/is/none.csv"], "there/is/none.csv"),
        (["--objective", "fast"], "objective"),
        (["--plant", "mujco"], "did you mean 'mujoco'"),
        (["--speed", "0"], "speed"),
        (["--speed", "-0.1"], "speed"),
        (["--speed", "nan"], "speed"),
        (["--to", "13"], "T,A"),
        (["--to", "13,40"], "place 2.A"),
        (["--structure", "truss", "--to", "L9,1"], "L9,1"),
        (["--remove-rows", "30"], "no hold has 30"),
        (["--remove", "1.5"], "fraction"),
        (["published", "--structure", "plane"], "cylinder"),
        (["--set", "hand_radius"], "NAME=NUMBER"),
        (["--gravity", "0,1"], "gravity: expected 3 numbers"),
        (["--set", "hand_radus=0.1"], "did you mean 'hand_radius'"),
    ],
)
def test_bad_input_is_named_and_nothing_is_written(arguments: list[str], told: str, tmp_path: Path) -> None:
    code, out, err = run("walk", *arguments, "--out", tmp_path / "run")
    assert (code, out) == (2, "")
    assert told in err
    assert not (tmp_path / "run").exists()


def test_a_folder_that_cannot_be_written(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.touch()
    code, _, err = run("walk", *SHORT, "--out", file / "run")
    assert code == 2
    assert "cannot be written" in err


def test_what_is_out_of_reach_is_refused_with_its_reason(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(detours, "MESHES", (ALONG,))
    monkeypatch.setattr(beside, "WORK", 200.0)
    folder = tmp_path / "run"
    folder.mkdir()
    for name in ("summary.json", "run.npz", "still_7.png", "mine.txt"):
        (folder / name).touch()
    changed = ["--set", "hand_radius=0.06"]
    code, _, err = run("walk", *SHORT, *changed, "--remove-rows", "1-9,12-24", "--out", folder, "--force")
    assert code == 3
    assert "refused" in err
    assert "no hand can be moved in time" in err
    told = json.loads((folder / "summary.json").read_text())
    assert told["outcome"] == "refused"
    assert told["reason"]
    # What the run went by, and what of it is not the file's
    assert told["robot"] == WalkerData.read(hand_radius=0.06).digest != WALKER_DIGEST
    assert "changed: hand_radius = 0.06" in " ".join((folder / "summary.txt").read_text().split())
    assert (folder / "reach_map.png").exists()
    # Of an earlier run nothing is left, of others everything
    assert {"run.npz", "still_7.png", "mine.txt"} & {path.name for path in folder.iterdir()} == {"mine.txt"}


def test_ctrl_c_leaves_what_there_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tick, count = Walk.tick, []

    def pressed(self: Any) -> Any:
        count.append(1)
        if len(count) == 60:
            os.kill(os.getpid(), signal.SIGINT)
        return tick(self)

    monkeypatch.setattr(Walk, "tick", pressed)
    folder = tmp_path / "run"
    code, out, _ = run("walk", *SHORT, "--out", folder)
    assert code == 130
    told = json.loads((folder / "summary.json").read_text())
    assert told["outcome"] == "interrupted"
    # The body comes to rest within what was said before
    assert 61 < len(WalkLog.load(folder)) < 120
    assert 0.0 < told["abort"]["body"] <= told["abort"]["body_bound"] <= told["stopping"]["body"]
    assert np.abs(WalkLog.load(folder).v[-2]).max() < 0.01
    assert "interrupted" in out


def test_the_published_planner_walks(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    code, out, _ = run("walk", "published", *SHORT, "--speed", "0.0762", "--out", folder)
    assert code == 0, out
    data = np.load(folder / "published.npz")
    assert data["bodies"].shape[1:] == (4, 4)
    assert "published" in out
    assert "calibration" in out
    assert len(json.loads((folder / "summary.json").read_text())["robot"]) == 12


def test_bodies_stand_over_holds() -> None:
    structure = plane()
    first, last = over_holds(structure, ("3,3", "3,9"), 1.3)
    np.testing.assert_allclose(first.translation, structure["3,3"].pose.translation + [0, 0, 1.3])
    np.testing.assert_allclose(first.rotation[:, 0], [1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(first.rotation[:, 2], [0, 0, -1], atol=1e-12)
    np.testing.assert_allclose(last.rotation, first.rotation, atol=1e-12)


def test_removed_holds_are_gone() -> None:
    structure = Site(rows="12-14", fraction=0.1, seed=3).build()
    assert len(structure) == 25 * 21 - round(0.1 * 25 * 21)
    assert not any(hold.endswith((",12", ",13", ",14")) for hold in structure.ids)
    assert Site(rows="12-14", fraction=0.1, seed=3).build().digest == structure.digest


def test_a_violation_is_the_outcome(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = Finding("joint rate / limit", 3, 1.25, 1.0, "", 0.5, "arm1_joint2")
    others = tuple(Finding(kind, 0, 1.0, 0.0, "m", 0.1, "there") for kind in CHECKED)
    report = Report((found, *others), 100, 1000, 1.0, 0)
    monkeypatch.setattr("wbc.walking.report.folder.check_run", lambda *_: report)
    code, out, err = run("walk", *SHORT, "--no-pictures", "--out", tmp_path)
    assert code == 4
    first = (tmp_path / "summary.txt").read_text().splitlines()[0]
    assert first.startswith("outcome")
    assert "violated: joint rate / limit 1.25, at most 1 are allowed, at 0.50 s, arm1_joint2" in first
    assert "apart from that it arrived" in first
    assert json.loads((tmp_path / "summary.json").read_text())["outcome"] == "violated"
    assert "violated" in out.splitlines()[1]
    assert "violated" in err


def test_a_folder_of_a_run_that_was_killed_is_kept(tmp_path: Path) -> None:
    for name in ("begun.json", "run.part", "structure.csv", "run.npz"):
        folder = tmp_path / name
        folder.mkdir()
        (folder / name).write_text("mine")
        code, _, err = run("walk", *SHORT, "--out", folder)
        assert code == 2
        assert f"there is a run in this folder ({name})" in err
        assert (folder / name).read_text() == "mine"


def test_holds_in_inches_are_refused(tmp_path: Path) -> None:
    rows = [f'"{t},{a}",{9.25 * a},{9.25 * t},0,0,0,-1,1,0,0,free,0.05' for t in range(1, 9) for a in range(1, 9)]
    file = tmp_path / "inches.csv"
    file.write_text("\n".join(["id, x, y, z, ax, ay, az, rx, ry, rz, roll, max_tilt", *rows]))
    ends = ["--from", "3,3", "--to", "3,7"]
    code, _, err = run("walk", "--structure", file, *ends, "--out", tmp_path / "run")
    assert code == 2
    assert "no two holds are nearer than 9.25 m" in err
    assert "structure files are in metres, is this one in inches" in err
    file.write_text("\n".join(["id, x, y, z, ax, ay, az, rx, ry, rz, roll, max_tilt", *rows[:2]]))
    code, _, err = run("walk", "--structure", file, "--from", "1,1", "--to", "1,2", "--out", tmp_path / "run")
    assert (code, "3 hands need as many holds, and there are 2" in err) == (2, True)
