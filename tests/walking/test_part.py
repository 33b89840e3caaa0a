"""The log that is written while walking: what a killed program left is read, checked and gone on with."""

from __future__ import annotations

import errno
import json
import os
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from wbc.errors import RangeError, WbcError
from wbc.log import FileWriter, LogFileError
from wbc.robots import Walker
from wbc.walking import Structure
from wbc.walking.checker import check_run, check_walk
from wbc.walking.log import TickColumns, WalkLog
from wbc.walking.log.log import PART, load_columns
from wbc.walking.loop.stack import WalkStack
from wbc.walking.report.folder import rules_of, save_run
from wbc.walking.run import PathRequest, ResumeRequest, Site, perform_walk
from wbc.walking.run.recording import CHUNK
from wbc.walking.run.resume_mode import going_on, plant_walked
from wbc.walking.torque.choice import PlantChoice

REQUEST = PathRequest(Site(rigid=True), "13,9", ("13,10",))


@pytest.fixture(scope="module")
def walked(machine: Walker, stack: WalkStack, tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, Path]:
    """A walk with the folder as it was when its last tick was made."""
    folder = tmp_path_factory.mktemp("part")
    return perform_walk(REQUEST, machine, stack=stack, folder=folder), folder


def test_what_is_written_is_the_log(walked: tuple[Any, Path]) -> None:
    run, folder = walked
    assert {file.name for file in folder.iterdir()} == {"begun.json", "plan.json", "robot.urdf", PART, "structure.csv"}
    log, whole = WalkLog.load(folder), run.log
    n = len(log)
    assert len(whole) - 1 <= n <= len(whole)
    for name in ("t", "q", "v", "pose_body_in_structure", "twist_body", "hand_state", "hand_hold", "command"):
        np.testing.assert_array_equal(getattr(log, name), getattr(whole, name)[:n])
    for name in ("hold_id", "hold_pose", "presence_span", "joints", "arms", "hands"):
        np.testing.assert_array_equal(getattr(log, name), getattr(whole, name))
    assert log.meta == json.loads(json.dumps(whole.meta))
    np.testing.assert_array_equal(TickColumns.of(load_columns(folder)).cost, run.ticks.cost[: n - 1])
    assert check_run(folder).ok


@settings(max_examples=12, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(part=st.floats(0.0, 1.0), junk=st.binary(max_size=40))
def test_a_file_that_ends_anywhere_is_read_as_far_as_it_goes(
    walked: tuple[Any, Path], part: float, junk: bytes, tmp_path: Path
) -> None:
    run, folder = walked
    data = (folder / PART).read_bytes()
    (tmp_path / PART).write_bytes(data[: round(part * len(data))] + junk)
    try:
        log = WalkLog.load(tmp_path)
    except LogFileError:
        # Names and holds are before the first chunk
        assert part * len(data) < data.index(b"ticks.000001")
        return
    assert (log.q == run.log.q[: len(log)]).all()
    assert len(log) >= CHUNK * data[: round(part * len(data))].count(b"ticks.0") - CHUNK
    assert len(TickColumns.of(load_columns(tmp_path)).cost) == len(log) - 1


@given(data=st.binary(max_size=300), shift=st.integers(0, 200))
@settings(max_examples=20, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_no_junk_is_a_log(walked: tuple[Any, Path], data: bytes, shift: int, tmp_path: Path) -> None:
    good = (walked[1] / PART).read_bytes()
    (tmp_path / PART).write_bytes(good[:shift] + data + good[shift + len(data) :][:2000])
    with pytest.raises(WbcError):
        WalkLog.load(tmp_path)


def test_a_full_disk_ends_the_writing_and_not_the_walk(
    machine: Walker, stack: WalkStack, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    put, left = FileWriter._put, iter(range(6))

    def filling(writer: FileWriter, name: str, content: bytes, room: int = 0) -> None:
        if next(left, None) is None:
            raise OSError(errno.ENOSPC, "No space left on device")
        put(writer, name, content, room)

    monkeypatch.setattr(FileWriter, "_put", filling)
    run = perform_walk(REQUEST, machine, stack=stack, folder=tmp_path)
    assert run.outcome == "arrived", run.reason
    assert run.log is not None
    # What comes before the ticks are three parts of the file
    log = WalkLog.load(tmp_path)
    assert len(log) == 3 * CHUNK < len(run.log)
    assert (log.q == run.log.q[: len(log)]).all()


@pytest.mark.parametrize("begun", [False, True], ids=["planning", "walking"])
def test_a_killed_walk_goes_on(
    begun: bool, machine: Walker, structure: Structure, stack: WalkStack, tmp_path: Path
) -> None:
    folder = tmp_path / "killed"
    folder.mkdir()
    child = os.fork()
    if not child:  # only this process is killed
        try:
            ticks = iter(range(140 if begun else 0))
            perform_walk(REQUEST, machine, stack=stack, folder=folder, stop=lambda: _kill(next(ticks, None)))
        finally:
            os._exit(1)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == -signal.SIGKILL
    if begun:
        assert len(WalkLog.load(folder)) == 2 * CHUNK
        assert check_run(folder).ok
        with pytest.raises(RangeError, match=r"from 0\.01 to 0\.99 s"):
            perform_walk(ResumeRequest(folder, float("nan")), machine, stack=stack)
    else:
        assert going_on(ResumeRequest(folder)) == REQUEST
        with pytest.raises(RangeError, match="before it walked"):
            going_on(ResumeRequest(folder, 0.5))
    again = perform_walk(ResumeRequest(folder), machine, stack=stack)
    assert again.outcome == "arrived", again.reason
    (tmp_path / "again").mkdir()
    _, report = save_run(again, tmp_path / "again")
    assert report is not None
    assert report.ok, str(report)


def test_a_killed_walk_under_torques_goes_on_in_mujoco(
    machine: Walker, structure: Structure, stack: WalkStack, tmp_path: Path
) -> None:
    choice = PlantChoice("mujoco", (0.0, -0.2, 0.0), ("delay 0.003",))
    loop, ticks = choice.build(machine, structure, backend="vm"), iter(range(60))
    child = os.fork()
    if not child:
        try:
            stop = lambda: _kill(next(ticks, None))  # noqa: E731
            perform_walk(REQUEST, machine, stack=stack, folder=tmp_path, stop=stop, plant=loop)
        finally:
            os._exit(1)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == -signal.SIGKILL
    request = going_on(ResumeRequest(tmp_path))
    assert PlantChoice.of_run(plant_walked(request, tmp_path)) == choice
    left, more = WalkLog.load(tmp_path), iter(range(5))
    again = perform_walk(request, machine, stack=stack, plant=loop, stop=lambda: next(more, None) is None)
    log = again.log
    assert log is not None
    assert again.outcome == "interrupted"
    assert (log.q[: len(left)] == left.q).all()
    # It was in motion as it was killed, and so it is as it goes on: nothing jumps, no hand slips
    assert np.abs(left.v[-2]).max() > 0.1
    assert check_walk(log, machine.urdf(tmp_path / "robot.urdf"), again.structure, rules_of(machine)).ok
    assert loop.watch.drift < 1e-4
    assert loop.watch.unsolved == 0


def _kill(left: int | None) -> bool:
    """Ends this process when there are no ticks left."""
    if left is None:
        os.kill(os.getpid(), signal.SIGKILL)
    return False


def test_a_resumed_walk_that_is_killed_has_what_was_before(
    walked: tuple[Any, Path], machine: Walker, stack: WalkStack, tmp_path: Path
) -> None:
    run, folder = walked
    again = perform_walk(ResumeRequest(folder, 1.0), machine, stack=stack, folder=tmp_path)
    assert again.outcome == "arrived"
    log = WalkLog.load(tmp_path)
    assert (log.q[:100] == run.log.q[:100]).all()
    assert (log.q == again.log.q[: len(log)]).all()
    assert log.meta["resumed"] == [pytest.approx(1.0)]
    (tmp_path / PART).unlink()
    # Killed before its first tick, it is the run that it went on with, from then on
    request = going_on(ResumeRequest(tmp_path))
    assert isinstance(request, ResumeRequest)
    assert (Path(request.folder), request.at) == (folder.resolve(), 1.0)
