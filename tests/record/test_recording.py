"""Recordings: every tick again, bit for bit; what a killed writer leaves; what is refused."""

from __future__ import annotations

import contextlib
import functools
import gc
import json
import multiprocessing
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.controller.stacks import arm, controller, near_limits, randomise
from tests.stack import small
from wbc import Controller, Recording, Stack, replay
from wbc.controller import core_of
from wbc.errors import NotFiniteError, UnknownNameError
from wbc.log import FileWriter, LogFile
from wbc.record import recorder, recording as files
from wbc.record.background import BackgroundWriter
from wbc.record.recorder import INPUTS
from wbc.record.recording import RecordingError
from wbc.replaying import replayed
from wbc.shapes import Box
from wbc.tasks import Obstacle

TOP = Path(__file__).parents[2]
#: Ticks of the small stack in a chunk: a second of them
CHUNK = 100


def history(one: Controller, rng: np.random.Generator, ticks: int) -> list[bytes]:
    """All that can happen to a controller: changed values, resets, another dt, measured v, refusals, its QP read."""
    bot, out = one.stack.robot, []
    for k in range(ticks):
        q = near_limits(bot, rng)
        if k % 7 == 3:
            randomise(one, rng)
        if k % 11 == 10:
            one.reset(q if k % 2 else None, rng.normal(size=bot.nv) if k % 3 else None)
        if k % 13 == 5:
            with pytest.raises(NotFiniteError):
                one.step(np.full(bot.nq, np.nan))
        if k % 13 == 6:
            one.qp()
        step = one.step(
            q,
            rng.normal(size=bot.nv) if k % 3 == 1 else None,
            one.stack.dt * rng.uniform(0.3, 1.9) if k % 5 == 2 else None,
        )
        out.append(step._data)
    return out


def sensed() -> Stack:
    return arm(obstacle=False).add(Obstacle(Box((0.1, 0.2, 0.3)), margin=0.01, closest=3), name="box")


@pytest.mark.parametrize(
    ("builder", "backend", "solver", "ticks"),
    [
        ("arm", "native", "daqp", 60),
        ("arm", "native", "osqp", 24),
        ("arm", "native", "qpoases", 24),
        ("arm", "vm", "daqp", 30),
        ("sensed", "vm", "daqp", 24),
        ("conflicts", "vm", "daqp", 24),
        ("humanoid", "vm", "daqp", 18),
    ],
)
def test_every_tick_again(
    builder: str, backend: str, solver: str, ticks: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In a controller of its own, from the file alone; in chunks whose ends fall anywhere."""
    for name in ("FEWEST", "CHUNK"):
        monkeypatch.setattr(f"wbc.record.recorder.{name}", 7)
    if builder == "sensed":
        one = sensed().compile(backend=backend)
    else:
        one = controller(builder, backend=backend, solver=solver)
    rng = np.random.default_rng(ticks)
    # a recording may begin at any time
    history(one, rng, 10)
    with one.record(tmp_path / "run.npz") as recorder:
        wanted = history(one, rng, ticks)
    assert recorder.count == ticks
    history(one, rng, 3)
    found = replay(tmp_path / "run.npz")
    assert str(found) == f"{ticks} ticks: every command is bit-identical"
    assert (found.ticks, found.differing, found.identical, found.complete) == (ticks, 0, True, True)
    assert (found.backend, found.notes) == (backend, ())
    source = Recording(tmp_path / "run.npz")
    again = [tick.step._data for tick in replayed(source)]
    assert again == wanted, "not only the command, the whole report"


def test_a_recording_says_what_was_given(tmp_path: Path) -> None:
    one = small.stack().compile(backend="vm")
    bot, rng = one.stack.robot, np.random.default_rng(0)
    given: dict[str, list[Any]] = {name: [] for name in ("q", "v", "dt", "target", "reset", "last")}
    with one.record(tmp_path / "run.npz"):
        for k in range(40):
            q, dt = rng.normal(size=2), one.stack.dt * rng.uniform(0.5, 1.5)
            if k % 9 == 4:
                one.reset(v=rng.normal(size=bot.nv))
            one["hand"].target = rng.normal(size=3)
            one["limits"].enabled = bool(k % 2)
            given["last"].append(one.last_command)
            step = one.step(q, dt=dt)
            for name, value in zip(("q", "v", "dt", "target"), (q, step.v, [dt], one["hand"].target), strict=True):
                given[name].append(value)
            given["reset"].append([float(k == 0 or k % 9 == 4)])
    made = Recording(tmp_path / "run.npz")
    for name, part in (("q", "q"), ("v", "v"), ("dt", "dt"), ("reset", "reset"), ("last", "v_last")):
        assert np.array_equal(made[part], given[name]), name
    span = core_of(one).layout.blocks["hand"].slots["target"].span
    assert np.array_equal(made["p"][:, span], given["target"])
    assert np.array_equal(made["bound_enabled"][:, 0], [k % 2 for k in range(40)])
    assert not made["use_v"].any()
    assert made.about["robot"] == bot.name
    assert made.about["items"] == [["hand", "EndEffector"], ["posture", "Posture"], ["limits", "JointLimits"]]
    with pytest.raises(UnknownNameError, match="did you mean 'weight'"):
        made["weights"]


def test_the_file_is_plain_numpy_and_small(tmp_path: Path) -> None:
    """Numbers that do not change take no room."""
    one = controller("arm", "panda", backend="native")
    q = one.stack.robot.neutral.copy()
    with one.record(tmp_path / "run.npz") as recorder:
        for k in range(1000):
            q[0] = 1e-4 * k
            one.step(q)
    width = sum(Recording(recorder.path).about["sizes"].values())
    stack = len(Recording(recorder.path).stack_pickle or b"")
    assert recorder.path.stat().st_size - stack < 0.3 * 8 * width * 1000
    with np.load(recorder.path) as data:
        assert json.loads(data["about.json"])["format"] == files.FORMAT
        assert sum(int(data[name][0]) for name in data.files if name.startswith("ticks")) == 1000


def test_memory_is_bounded(tmp_path: Path) -> None:
    one = small.stack().compile(backend="native")
    with one.record(tmp_path / "run.npz") as recorder:
        held = []
        for _ in range(recorder._chunk * 2 + 5):
            one.step(small.Q)
            held.append(recorder._writing.end // recorder._writing.row)
        assert max(held) < recorder._chunk
    assert len(Recording(recorder.path)["q"]) == recorder.count == len(held)


def test_one_that_does_not_record_is_as_before(tmp_path: Path) -> None:
    one = controller("arm", "panda", backend="native")
    call = core_of(one).call
    with one.record(tmp_path / "run.npz"):
        assert core_of(one).call is not call
        assert core_of(one.clone()).recording is None
    assert core_of(one).call is call
    assert core_of(one).recording is None


# What a reader asks for


@pytest.mark.parametrize(
    ("builder", "backend"), [("arm", "native"), ("arm", "vm"), ("sensed", "vm"), ("humanoid", "vm")]
)
def test_times_residuals_margins_and_inputs_are_those_of_the_run(builder: str, backend: str, tmp_path: Path) -> None:
    one = sensed().compile(backend=backend) if builder == "sensed" else controller(builder, backend=backend)
    rng, bot = np.random.default_rng(4), one.stack.robot
    steps, given, dts = [], list[dict[str, Any]](), list[float]()
    with one.record(tmp_path / "run.npz") as recorder:
        for _ in range(12):
            randomise(one, rng)
            dts.append(one.stack.dt * rng.uniform(0.5, 1.5))
            steps.append(one.step(near_limits(bot, rng), dt=dts[-1]))
            slots = {(n, i): s for n, b in core_of(one).layout.blocks.items() for i, s in b.slots.items()}
            given.append({f"{name}.{i}": core_of(one).tick.p[s.span].copy() for (name, i), s in slots.items()})
    made = Recording(recorder.path)
    assert made.time.tolist() == [0.0, *np.cumsum(dts[:-1]).tolist()]
    assert made.status == tuple(step.status for step in steps)
    for found, part in ((made.residuals, "residuals"), (made.margins, "margins")):
        wanted = [getattr(step, part) for step in steps]
        assert list(found) == [name for name in wanted[0] if len(found.get(name, ()))]
        for name, rows in found.items():
            values = [getattr(each[name], "values", each[name]) for each in wanted]
            assert rows.tobytes() == np.array(values).tobytes(), name
    assert set(made.inputs) == set(given[0])
    for name, rows in made.inputs.items():
        assert rows.tobytes() == np.array([each[name] for each in given]).tobytes(), name
    table = made.table()
    assert {len(column) for column in table.values()} == {12}
    assert set(made.units) < set(table)
    first = next(name for name, residual in steps[5].residuals.items() if len(residual.values))
    residual = steps[5].residuals[first]
    for label, unit, value in zip(residual.labels, residual.units, residual.values, strict=True):
        assert table[f"residual.{first}.{label}"][5] == value
        assert made.units[f"residual.{first}.{label}"] == unit
    assert [table[f"v.{name}"][7] for name in bot.dof_names] == steps[7].v.tolist()
    wide = len(one.stack.entries) + bot.nq + bot.nv + sum(rows.shape[1] for rows in made.residuals.values())
    assert len(table) > wide


def test_the_stack_that_was_declared_is_the_one_to_give(tmp_path: Path) -> None:
    stack = small.stack()
    one = stack.compile(command="acceleration", backend="vm")
    with one.record(tmp_path / "run.npz") as made:
        for k in range(3):
            one.step(small.Q, np.full(stack.robot.nv, 0.1 * k))
    for given in (stack, one.stack):
        found = replay(made.path, given)
        assert (found.ticks, found.identical) == (3, True)
    with pytest.raises(RecordingError, match="of another stack"):
        replay(made.path, small.stack(small.arm(length=0.6)))


def test_a_recording_of_an_older_format_is_read_and_says_what_it_lacks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patch:
        patch.setattr(recorder, "TOLD", ())
        patch.setattr(recorder, "about", functools.partial(as_format_2, recorder.about))
        run = recorded(tmp_path / "run.npz")
    made = Recording(run)
    assert replay(made).identical
    assert len(made.time) == 30
    for asked in ("residuals", "margins", "inputs", "units"):
        with pytest.raises(RecordingError, match="older versions kept none"):
            getattr(made, asked)
    with pytest.raises(RecordingError, match="older versions kept none"):
        made.table()


def as_format_2(about: Callable[[Controller], dict[str, Any]], one: Controller) -> dict[str, Any]:
    return {name: value for name, value in about(one).items() if name not in ("names", "command")} | {"format": 2}


# What differs


def altered(source: Path, target: Path, tick: int, part: str, number: int, by: float) -> None:
    """The recording with one number of one tick changed."""
    made = Recording(source)
    rows = np.concatenate(list(made.chunks()))
    rows[tick, made.parts[part].start + number] += by
    write(target, made, rows)


def write(target: Path, made: Recording, rows: np.ndarray, **changes: Any) -> None:
    """A recording of these ticks, with other facts about it."""
    writer = FileWriter(target, overwrite=True)
    writer.begin(made.about | changes, made.attached)
    writer.write(rows.tobytes())
    writer.close()


def recorded(path: Path, stack: Stack | None = None, ticks: int = 30, backend: str = "vm") -> Path:
    one = (stack or small.stack()).compile(backend=backend)
    rng = np.random.default_rng(1)
    with one.record(path):
        one["hand"].target = (0.2, 0.6, 0.0)
        for _ in range(ticks):
            one.step(rng.normal(size=2))
    return path


def test_the_first_tick_that_differs_is_named(tmp_path: Path) -> None:
    run = recorded(tmp_path / "run.npz")
    last_bit = float(np.spacing(Recording(run)["v"][12, 1]))
    altered(run, tmp_path / "bit.npz", 12, "v", 1, last_bit)
    found = replay(tmp_path / "bit.npz")
    assert not found.identical
    assert found.first is not None
    assert (found.differing, found.first.number) == (1, 12)
    assert found.first.difference == abs(last_bit)
    assert str(found) == f"1 of 30 ticks differ; the first is tick 12, by {abs(last_bit):.3g}"
    altered(run, tmp_path / "flag.npz", 3, "flag", 0, 2.0)
    assert str(replay(tmp_path / "flag.npz")).endswith("the first is tick 3, by 0, braked then, solved now")
    altered(run, tmp_path / "more.npz", 5, "v", 0, 0.25)
    altered(tmp_path / "more.npz", tmp_path / "two.npz", 4, "v", 0, 1e-3)
    assert str(replay(tmp_path / "two.npz")) == (
        "2 of 30 ticks differ; the first is tick 4, by 0.001; the worst is tick 5, by 0.25"
    )


@pytest.mark.parametrize("part", ["q", "p", "dt", "v_last", "weight", "enabled", "bound_enabled"])
def test_every_recorded_input_acts(part: str, tmp_path: Path) -> None:
    """Of each some number does: a part that a replay left out would not."""
    # limits that contradict each other may decide the whole command, whatever q and weights are
    one = controller("arm", "panda") if part in ("q", "weight") else controller("conflicts")
    rng, bot = np.random.default_rng(2), one.stack.robot
    by = {"weight": 1.0, "dt": 1e-3, "p": 0.3, "enabled": -1.0, "bound_enabled": -1.0}.get(part, -0.5)
    with one.record(tmp_path / "run.npz"):
        for _ in range(6):
            one.step(near_limits(bot, rng))
    made = Recording(tmp_path / "run.npz")
    for number in range(made.about["sizes"][part]):
        copy = tmp_path / f"{number}.npz"
        altered(tmp_path / "run.npz", copy, 4, part, number, by)
        found = replay(copy)
        if found.differing:
            assert found.first is not None
            assert found.first.number == 4
            return
    pytest.fail("no number of this part changes the command")


def test_another_back_end_is_near(tmp_path: Path) -> None:
    one = controller("arm", "panda", backend="native")
    rng, bot = np.random.default_rng(3), one.stack.robot
    one.reset(near_limits(bot, rng))
    with one.record(tmp_path / "run.npz"):
        for _ in range(20):
            one.step(near_limits(bot, rng))
    found = replay(tmp_path / "run.npz", backend="vm")
    assert found.backend == "vm"
    assert found.notes == ("backend was native, is vm",)
    assert found.worst is None or found.worst.difference < 1e-5


# Endings


def test_an_interrupted_tick_is_left_out(tmp_path: Path) -> None:
    """Ctrl-C between a tick and its record: what follows is replayed all the same."""
    one = controller("arm", "panda", backend="native")
    rng = np.random.default_rng(6)
    with one.record(tmp_path / "run.npz") as recorder:
        history(one, rng, 20)
        call = recorder._call

        def interrupted() -> int:
            call()
            raise KeyboardInterrupt

        recorder._call = interrupted
        with pytest.raises(KeyboardInterrupt):
            # With a period of its own the tick is not one call of C
            one.step(near_limits(one.stack.robot, rng), None, one.stack.dt)
        recorder._call = call
        history(one, rng, 20)
    assert recorder.count == 40
    assert replay(recorder.path).identical


def test_ticks_of_one_call_are_recorded_by_c(tmp_path: Path) -> None:
    """What the policy finishes is told by Python; a tick that is interrupted there is left out."""
    one, rng = controller("arm", "panda", backend="native"), np.random.default_rng(3)
    core, calls, ended = core_of(one), list[int](), list[str]()
    with one.record(tmp_path / "run.npz") as recorder:
        call, finish = recorder._call, core.finish
        recorder._call = lambda: calls.append(0) or call()

        def interrupted(flag: int) -> int:
            finish(flag)
            raise KeyboardInterrupt

        for k in range(400):
            core.finish = interrupted if k == 200 else finish  # type: ignore[method-assign]
            try:
                ended.append(one.step(near_limits(one.stack.robot, rng)).status)
            except KeyboardInterrupt:
                continue
            else:
                # Until there is one that the policy has to finish
                core.finish = interrupted if 200 <= k < 300 else finish  # type: ignore[method-assign]
        chunks = recorder.count // recorder._chunk
    assert len(calls) <= chunks + 103
    assert list(Recording(recorder.path).status) == ended
    assert replay(recorder.path).identical


def test_ctrl_c_while_the_disk_is_waited_for_loses_nothing(tmp_path: Path) -> None:
    one = small.stack().compile(backend="native")

    class Interrupted:
        def get(self) -> None:
            raise KeyboardInterrupt

    with one.record(tmp_path / "run.npz") as recorder:
        assert recorder._writer is not None
        free = recorder._writer._free
        recorder._writer._free = Interrupted()  # type: ignore[assignment]
        for _ in range(recorder._chunk - 1):
            one.step(small.Q)
        with pytest.raises(KeyboardInterrupt):
            one.step(small.Q)
        recorder._writer._free = free
        for _ in range(recorder._chunk + 1):
            one.step(small.Q)
    assert len(Recording(recorder.path)["q"]) == recorder.count == 2 * recorder._chunk + 1
    assert replay(recorder.path).identical


def test_what_is_kept_of_chunks_is_no_work_for_the_collector_of_garbage(tmp_path: Path) -> None:
    """It would stop a loop for milliseconds."""
    writer = FileWriter(tmp_path / "x.npz", overwrite=False)
    writer.begin({"sizes": {"t": 4}}, {})
    writer.write(bytes(64))
    gc.collect()
    before = len(gc.get_objects())
    for _ in range(1000):
        writer.write(bytes(64))
    assert len(gc.get_objects()) < before + 100
    writer.close()
    assert len(LogFile(tmp_path / "x.npz")["t"]) == 2002


CHILD = """
import os, signal, sys, time
import numpy as np
from tests.stack import small
one = small.stack().compile(backend="native")
recorder = one.record(sys.argv[1])
for k in range(int(sys.argv[2])):
    one.step((0.001 * k, 0.8))
if sys.argv[3] == "kill":
    recorder._writer.wait()
    os.kill(os.getpid(), signal.SIGKILL)
if sys.argv[3] == "interrupt":
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(20)
"""


@pytest.mark.parametrize(("ending", "code"), [("kill", -signal.SIGKILL), ("interrupt", -signal.SIGINT), ("leave", 0)])
def test_what_a_process_leaves_behind(ending: str, code: int, tmp_path: Path) -> None:
    """All ticks after Ctrl-C and without a close; all whole chunks after a kill."""
    run = tmp_path / "run.npz"
    ticks = 2 * CHUNK + 10
    done = subprocess.run(
        [sys.executable, "-c", CHILD, str(run), str(ticks), ending], cwd=TOP, stderr=subprocess.DEVNULL, check=False
    )
    assert done.returncode == code
    made = Recording(run)
    assert made.complete == (ending != "kill")
    assert len(made["q"]) == (2 * CHUNK if ending == "kill" else ticks)
    assert np.array_equal(made["q"][:, 0], 0.001 * np.arange(len(made["q"])))
    found = replay(made)
    assert found.identical
    assert found.complete == made.complete


def test_half_a_chunk_is_left_out(tmp_path: Path) -> None:
    run = recorded(tmp_path / "run.npz", ticks=2500, backend="native")
    whole = run.read_bytes()
    counts = set()
    for cut in np.linspace(whole.index(b"ticks.000000"), len(whole) - 1, 40, dtype=int):
        (tmp_path / "cut.npz").write_bytes(whole[:cut])
        made = Recording(tmp_path / "cut.npz")
        counts.add(len(made["q"]))
        assert not made.complete
    assert counts == {*range(0, 2500, CHUNK), 2500}


def test_what_a_thread_writes_is_in_order_and_its_errors_come_back() -> None:
    """Memory that is short and a disk that is full alike; what was written before is counted."""

    class Kept:
        def __init__(self, error: Exception) -> None:
            self.error, self.numbers = error, b""

        def begin(self, about: object, attached: object) -> None:
            pass

        def write(self, numbers: bytes) -> None:
            if len(self.numbers) == 24:
                raise self.error
            self.numbers += numbers

        def abandon(self) -> None:
            pass

    for error, reason in ((OSError(28, "No space left"), "No space left"), (MemoryError(), "memory")):
        writer = BackgroundWriter(kept := Kept(error), 16, 2)  # type: ignore[arg-type]
        memory = writer.begin({}, {})
        for k in range(4):
            memory[:8] = bytes([k] * 8)
            with contextlib.suppress(OSError):
                memory = writer.exchange(memory, 8)
        with pytest.raises(OSError, match=reason):
            writer.wait()
        assert kept.numbers == bytes([0] * 8 + [1] * 8 + [2] * 8)
        assert writer.written == 24
        writer.abandon()
        writer._thread.join(10.0)
        assert not writer._thread.is_alive()


def test_a_full_disk_does_not_stop_the_controller(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    with pytest.raises(RecordingError, match="cannot be written: No space left"):
        small.stack().compile(backend="vm").record("/dev/full", overwrite=True)
    one = small.stack().compile(backend="native")
    call = core_of(one).call
    recorder = one.record(tmp_path / "run.npz")
    assert recorder._writer is not None

    def full(*arguments: object) -> None:
        raise OSError(28, "No space left on device")

    for _ in range(recorder._chunk + 3):
        one.step(small.Q)
    recorder._writer.wait()
    recorder._writer.writer._put = full  # type: ignore[attr-defined]
    for _ in range(2):
        for _ in range(recorder._chunk):
            assert one.step(small.Q).status == "solved"
        # The thread that writes has met the full disk
        if recorder._writer is not None:
            with contextlib.suppress(OSError):
                recorder._writer.wait()
    assert core_of(one).call is call
    assert [r.getMessage() for r in caplog.records] == [
        f"the recording {tmp_path / 'run.npz'} ends after {CHUNK} ticks: No space left on device"
    ]
    with pytest.raises(RecordingError, match=f"ends after {CHUNK} ticks: No space left"):
        recorder.close()
    recorder.close()
    assert len(Recording(recorder.path)["q"]) == recorder.count == CHUNK


_shared: Controller | None = None


def heir(ticks: int) -> bool:
    assert _shared is not None
    for _ in range(ticks):
        _shared.step(small.Q)
    return core_of(_shared).recording is None


def test_a_fork_leaves_the_file_to_its_parent(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    one = small.stack().compile(backend="native")
    monkeypatch.setattr(sys.modules[__name__], "_shared", one)
    with one.record(tmp_path / "run.npz") as recorder:
        one.step(small.Q)
        with multiprocessing.get_context("fork").Pool(1) as pool:
            assert pool.apply(heir, (recorder._chunk + 1,))
        one.step(small.Q)
    assert len(Recording(recorder.path)["q"]) == 2
    assert replay(recorder.path).identical


def test_parts_are_all_that_a_tick_reads() -> None:
    """A buffer that is added to the tick must be added to the recording."""
    from wbc.tick.buffers import OWN, Buffers

    # the wrenches that are kept are those of stacks that command accelerations
    assert {*INPUTS, "kept"} == set(Buffers.__annotations__) - {"report", "state", *OWN}
