"""``wbc walk`` as a user types it, within this process: its folder, its exit codes, and what it refuses."""

from __future__ import annotations

import json
import os
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import wbc
import wbc.log
from tests.cli.test_commands import run
from tests.formats.runs import ticks_and_reasons
from wbc.cli import climbing
from wbc.climb.checker import ClimbReport
from wbc.climb.checker.report import RuleFinding
from wbc.climb.loop import ClimbLoop

SHORT = ["--from", "13,9", "--to", "13,13"]
BARE = ["--no-pictures", "--backend", "vm"]


@pytest.fixture(scope="module")
def walked(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """A short walk, recorded."""
    folder = tmp_path_factory.mktemp("walk") / "run"
    code, out, err = run("walk", *SHORT, *BARE, "--mcap", "--out", folder)
    assert code == 0, err
    return folder, out


def test_a_walk_leaves_its_folder(walked: tuple[Path, str]) -> None:
    folder, out = walked
    names = {"request.json", "plan.npz", "log.npz", "check.txt", "figures.json", "ticks.npz", "ticks.mcap"}
    assert names <= {path.name for path in folder.iterdir()}
    assert "log.part" not in {path.name for path in folder.iterdir()}
    for text in ("arrived", "moves", "real-time factor", "rules are kept", "walker on cylinder_grid"):
        assert text in out
    figures = json.loads((folder / "figures.json").read_text())
    assert (figures["outcome"], figures["violations"]) == ("arrived", [])
    ticks, said = ticks_and_reasons(folder / "ticks.mcap")
    assert ticks == len(wbc.log.load(folder)) - 1 == len(wbc.Recording(folder / "ticks.npz").status)
    assert any(" contact/" in text for text in said)


def test_a_folder_with_a_run_is_kept(walked: tuple[Path, str], tmp_path: Path) -> None:
    folder, _ = walked
    code, _, err = run("walk", *SHORT, *BARE, "--out", folder)
    assert (code, "--force" in err) == (2, True)
    for name in ("request.json", "log.part", "scene.csv"):
        (tmp_path / name).write_text("mine")
        code, _, err = run("walk", *SHORT, *BARE, "--out", tmp_path)
        assert (code, f"there is a run in this folder ({name})" in err) == (2, True)
        (tmp_path / name).unlink()
    # A request that is refused takes nothing away even so
    (tmp_path / "log.npz").write_text("mine")
    assert run("walk", "--speed", "nan", *BARE, "--force", "--out", tmp_path)[0] == 2
    assert (tmp_path / "log.npz").read_text() == "mine"


def test_plans_are_compared(walked: tuple[Path, str], tmp_path: Path) -> None:
    folder, _ = walked
    code, out, _ = run("walk", "compare", folder, folder / "plan.npz")
    assert (code, out.strip()) == (0, "the same 2 moves")
    assert run("walk", "--to", "13,8", *BARE, "--out", tmp_path / "other")[0] == 0
    code, out, _ = run("walk", "compare", folder, tmp_path / "other")
    assert (code, "start of arm" in out) == (1, True)


def test_a_plan_is_carried_out_as_it_is(walked: tuple[Path, str], tmp_path: Path) -> None:
    folder, _ = walked
    plan = ["--plan", folder / "plan.npz", *SHORT, *BARE, "--no-check"]
    assert run("walk", *plan, "--out", tmp_path / "run")[0] == 0
    np.testing.assert_array_equal(wbc.log.load(tmp_path / "run").array("q"), wbc.log.load(folder).array("q"))
    code, _, err = run("walk", *plan, "--remove-rows", "9-12", "--out", tmp_path / "less")
    assert (code, "foothold: unknown name" in err) == (2, True)
    code, _, err = run("walk", *plan, "--arms", "4", "--out", tmp_path / "four")
    assert (code, "it is of robot walker; here the robot is another one" in err) == (2, True)
    assert not (tmp_path / "less").exists()


def test_a_folder_is_checked(walked: tuple[Path, str], tmp_path: Path) -> None:
    code, out, _ = run("walk", "check", walked[0])
    assert (code, out.strip().endswith("the run keeps all rules")) == (0, True)
    # Another joint angle is not where the hand was
    log = wbc.log.load(walked[0])
    for name in ("request.json", "plan.npz"):
        (tmp_path / name).write_bytes((walked[0] / name).read_bytes())
    log.columns["q.9"][200] += 0.05
    wbc.log.save(log, tmp_path, "npz")
    code, out, _ = run("walk", "check", tmp_path)
    assert (code, "VIOLATED" in out) == (4, True)
    (tmp_path / "request.json").unlink()
    assert run("walk", "check", tmp_path)[0] == run("walk", "check", tmp_path / "none")[0] == 2


def test_what_is_out_of_reach_is_refused_with_its_reason(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    folder.mkdir()
    for name in ("log.npz", "climb.png", "mine.txt"):
        (folder / name).touch()
    ends = ["--from", "13,9", "--to", "13,18"]
    code, out, err = run("walk", *ends, "--remove-rows", "1-7,12-24", *BARE, "--out", folder, "--force")
    assert (code, "refused" in out, "refused: " in err) == (3, True, True)
    figures = json.loads((folder / "figures.json").read_text())
    assert (figures["outcome"], bool(figures["reason"])) == ("refused", True)
    # Of an earlier run nothing is left, of others everything
    assert {path.name for path in folder.iterdir()} == {"request.json", "figures.json", "mine.txt"}


def test_ctrl_c_leaves_what_there_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tick, count = ClimbLoop.tick, []

    def pressed(self: Any) -> None:
        count.append(1)
        if len(count) == 60:
            os.kill(os.getpid(), signal.SIGINT)
        tick(self)

    monkeypatch.setattr(ClimbLoop, "tick", pressed)
    code, out, _ = run("walk", *SHORT, *BARE, "--out", tmp_path / "run")
    assert (code, "stopped: interrupted" in out) == (130, True)
    log = wbc.log.load(tmp_path / "run")
    assert 61 < len(log) < 160
    assert np.abs(log.array("v")[-1]).max() < 0.01
    assert run("walk", "check", tmp_path / "run")[0] == 0
    # It goes on from there
    monkeypatch.setattr(ClimbLoop, "tick", tick)
    assert run("walk", "resume", tmp_path / "run", *BARE, "--out", tmp_path / "more")[0] == 0


def test_a_violation_is_the_exit_code(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    broken = RuleFinding("joint's rate", 1.25, 1.0, "of its limit", False, 0.5, "arm1_joint2", 3)
    monkeypatch.setattr("wbc.climb.session.check", lambda *_: ClimbReport((broken,)))
    code, out, err = run("walk", *SHORT, *BARE, "--out", tmp_path)
    assert (code, "VIOLATED" in out, "arm1_joint2" in err) == (4, True, True)
    assert json.loads((tmp_path / "figures.json").read_text())["violations"]


def test_a_folder_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    code, _, err = run("walk", *SHORT, *BARE, "--out", tmp_path / "file" / "run")
    assert (code, "cannot be written" in err) == (2, True)


def test_scenes_in_inches_are_refused(tmp_path: Path) -> None:
    rows = [f'"{t},{a}",{9.25 * a},{9.25 * t},0,0,0,-1,1,0,0,free' for t in range(1, 9) for a in range(1, 9)]
    file = tmp_path / "inches.csv"
    file.write_text("\n".join(["id, x, y, z, ax, ay, az, rx, ry, rz, roll", *rows]))
    code, _, err = run("walk", "--scene", file, "--from", "3,3", "--to", "3,7", "--out", tmp_path / "run")
    assert (code, "no two footholds are nearer than 9.25 m" in err, "in metres" in err) == (2, True, True)


def test_the_published_planner_walks(tmp_path: Path) -> None:
    code, out, _ = run("walk", "published", "--to", "13,11", "--speed", "0.0762", "--out", tmp_path / "run")
    assert (code, "published" in out) == (0, True)
    assert np.load(tmp_path / "run" / "published.npz")["bodies"].shape[1:] == (4, 4)
    assert set(climbing.PUBLISHED_FILES) == {path.name for path in (tmp_path / "run").iterdir()}
