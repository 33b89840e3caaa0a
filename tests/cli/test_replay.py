"""``wbc replay`` of what ``wbc track`` leaves."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.cli.test_commands import FAST, run
from tests.record.test_recording import write
from tests.stack import small
from wbc import Recording, track
from wbc.cli import session
from wbc.log import FileWriter
from wbc.tasks import Expression


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run with a moving ball, a floor, and a swinging elbow."""
    place = tmp_path_factory.mktemp("run")
    ball = ["--sphere", "0.5,0.3,0.5,0.1,0,-0.1,0", "--floor", "-0.5", "--plane", "swing", "--swing", "0.2"]
    code, _, err = run("track", "panda", *FAST, *ball, "--out", place)
    assert code == 0, err
    return place


def test_a_run_is_replayed(folder: Path) -> None:
    code, out, err = run("replay", folder)
    assert (code, err) == (0, "")
    assert "25 ticks: every command is bit-identical" in out
    assert "hand (EndEffector)" in out
    assert "floor (Obstacle)" in out
    assert run("replay", folder / "ticks.npz") == (code, out, err)
    made, log = Recording(folder / "ticks.npz"), track.load(folder)
    assert np.array_equal(made["v"], log.array("v"))
    assert np.array_equal(made["q"], log.array("q"))


def test_a_difference_is_named_and_exits_with_1(folder: Path, tmp_path: Path) -> None:
    made = Recording(folder / "ticks.npz")
    rows = np.concatenate(list(made.chunks()))
    rows[7, made.parts["v"].start + 2] += 0.125
    write(tmp_path / "changed.npz", made, rows)
    code, out, _ = run("replay", tmp_path / "changed.npz")
    assert code == 1
    assert "1 of 25 ticks differ; the first is tick 7, by 0.125" in out


def test_another_back_end(folder: Path) -> None:
    code, out, err = run("replay", folder, "--backend", "native")
    assert code in (0, 1)
    assert "replayed  daqp (native)" in out
    assert "note: backend was vm, is native" in err
    if code == 1:
        worst = float(out.replace("\n", " ").split("by ")[-1].split()[0])
        assert worst < 1e-6


def test_a_run_that_ends_early_or_is_killed(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    real = session.track

    def short(plan: Any, progress: Any, stop: Any, compiled: Any, plant: Any) -> track.Log:
        ticks = iter(range(9))
        return real(plan, progress, lambda: next(ticks, None) is None, compiled, plant=plant)

    monkeypatch.setattr(session, "track", short)
    assert run("track", *FAST, "--out", tmp_path)[0] == 130
    code, out, err = run("replay", tmp_path)
    assert (code, err) == (0, "")
    assert "9 ticks: every command is bit-identical" in out
    whole = (folder / "ticks.npz").read_bytes()
    (tmp_path / "cut.npz").write_bytes(whole[:-30])
    code, out, err = run("replay", tmp_path / "cut.npz")
    assert (code, "not closed" in err) == (0, True)
    code, out, err = run("convert", tmp_path / "cut.npz", "--to", "csv", "--out", tmp_path / "cut.csv")
    assert (code, "not closed" in err) == (0, True)
    (tmp_path / "stub.npz").write_bytes(whole[: whole.index(b"stack.pickle") + 9])
    code, out, err = run("replay", tmp_path / "stub.npz")
    assert (code, "ends before its stack" in err) == (2, True)


def test_a_run_without_a_recording(tmp_path: Path) -> None:
    assert run("track", *FAST, "--no-record", "--out", tmp_path)[0] == 0
    assert {p.name for p in tmp_path.iterdir()} == {"log.parquet", "summary.json", "report.html"}
    code, out, err = run("replay", tmp_path)
    assert (code, out) == (2, "")
    assert err.startswith("error: recording: cannot be read: No such file")
    # an older recording does not stay beside a new run
    assert run("track", *FAST, "--force", "--out", tmp_path)[0] == 0
    assert (tmp_path / "ticks.npz").is_file()
    assert run("track", *FAST, "--force", "--no-record", "--out", tmp_path)[0] == 0
    assert not (tmp_path / "ticks.npz").exists()


def test_a_full_disk_costs_the_recording_and_not_the_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*arguments: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(FileWriter, "write", full)
    assert run("track", *FAST, "--out", tmp_path)[0] == 0
    assert len(track.load(tmp_path)) == 25
    assert len(Recording(tmp_path / "ticks.npz")["q"]) == 0


def test_trust_is_asked_for(tmp_path: Path) -> None:
    stack = small.stack().add(Expression(lambda kin, p: kin.q[0] - 0.1, units="rad"), name="mine")
    one = stack.compile(backend="vm")
    with one.record(tmp_path / "mine.npz"):
        for _ in range(3):
            one.step(small.Q)
    code, out, err = run("replay", tmp_path / "mine.npz")
    assert (code, out) == (2, "")
    assert "asks for code that is not this package's" in err
    assert err.count("\n") == 1
    code, out, _ = run("replay", tmp_path / "mine.npz", "--trust")
    assert code == 0
    assert "3 ticks: every command is bit-identical" in out
