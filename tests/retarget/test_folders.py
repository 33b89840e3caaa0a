"""Folders of clips: found, retargeted one by one, resumed, and what fails on its own."""

from __future__ import annotations

import json
import multiprocessing
import signal
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from typer.testing import CliRunner

from tests.retarget import clips
from tests.retarget.fake import FakeRetargeter
from wbc.cli.app import INTERRUPTED, app
from wbc.errors import ClipFileError
from wbc.retarget import ClipJob, find_clips, folders, retarget_clips


@pytest.fixture(autouse=True)
def retargeter(monkeypatch: pytest.MonkeyPatch) -> type[FakeRetargeter]:
    """Clips are not retargeted here: what is made around it is looked at."""
    modules = {"retargeter": {"Retargeter": FakeRetargeter}, "options": {"RetargetOptions": dict}}
    for name, members in modules.items():
        monkeypatch.setitem(sys.modules, f"wbc.retarget.{name}", SimpleNamespace(**members))
    FakeRetargeter.runs.clear()
    folders.retargeter_of.cache_clear()
    return FakeRetargeter


@pytest.fixture(scope="module")
def walks(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two clips, one of them a folder below, and a file that is none."""
    folder = tmp_path_factory.mktemp("clips")
    clip = clips.sit(0, 20.0).clip
    np.savez(folder / "sit.npz", points=clip.points, names=clip.skeleton.names, fps=20)
    (folder / "deep").mkdir()
    np.savez(folder / "deep" / "sit.npz", points=clip.points, names=clip.skeleton.names, fps=20)
    (folder / "readme.txt").write_text("")
    return folder


def run(out: Path, *arguments: str | Path) -> tuple[int, str]:
    """Exit code and output of the command, which writes into a folder."""
    fixed = ("--robot", "simple_humanoid", "--out", str(out), "--workers", "1", "--no-film")
    done = CliRunner(env={"COLUMNS": "200"}).invoke(app, ["retarget", *map(str, arguments), *fixed])
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    return done.exit_code, done.output


def test_clips_are_found_in_folders(walks: Path, tmp_path: Path) -> None:
    assert find_clips([walks]) == [(walks / "deep" / "sit.npz", Path("deep/sit")), (walks / "sit.npz", Path("sit"))]
    both = find_clips([walks / "sit.npz", walks / "deep" / "sit.npz"])
    assert [place for _, place in both] == [Path("sit"), Path("sit-2")]
    with pytest.raises(ClipFileError, match="did you mean"):
        find_clips([walks / "sat.npz"])
    empty = tmp_path / "empty"
    empty.mkdir()
    with pytest.raises(ClipFileError, match="no clip"):
        find_clips([empty])


def test_a_folder_is_retargeted_and_gone_on_with(walks: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    formats = ("--format", "csv", "--format", "gmr")
    code, text = run(out, walks, *formats)
    assert code == 0, text
    assert "2 of 2 clips" in text
    for place in ("sit", "deep/sit"):
        files = {file.name for file in (out / place).iterdir()}
        wanted = {"motion.npz", "motion-csv.csv", "motion-gmr.pkl", "report.json", "report.txt", "report.html"}
        wanted |= {"correspondence.yaml"}
        assert files - {"sit"} == wanted
    figures = json.loads((out / "sit" / "report.json").read_text())
    assert figures["frames"] == 12
    assert figures["errors"]["left_leg"]["largest"] == 0.01
    assert "gave way: left_leg from 0.1" in (out / "sit" / "report.txt").read_text()
    # The same again does nothing, with another format all, with --force all
    assert len(FakeRetargeter.runs) == 2
    code, text = run(out, walks, *formats)
    assert (code, len(FakeRetargeter.runs)) == (0, 2)
    assert "are done already" in text
    run(out, walks)
    assert len(FakeRetargeter.runs) == 4
    run(out, walks, "--force")
    assert len(FakeRetargeter.runs) == 6


def test_a_clip_that_fails_leaves_the_others(walks: Path, tmp_path: Path) -> None:
    (tmp_path / "bad.bvh").write_text("HIERARCHY\n")
    code, text = run(tmp_path / "out", tmp_path / "bad.bvh", walks / "sit.npz")
    assert code == 1
    assert "failed" in text
    assert "cut off" in text
    assert "1 of 2 clips" in text
    assert not (tmp_path / "out" / "bad").exists()


def test_ctrl_c_keeps_what_is_done(walks: Path, tmp_path: Path) -> None:
    names, out = [tmp_path / f"{name}.npz" for name in ("a", "stop", "z")], tmp_path / "out"
    for file in names:
        file.write_bytes((walks / "sit.npz").read_bytes())
    code, text = run(out, *names)
    assert code == INTERRUPTED
    assert "1 of 3 clips" in text
    assert FakeRetargeter.runs == ["a", "stop"]
    assert (out / "a" / "report.json").is_file()
    assert not (out / "z").exists()
    # And goes on
    code, text = run(out, names[0], names[2])
    assert code == 0
    assert FakeRetargeter.runs == ["a", "stop", "z"]


def test_processes_answer_for_clips_that_cannot_be_read(tmp_path: Path) -> None:
    jobs = []
    for number in range(3):
        file = tmp_path / f"{number}.bvh"
        file.write_text("HIERARCHY\n")
        jobs.append(ClipJob(file, tmp_path / "out" / str(number), "simple_humanoid"))
    done = list(retarget_clips(jobs, workers=2))
    assert {job.clip for job, _, _ in done} == {job.clip for job in jobs}
    assert all("cut off" in reason for _, _, reason in done)


def test_results_as_json(walks: Path, tmp_path: Path) -> None:
    code, text = run(tmp_path / "o", walks / "sit.npz", "--json")
    assert code == 0
    assert json.loads(text)["clips"][0]["frames"] == 12


def test_who_stops_asking_ends_the_processes(tmp_path: Path) -> None:
    # A broken file is answered at once; the others would be read for long
    (tmp_path / "first.bvh").write_text("HIERARCHY\n")
    text = clips.bvh(clips.walk(0, 60.0).clip)
    head, _, rows = text.partition("Frame Time")
    long = head + "Frame Time" + rows + rows.partition("\n")[2] * 60
    jobs = [ClipJob(tmp_path / "first.bvh", tmp_path / "out" / "first", "simple_humanoid")]
    for number in range(3):
        file = tmp_path / f"long{number}.bvh"
        file.write_text(long)
        jobs.append(ClipJob(file, tmp_path / "out" / file.stem, "simple_humanoid"))
    # Tests before this one may have left children of their own
    others = set(multiprocessing.active_children())
    answers = retarget_clips(jobs, workers=2)
    assert next(answers)[0].clip.stem == "first"
    before = set(multiprocessing.active_children()) - others
    assert before
    start = time.monotonic()
    answers.close()  # type: ignore[attr-defined]  # a generator
    # The thread of the pool waits for them too; who comes second is told for an instant that they are alive
    while any(process.is_alive() for process in before) and time.monotonic() - start < 10.0:
        time.sleep(0.01)
    assert not any(process.is_alive() for process in before)
    assert any(process.exitcode == -signal.SIGTERM for process in before)
    assert not (tmp_path / "out" / "long2").exists()
