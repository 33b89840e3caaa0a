"""The commands as a user types them, within this process."""

from __future__ import annotations

import functools
import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any, get_args

import pytest
from typer.testing import CliRunner

import wbc
from wbc import style, track
from wbc.cli import session
from wbc.cli.app import COMMANDS, app, command, options_class
from wbc.cli.reading import fields_of
from wbc.track.plots import save_picture

FAST = ["--backend", "vm", "--rate", "50", "--duration", "0.5", "--no-plots"]


def run(*arguments: str | Path) -> tuple[int, str, str]:
    """(exit code, standard output, standard error) of ``wbc ARGUMENTS``."""
    result = CliRunner(env={"COLUMNS": "200"}).invoke(app, [str(a) for a in arguments])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.exit_code, result.stdout, result.stderr


MODES = [(name, mode) for name, entry in COMMANDS.items() for mode in entry.modes]


def test_help_names_every_command_in_one_line() -> None:
    result = CliRunner(env={"COLUMNS": "80"}).invoke(app, ["--help"])
    rows = [row.strip("│ ") for row in result.stdout.splitlines()]
    for name, entry in COMMANDS.items():
        assert any(row.startswith(f"{name} ") and row.endswith(entry.line) for row in rows), name
    assert len(rows) < 40


@pytest.mark.parametrize("name", COMMANDS)
def test_help_of_a_command_names_its_modes(name: str) -> None:
    code, out, _ = run(name, "--help")
    assert code == 0
    for mode in COMMANDS[name].modes:
        line = " ".join(str(command(name, mode).help).split("\n\n")[0].split())
        assert line in " ".join(out.split())
        assert not mode or f"wbc {name} {mode}: {line}" in out


@pytest.mark.parametrize(("name", "mode"), MODES)
def test_every_option_says_what_it_is_and_in_which_unit(name: str, mode: str) -> None:
    """Numbers with a fraction have a unit in brackets; [1] is that of a ratio."""
    for field in fields_of(options_class(name, mode)):
        assert field.said.help, field.name
        assert float not in (field.one, *get_args(field.one)) or re.search(r"\[[^\]]+\]", field.said.help), field.name


def test_an_unknown_command_names_the_nearest() -> None:
    code, out, err = run("rbots")
    assert (code, out) == (2, "")
    assert "Did you mean 'robots'" in err
    assert "mode: unknown name, did you mean 'path'?" in run("walk", "pth")[2]
    assert "mode: unknown name, did you mean 'show'?" in run("robots", "shw", "panda")[2]


def test_version() -> None:
    assert run("--version") == (0, f"wbc {wbc.__version__}\n", "")


def test_the_module_is_the_command() -> None:
    command = [sys.executable, "-m", "wbc"]
    done = subprocess.run([*command, "--version"], capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == (f"wbc {wbc.__version__}\n", "")
    assert subprocess.run([*command, "replay", "none"], capture_output=True, check=False).returncode == 2


@pytest.mark.parametrize(("given", "taken"), [((), 10.0), (("--silence", "3"), 3.0)])
def test_play_says_how_long_a_page_may_be_silent(
    given: tuple[str, ...], taken: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: dict[str, Any] = {}
    monkeypatch.setattr("wbc.viewer.run", lambda *_, **options: seen.update(options))
    assert run("view", "play", "panda", "--backend", "vm", *given)[0] == 0
    assert seen["silence"] == taken


def test_robots_lists_the_table() -> None:
    code, out, _ = run("robots")
    assert code == 0
    assert {line.split()[0] for line in out.splitlines()[2:]} == set(wbc.robots.names())
    code, out, _ = run("robots", "panda")
    assert {line.split()[0] for line in out.splitlines()[2:]} == {"panda", "panda_collision"}
    broken = [r for r in wbc.robots.table() if r.problem]
    code, out, _ = run("robots", "--all")
    assert all(recipe.name in out for recipe in broken)


def test_robots_without_a_match_names_the_nearest() -> None:
    code, out, err = run("robots", "pandda")
    assert (code, out) == (2, "")
    assert "did you mean 'panda'" in err


def test_robot_shows_limits_and_frames() -> None:
    code, out, _ = run("robots", "show", "panda")
    assert code == 0
    row = next(line for line in out.splitlines() if line.startswith("panda_joint4"))
    assert row.split() == ["panda_joint4", "rad", "-3.072", "-0.0698", "2.175", "12.5", "87", "-2.356"]
    assert "panda_hand_tcp" in out
    assert "Franka" in out
    code, out, _ = run("robots", "show", "talos", "--no-frames")
    assert code == 0
    assert "floating base" in out


@pytest.mark.parametrize("kind", ["parquet", "npz"])
def test_track_leaves_a_run_folder(kind: str, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    ball = ["--sphere", "0.5,0.3,0.5,0.1,0,-0.1,0", "--floor", "-0.5", "--plane", "swing", "--swing", "0.2"]
    code, out, err = run("track", "panda", *FAST, *ball, "--log", kind, "--out", folder)
    assert (code, err) == (0, "")
    assert {p.name for p in folder.iterdir()} == {f"log.{kind}", "summary.json", "ticks.npz", "report.html"}
    log = track.load(folder)
    assert len(log) == 25
    assert set(log.meta["obstacles"]) == {"sphere1", "floor"}
    assert log.meta["plane"] == {"amplitude": 0.2, "cycles": 2.0}
    assert json.loads((folder / "summary.json").read_text())["status"]["solved"] == 25
    for words in ("complete, 25 of 25 ticks", "position error", "least clearance", "tick time", "log."):
        assert words in out


def test_an_obstacle_in_the_arm_at_the_start_is_said(tmp_path: Path) -> None:
    code, _, err = run("track", *FAST, "--sphere", "0.3,0,0.5,0.1", "--out", tmp_path)
    assert code == 0
    assert "warning: at the start panda_hand is -" in err


def test_track_of_a_position_alone_lets_the_hand_turn(tmp_path: Path) -> None:
    options = ["--kind", "position", "--path", "line", "--plane", "off", *FAST]
    assert run("track", "ur5", *options, "--out", tmp_path / "run")[0] == 0
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert "rotation_error" not in summary
    assert summary["position_error"]["max"] < 0.05


def test_track_solvers_agree(tmp_path: Path) -> None:
    logs = []
    for solver in ("daqp", "qpoases"):
        code, _, _ = run("track", *FAST, "--solver", solver, "--out", tmp_path / solver)
        assert code == 0
        logs.append(track.load(tmp_path / solver))
    assert logs[1].meta["solver"] == "qpoases"
    assert abs(logs[0].array("v") - logs[1].array("v")).max() < 1e-6


def test_track_follows_a_file_after_an_approach(tmp_path: Path) -> None:
    file = tmp_path / "way.csv"
    file.write_text("t,x,y,z,qx,qy,qz,qw\n0,0.4,0.1,0.5,1,0,0,0\n1,0.4,-0.1,0.5,1,0,0,0\n")
    code, _, err = run("track", "--path", file, *FAST, "--out", tmp_path / "run")
    assert (code, err) == (0, "")
    log = track.load(tmp_path / "run")
    assert log.meta["path"] == "way"
    assert log.meta["duration"] == pytest.approx(1.0, abs=0.2)
    assert log["target.y"][-1] < -0.095
    assert log["target.x"][0] == pytest.approx(log["pose.x"][0], abs=1e-12)


def test_track_with_holds_and_start(tmp_path: Path) -> None:
    start = ",".join(str(x) for x in wbc.robots.load("ur5").neutral + 0.1)
    code, _, _ = run("track", "ur5", "--start", start, "--plane", "off", *FAST, "--out", tmp_path / "ur5")
    assert code == 0
    assert track.load(tmp_path / "ur5")["q.shoulder_pan_joint"][0] == pytest.approx(
        wbc.robots.load("ur5").neutral[0] + 0.1
    )


def test_a_run_is_not_written_over_by_accident(tmp_path: Path) -> None:
    assert run("track", *FAST, "--out", tmp_path)[0] == 0
    before = (tmp_path / "log.parquet").stat().st_mtime_ns
    code, _, err = run("track", *FAST, "--out", tmp_path)
    assert code == 2
    assert "use --force" in err
    assert (tmp_path / "log.parquet").stat().st_mtime_ns == before
    assert run("track", *FAST, "--log", "npz", "--out", tmp_path, "--force")[0] == 0
    assert {p.name for p in tmp_path.iterdir()} == {"log.npz", "summary.json", "ticks.npz", "report.html"}


def test_a_folder_that_cannot_be_made(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    code, _, err = run("track", *FAST, "--out", tmp_path / "file" / "run")
    assert code == 2
    assert "out: cannot be written" in err


def test_default_folder_is_under_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert run("track", *FAST)[0] == 0
    (folder,) = (tmp_path / "runs").iterdir()
    assert folder.name.startswith("panda-circle-")
    assert (folder / "log.parquet").is_file()


def test_interrupt_leaves_a_valid_run_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C at tick 9 of the demo: log, plots and summary of nine ticks, exit code 130."""
    real = session.track

    def interrupted(plan: Any, progress: Any, stop: Any, compiled: Any, plant: Any) -> track.Log:
        def at_nine(ticks: int) -> None:
            progress(ticks)
            if ticks == 9:
                os.kill(os.getpid(), signal.SIGINT)

        return real(plan, at_nine, stop, compiled, plant=plant)

    monkeypatch.setattr(session, "track", interrupted)
    monkeypatch.setattr(session, "save_picture", functools.partial(save_picture, size=(96, 60)))
    monkeypatch.setitem(style.SETTINGS, "savefig.dpi", 50)
    monkeypatch.setattr("wbc.track.scene.SUPERSAMPLING", 1)
    monkeypatch.setattr("wbc.track.render.SHADOW_MAP", 300)
    handler = signal.getsignal(signal.SIGINT)
    code, out, _ = run("track", "demo", "--backend", "vm", "--rate", "50", "--out", tmp_path)
    assert code == 130
    assert "interrupted, 9 of 600 ticks" in out
    log = track.load(tmp_path)
    assert len(log) == 9
    assert log.meta["interrupted"]
    assert json.loads((tmp_path / "summary.json").read_text())["run"] == "interrupted"
    plots = {"joints", "velocities", "accelerations", "errors", "tick_time", "plane", "clearance", "overview"}
    assert {p.stem for p in tmp_path.glob("*.png")} == plots
    assert all(p.read_bytes().startswith(b"\x89PNG") for p in tmp_path.glob("*.png"))
    assert signal.getsignal(signal.SIGINT) is handler


def test_interrupt_before_the_first_tick_leaves_an_empty_log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(session.Stopper, "__call__", lambda self: True)
    code, out, _ = run("track", "demo", "--backend", "vm", "--out", tmp_path)
    assert code == 130
    assert "interrupted, 0 of 2400" in out
    assert len(track.load(tmp_path)) == 0


def test_second_interrupt_is_not_held_back() -> None:
    stopper = session.Stopper()
    with stopper.listening():
        os.kill(os.getpid(), signal.SIGINT)
        assert stopper()
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)
