"""The modes of ``wbc walk``: by commands, by keys, one arm, resumed, asked, and from a free start."""

from __future__ import annotations

import json
import os
import pty
import termios
import time
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from tests.cli.test_commands import run
from wbc import robots
from wbc.cli.app import app
from wbc.cli.walking import WalkLines
from wbc.terminal import terminal_keys
from wbc.walking.checker import check_run
from wbc.walking.log.log import WalkLog
from wbc.walking.modes.keyboard import END, KeyCommands
from wbc.walking.planner.plan import Regrasp
from wbc.walking.run import DriveRequest, perform_walk

BARE = ["--no-pictures"]


def summary(folder: Path) -> dict[str, object]:
    return dict(json.loads((folder / "summary.json").read_text()))


@pytest.fixture(scope="module")
def driven(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("drive")
    (folder / "commands.csv").write_text("t,T,A,spin\n0,0,0.1016,0\n1.5,0,0,0.04\n2.5,0,0,0\n")
    code, _, err = run("walk", "drive", folder / "commands.csv", "--from", "13,10", *BARE, "--out", folder / "run")
    assert code == 0, err
    return folder / "run"


def test_a_drive_by_a_file(driven: Path) -> None:
    told, log = summary(driven), WalkLog.load(driven)
    assert told["outcome"] == "time"
    assert told["checks"]["ok"]  # type: ignore[index]
    assert told["stopping"]["body"] < 0.03  # type: ignore[index]
    assert (log.command_kind[1:-1] == 1).all()
    assert log.command[50] == pytest.approx([0, 0.1016, 0, 0, 0, 0, 0])
    assert log.command[200] == pytest.approx([0, 0, 0, 0, 0, 0.04, 0])
    way = log.pose_body_in_structure[150, 2] - log.pose_body_in_structure[0, 2]
    assert -0.14 < way < -0.07  # +A is -z
    assert log.t[-1] >= 2.5
    assert np.abs(log.v[-3]).max() < 1e-3


def test_a_driven_run_goes_on_to_a_place(driven: Path, tmp_path: Path) -> None:
    code, _, err = run("walk", "resume", driven, *BARE, "--out", tmp_path / "run")
    assert code == 2
    assert "say where to go" in err
    code, _, err = run("walk", "resume", driven, "--at", "1.2", "--to", "13,11", *BARE, "--out", tmp_path / "run")
    assert code == 0, err
    before, after = WalkLog.load(driven), WalkLog.load(tmp_path / "run")
    row = round(1.2 / after.dt)
    assert (after.q[:row] == before.q[:row]).all()
    assert after.pose_body_in_structure[-1, 2] == pytest.approx(-11 * 9.25 * 0.0254, abs=0.002)
    assert check_run(tmp_path / "run").ok


def test_keys_drive(tmp_path: Path) -> None:
    keys = iter(["ww", *[""] * 60, " ", *[""] * 30, "x"])
    request = DriveRequest(start="13,11", commands="keyboard")
    commands = KeyCommands(lambda: next(keys), real_time=False)
    done = perform_walk(request, robots.walker(), commands=commands)
    assert done.outcome == "time"
    assert done.log is not None
    assert done.log.command[30, 1] == pytest.approx(2 * 0.0254)
    assert not done.log.command[70:].any()
    assert 0.005 < done.log.pose_body_in_structure[0, 2] - done.log.pose_body_in_structure[-1, 2] < 0.05


def test_keys_of_a_terminal() -> None:
    control, terminal = pty.openpty()
    before = termios.tcgetattr(terminal)
    with terminal_keys(terminal) as read:
        assert read() == ""
        os.write(control, b"wd")
        keys = ""
        while len(keys) < 2:
            keys += read()
        assert keys == "wd"
        waits = KeyCommands(lambda: keys, real_time=False)
        assert waits.rates(0.0) == pytest.approx([0.0254, 0.0254, 0.0])
        assert KeyCommands(lambda: END[0], real_time=False).rates(0.0) is None
    assert termios.tcgetattr(terminal) == before
    os.close(control)
    os.close(terminal)


def test_real_time_is_kept() -> None:
    keys, begin = KeyCommands(lambda: ""), time.monotonic()
    for tick in range(6):
        keys.rates(tick * 0.01)
    assert time.monotonic() - begin >= 0.05


def test_an_arm_does_what_it_is_told(tmp_path: Path) -> None:
    tasks = ["--do", "rate 0.007,0.08,0,0,0,0 for 1.5", "--do", "hold 15,12"]
    code, out, err = run("walk", "arm", "--from", "13,11", "--arm", "arm2", *tasks, *BARE, "--out", tmp_path)
    told = summary(tmp_path)
    assert [told[f"task_{k}"]["reason"] for k in (1, 2)] == ["time", "reached"], (out, err)  # type: ignore[index]
    assert code == 0, err
    assert told["body_moved"] < 0.002  # type: ignore[operator]
    assert told["stopping"]["body"] == 0.002  # type: ignore[index]
    assert 0.04 < told["stopping"]["hand"] < 0.4  # type: ignore[index]
    log = WalkLog.load(tmp_path)
    assert log.hold_id[log.hand_hold[-1, 1]] == "15,12"


def test_a_task_that_is_refused_says_why_and_the_hand_comes_down(tmp_path: Path) -> None:
    tasks = ["--do", "rate 0.007,0.08,0,0,0,0 for 1.5", "--do", "hold 25,24", "--do", "hold 15,12"]
    code, _, err = run("walk", "arm", "--from", "13,11", "--arm", "arm2", *tasks, *BARE, "--out", tmp_path)
    told, log = summary(tmp_path), WalkLog.load(tmp_path)
    assert code == 3
    assert "out of reach" in err
    assert told["task_2"]["reason"] == "refused"  # type: ignore[index]
    assert "task_3" not in told
    assert (log.hand_state[-1] == 2).all()
    assert told["checks"]["ok"]  # type: ignore[index]


def test_a_walk_that_asks(tmp_path: Path) -> None:
    arguments = ["--from", "13,9", "--to", "13,13", "--free-start", "--ask", *BARE, "--out", str(tmp_path)]
    done = CliRunner().invoke(app, ["walk", *arguments], input="1,1\n" + "\n" * 9)
    assert done.exit_code == 0, done.stderr
    err = " ".join(done.stderr.split())
    steps = json.loads((tmp_path / "plan.json").read_text())["regrasps"]
    assert len(steps) >= 1
    assert err.count("Enter: yes") == len(steps) + 1  # once more where a hold was refused
    assert "cannot hold it anywhere" in err
    log = WalkLog.load(tmp_path)
    assert log.body_fixed[0]
    assert not log.body_fixed[-1]


def test_where_nobody_answers_the_walk_stops(tmp_path: Path) -> None:
    arguments = ["--from", "13,9", "--to", "13,13", "--ask", *BARE, "--out", str(tmp_path)]
    done = CliRunner().invoke(app, ["walk", *arguments], input="")
    assert done.exit_code == 3
    assert "nobody said yes to arm" in " ".join(done.stderr.split())
    told, log = summary(tmp_path), WalkLog.load(tmp_path)
    assert told["outcome"] == "declined"
    assert told["checks"]["ok"]  # type: ignore[index]
    assert (log.hand_state == 2).all()  # nothing was lifted
    assert np.abs(log.v[-2]).max() < 1e-3


def test_answers_come_from_a_pipe_and_a_stop_is_heard() -> None:
    read, write = os.pipe()
    with os.fdopen(read, "rb") as source, pytest.MonkeyPatch.context() as patch:
        patch.setattr("sys.stdin", source)
        lines, asked = WalkLines(), iter([False, True])
        os.write(write, b"\n13,9\nhalf")
        step = Regrasp("arm1", "1,1", "2,2", 0, 0.0, 0.5, 0.5, 0.0, 1.0, "reach", 2.0)
        assert [lines.answer(step, ""), lines.answer(step, "no")] == ["", "13,9"]
        lines.stop = lambda: next(asked)
        assert lines.answer(step, "") is None
        lines.stop = lambda: False
        os.close(write)
        assert lines.answer(step, "") is None


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--structure", "truss"], "No such option: --structure"),
        (["--set", "hand_radius=0.06"], "No such option: --set"),
        (["--ask"], "only walks along a path ask"),
    ],
)
def test_what_a_resumed_run_does_not_take(driven: Path, arguments: list[str], told: str, tmp_path: Path) -> None:
    resume = ["walk", "resume", driven, "--at", "1.2", "--to", "13,11", *BARE]
    code, _, err = run(*resume, *arguments, "--out", tmp_path / "run")
    assert code == 2
    assert told in err
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("at", ["nan", "inf", "-1", "1e9", "0"])
def test_an_instant_that_the_log_does_not_have(driven: Path, at: str, tmp_path: Path) -> None:
    code, _, err = run("walk", "resume", driven, f"--at={at}", "--to", "13,11", "--out", tmp_path / "run")
    assert code == 2
    assert f"expected a time from 0.01 to {WalkLog.load(driven).t[-1]:g} s" in err


def test_a_run_does_not_go_on_in_its_own_folder(driven: Path) -> None:
    code, _, err = run("walk", "resume", driven, "--to", "13,11", "--out", driven, "--force")
    assert code == 2
    assert "needs its own" in err
    assert WalkLog.load(driven)


def test_a_folder_is_checked(driven: Path, tmp_path: Path) -> None:
    code, out, _ = run("walk", "check", driven)
    assert code == 0
    assert "the walk holds" in out
    code, _, err = run("walk", "check", tmp_path)
    assert (code, "no run.npz" in err) == (2, True)
    assert run("walk", "check", tmp_path / "none")[0] == 2


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["drive", "none.csv"], "none.csv"),
        (["drive", "keyboard"], "no terminal"),
        (["arm"], "mode 'arm'"),
        (["arm", "--do", "jump"], "hold ID"),
        (["arm", "--do", "rate 1,2 for 3"], "six rates"),
        (["arm", "--do", "hold 13,99"], "13,99"),
        (["arm", "--do", "hold 13,9", "--arm", "arm7"], "arm7"),
        (["resume", "nowhere"], "nowhere"),
        (["published", "--free-start"], "No such option: --free-start"),
        (["path", "--plan", "plan.json", "--free-start"], "plans of files"),
        (["path", "--least-time", "--free-start"], "least-time"),
    ],
)
def test_bad_input_is_named(arguments: list[str], told: str, tmp_path: Path) -> None:
    code, _, err = run("walk", *arguments, "--out", tmp_path / "run")
    assert code == 2
    assert told in err
    assert not (tmp_path / "run").exists()
