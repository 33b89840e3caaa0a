"""The modes of ``wbc walk``: by rates, by keys, one limb, resumed, and asked before every move."""

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

import wbc.log
from tests.cli.test_commands import run
from wbc.cli.app import app
from wbc.cli.climbing import LimbLines
from wbc.cli.keys import END, KeyTwists
from wbc.climb.grids import PITCH
from wbc.climb.request import ClimbRequest, DriveRequest
from wbc.climb.session import ClimbHooks, climb
from wbc.terminal import terminal_keys

BARE = ["--no-pictures", "--backend", "vm"]


@pytest.fixture(scope="module")
def driven(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Driven along the cylinder, then turned, by a file."""
    folder = tmp_path_factory.mktemp("drive")
    rates = folder / "rates.csv"
    rates.write_text("t,vx,vy,vz,wx,wy,wz\n0,0.1016,0,0,0,0,0\n1.5,0,0,0,0,0,0.04\n2.5,0,0,0,0,0,0\n")
    code, _, err = run("walk", "drive", rates, "--from", "13,10", *BARE, "--out", folder / "run")
    assert code == 0, err
    return folder / "run"


def test_a_drive_by_a_file(driven: Path) -> None:
    log = wbc.log.load(driven)
    t, z = log["t"], log.array("q")[:, 2]
    # +A is -z; it starts, stops and turns within what the joints can
    assert -0.16 < z[-1] - z[0] < -0.07
    assert t[-1] >= 2.5
    assert np.abs(log.array("v")[-1]).max() < 1e-2
    assert run("walk", "check", driven)[0] == 0


def test_a_driven_run_goes_on_to_a_place(driven: Path, tmp_path: Path) -> None:
    code, _, err = run("walk", "resume", driven, *BARE, "--out", tmp_path / "run")
    assert (code, "say where to go" in err) == (2, True)
    code, _, err = run("walk", "resume", driven, "--at", "1.2", "--to", "13,12", *BARE, "--out", tmp_path / "run")
    assert code == 0, err
    before, after = wbc.log.load(driven), wbc.log.load(tmp_path / "run")
    np.testing.assert_allclose(after.array("q")[0], before.array("q")[round(1.2 / 0.01)], atol=1e-3)
    assert after.array("q")[-1, 2] == pytest.approx(-12 * PITCH, abs=0.02)
    assert run("walk", "check", tmp_path / "run")[0] == 0


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--scene", "truss_grid"], "No such option: --scene"),
        (["--set", "hand_radius=0.06"], "No such option: --set"),
        *((["--at", at, "--to", "13,11"], "expected") for at in ("nan", "inf", "-1", "1e9")),
    ],
)
def test_what_a_resumed_run_does_not_take(driven: Path, arguments: list[str], told: str, tmp_path: Path) -> None:
    code, _, err = run("walk", "resume", driven, *arguments, *BARE, "--out", tmp_path / "run")
    assert (code, told in err) == (2, True), err
    assert not (tmp_path / "run").exists()


def test_a_run_does_not_go_on_in_its_own_folder(driven: Path) -> None:
    code, _, err = run("walk", "resume", driven, "--to", "13,11", "--out", driven, "--force")
    assert (code, "needs its own" in err) == (2, True)
    assert len(wbc.log.load(driven)) > 100


def test_keys_drive() -> None:
    keys = iter(["ww", *[""] * 120, " ", *[""] * 30, "x"])
    hooks = ClimbHooks(twists=KeyTwists(lambda: next(keys), real_time=False))
    done = climb(ClimbRequest(DriveRequest("keyboard", start="13,11")), backend="vm", hooks=hooks)
    assert done.run.outcome == "arrived"
    z = done.run.log.array("q")[:, 2]
    assert 0.01 < z[0] - z[-1] < 0.1
    assert done.report is not None
    assert done.report.clean, str(done.report)


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
        twists = KeyTwists(lambda: keys, real_time=False)
        assert twists.at(0.0) == pytest.approx([0.0254, -0.0254, 0, 0, 0, 0])
        assert KeyTwists(lambda: END[0], real_time=False).at(0.0) is None
    assert termios.tcgetattr(terminal) == before
    os.close(control)
    os.close(terminal)


def test_real_time_is_kept() -> None:
    keys, begin = KeyTwists(lambda: ""), time.monotonic()
    for tick in range(6):
        keys.at(tick * 0.01)
    assert time.monotonic() - begin >= 0.05


def test_a_limb_does_what_it_is_told(tmp_path: Path) -> None:
    poses = tmp_path / "poses.csv"
    log = tmp_path / "run"
    tasks = ["--do", "rate 0.007,0.08,0,0,0,0 for 1.5", "--do", "hold 15,12"]
    code, out, err = run("walk", "limb", "--from", "13,11", "--limb", "arm2", *tasks, *BARE, "--out", log)
    assert code == 0, (out, err)
    read = wbc.log.load(log)
    assert np.linalg.norm(np.ptp(read.array("q")[:, :3], axis=0)) < 0.002
    assert read.meta["footholds"][int(read["contact.arm2"][-1])] == "15,12"
    # The same way off through a pose of a file: 12 cm out of where the hand was
    foothold = read.tables["footholds"][int(read["contact.arm2"][0])]
    out_at = foothold[:3] + np.array([0.0105, 0.12, 0.0])
    poses.write_text("x,y,z\n" + ",".join(map(repr, out_at.tolist())) + "\n")
    limb = ["limb", "--from", "13,11", "--limb", "arm2", "--do", f"poses {poses}"]
    assert run("walk", *limb, *BARE, "--out", tmp_path / "poses")[0] == 0
    assert wbc.log.load(tmp_path / "poses")["contact.arm2"][-1] == -1
    code, _, err = run("walk", "limb", "--from", "13,11", "--do", "hold 25,24", *BARE, "--out", tmp_path / "far")
    assert (code, "out of reach" in err) == (3, True)


def test_a_walk_that_asks(tmp_path: Path) -> None:
    arguments = ["--from", "13,9", "--to", "13,13", "--ask", *BARE, "--out", str(tmp_path)]
    done = CliRunner().invoke(app, ["walk", *arguments], input="1,1\n" + "\n" * 9)
    assert done.exit_code == 0, done.stderr
    err = " ".join(done.stderr.split())
    moves = len(np.load(tmp_path / "plan.npz")["table:moves"])
    assert err.count("Enter: yes") == moves + 1 > 1  # once more where a foothold was refused
    assert err.count("out of reach") == 1


def test_where_nobody_answers_the_walk_stops(tmp_path: Path) -> None:
    arguments = ["--from", "13,9", "--to", "13,13", "--ask", *BARE, "--out", str(tmp_path)]
    done = CliRunner().invoke(app, ["walk", *arguments], input="")
    assert done.exit_code == 3
    assert "nobody said yes to arm" in " ".join(done.stderr.split())
    figures, log = json.loads((tmp_path / "figures.json").read_text()), wbc.log.load(tmp_path)
    assert (figures["outcome"], figures["violations"]) == ("stopped", [])
    assert (log.array("contact") >= 0).all()  # nothing was lifted
    assert np.abs(log.array("v")[-1]).max() < 5e-3


def test_answers_come_from_a_pipe_and_a_stop_is_heard() -> None:
    read, write = os.pipe()
    with os.fdopen(read, "rb") as source, pytest.MonkeyPatch.context() as patch:
        patch.setattr("sys.stdin", source)
        lines, asked = LimbLines(), iter([False, True])
        os.write(write, b"\n13,9\nhalf")
        assert [lines.answer("arm1: a -> b", ""), lines.answer("arm1: a -> b", "no")] == ["", "13,9"]
        lines.stop = lambda: next(asked)
        assert lines.answer("arm1: a -> b", "") is None
        lines.stop = lambda: False
        os.close(write)
        assert lines.answer("arm1: a -> b", "") is None


@pytest.mark.parametrize("plant", ["mujoco", "pinocchio"])
def test_torques_of_the_command_line(plant: str, tmp_path: Path) -> None:
    """A motor that gives nothing any more ends the run with its name."""
    asked = ["--plant", plant, "--fault", "limp arm1_joint2 at 0.6", "--gravity", "0,-1.62,0"]
    code, out, err = run("walk", "--from", "13,9", "--to", "13,10", *asked, *BARE, "--out", tmp_path)
    assert (code, "arm1_joint2 gets" in out) == (3, True), (out, err)
