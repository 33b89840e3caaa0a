"""Stacks that answer at once, and become native code behind the ticks: the same bits before and after."""

from __future__ import annotations

import fcntl
import gc
import logging
import os
import pathlib
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from tests.constraints import test_rows_by_need
from tests.controller.stacks import DT, arm, everything, randomise
from tests.repeats import repeats
from tests.stack import small
from tests.torque import problems
from wbc.api import Controller, Stack
from wbc.controller import core_of
from wbc.errors import CompileError, ShapeError
from wbc.native import toolchain
from wbc.stack import behind
from wbc.tick.generic import GenericTick

#: As users have it; see tests/backends.py
pytestmark = pytest.mark.at_once

FAMILY: dict[str, Callable[[], tuple[Stack, str]]] = {
    "small": lambda: (small.stack(), "velocity"),
    "panda": lambda: (everything("panda"), "velocity"),
    "measured": lambda: (test_rows_by_need.stack(test_rows_by_need.panda(8.0), 3), "velocity"),
    "torque": lambda: (problems.stack("panda"), "torque"),
}


@pytest.fixture(autouse=True)
def own_cache(monkeypatch: pytest.MonkeyPatch, tmp_path: pathlib.Path) -> None:
    """What is in no cache is compiled."""
    monkeypatch.setenv("WBC_CACHE", str(tmp_path / "cache"))


@pytest.fixture
def gate(monkeypatch: pytest.MonkeyPatch) -> Iterator[threading.Event]:
    """No library is offered before this is set."""
    gate, finish = threading.Event(), behind._finish

    def wait(child: subprocess.Popen[str]) -> str:
        gate.wait()
        return finish(child)

    monkeypatch.setattr(behind, "_finish", wait)
    yield gate
    gate.set()


def wait_for(library: behind.NativeBehind | None) -> None:
    """Until it is there, for as long as somebody is at work on it: a busy machine takes any time."""
    assert library is not None
    while not library.ended.wait(0.1):
        assert behind._work.threads, "nobody compiles any more"


def changes(controller: Controller) -> bool:
    """Wait for the library; whether the next step will change over to it."""
    wait_for(controller._artifact.behind)
    assert controller.tier == "vm", "before a step"
    return core_of(controller).assembly.offered


def states(controller: Controller, count: int) -> Iterator[np.ndarray]:
    """Everything that a tick may leave for the next one and for its user, tick by tick, through random inputs."""
    robot, rng = controller.stack.robot, np.random.default_rng(5)
    q = robot.neutral
    for k in range(count):
        if k % 5 == 0:
            randomise(controller, np.random.default_rng(k))
            q = robot.integrate(robot.neutral, 0.3 * rng.normal(size=robot.nv), 1.0)
        q = robot.integrate(q, controller.step(q).v, DT)
        yield core_of(controller).tick.state.copy()


def spoil_after_change(controller: Controller) -> None:
    """What only the shared code knows becomes NaN when ticks have changed over."""
    tick = core_of(controller).assembly
    assert isinstance(tick, GenericTick)
    change = tick.change_over

    def spoil() -> None:
        change()
        tick._rest[:] = np.nan

    setattr(tick, "change_over", spoil)  # noqa: B010 (a method)


@pytest.mark.parametrize("name", FAMILY)
def test_the_bits_stay_the_same(name: str, gate: threading.Event) -> None:
    stack, command = FAMILY[name]()
    count = repeats(20)
    still = stack.compile(backend="vm", command=command)
    wanted = list(states(still, 2 * count))
    controller = stack.compile(command=command)
    found = []
    for k, state in enumerate(states(controller, 2 * count)):
        assert controller.tier == ("vm" if k < count else "native")
        found.append(state)
        if k == count - 1:
            gate.set()
            assert changes(controller)
            # Nothing of what only the shared code knows is read any more
            spoil_after_change(controller)
    np.testing.assert_array_equal(found, wanted)
    assert still.tier == "vm", "it was asked for"
    assert stack.compile(command=command).tier == "native", "found in the cache"


def test_clones_change_over_too(gate: threading.Event) -> None:
    controller = small.stack().compile()
    before = controller.clone()
    gate.set()
    assert changes(controller)
    after = controller.clone()
    commands = {c.step(small.Q).v.tobytes() for c in (controller, before, after)}
    assert [c.tier for c in (controller, before, after)] == ["native"] * 3
    assert commands == {small.stack().compile(backend="vm").step(small.Q).v.tobytes()}


def test_it_changes_under_threads_that_tick(gate: threading.Event) -> None:
    stack, wrong = small.stack(), []
    first = stack.compile()
    crew = [first, first.clone(), first.clone()]

    def run(controller: Controller) -> list[bytes]:
        controller.reset(controller.stack.robot.neutral)
        return [state.tobytes() for state in states(controller, 40)]

    alone = stack.compile(backend="vm")
    for controller in (alone, *crew):
        run(controller)
    wanted = run(alone)

    def work(controller: Controller) -> None:
        last = False
        while not last:
            last = controller.tier == "native"
            wrong.extend([controller.tier] * (run(controller) != wanted))

    # While they tick the library is loaded; what compiles it would hardly get a core beside them
    assert behind._work.child is not None
    while behind._work.child.poll() is None:
        time.sleep(0.01)
    threads = [threading.Thread(target=work, args=(controller,)) for controller in crew]
    for thread in threads:
        thread.start()
    gate.set()
    for thread in threads:
        thread.join()
    assert wrong == []
    assert [c.tier for c in crew] == ["native"] * 3


def test_a_compiler_that_fails_leaves_them_as_they_are(
    monkeypatch: pytest.MonkeyPatch, tmp_path: pathlib.Path, caplog: pytest.LogCaptureFixture
) -> None:
    compiler = tmp_path / "cc"
    compiler.write_text("#!/bin/sh\necho no room >&2\nexit 1\n")
    compiler.chmod(0o755)
    monkeypatch.setenv("WBC_CC", str(compiler))
    with caplog.at_level(logging.WARNING, "wbc"):
        controller = small.stack().compile()
        assert not changes(controller)
    assert "stays on CasADi's virtual machine" in caplog.text
    assert "no room" in caplog.text
    assert small.command(controller) == small.command(small.stack().compile(backend="vm"))
    assert controller.settled().tier == "vm"


def test_a_loop_may_forbid_the_change(gate: threading.Event) -> None:
    controller = small.stack().compile()
    controller.may_change = False
    gate.set()
    assert changes(controller)
    copy = controller.clone()
    wanted = [controller.step(small.Q).v.tobytes() for _ in range(3)]
    assert controller.tier == "vm"
    assert not copy.may_change
    controller.may_change = copy.may_change = True
    assert [copy.step(small.Q).v.tobytes() for _ in range(3)] == wanted
    controller.step(small.Q)
    assert (controller.tier, copy.tier) == ("native", "native")
    with pytest.raises(ShapeError, match="may_change"):
        controller.may_change = "no"  # type: ignore[assignment]


def test_who_waits_has_native_code(gate: threading.Event, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO, "wbc"):
        first = small.stack().compile()
        gate.set()
        assert small.stack().compile(wait=True).tier == "native"
        assert first.settled().tier == "native"
    assert [r.levelname for r in caplog.records if "change over with their next tick" in r.getMessage()] == ["INFO"]
    with pytest.raises(ShapeError, match="wait"):
        small.stack().compile(wait="no")  # type: ignore[arg-type]
    assert first.batch(2).step(small.Q).v[1].tobytes() == first.clone().step(small.Q).v.tobytes()


def test_the_compiler_has_a_low_priority_within_the_session_of_its_loop(gate: threading.Event) -> None:
    controller = small.stack().compile()
    child = behind._work.child
    assert child is not None
    # Of another session's it would count for nothing: processors are shared between sessions first
    assert os.getsid(child.pid) == os.getsid(0)
    assert os.getpgid(child.pid) == child.pid
    assert os.getpriority(os.PRIO_PROCESS, child.pid) >= behind._LOW
    gate.set()
    wait_for(controller._artifact.behind)


def test_a_loop_in_real_time_waits_for_it_no_longer_than_a_turn(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[int, int]] = []
    monkeypatch.setattr(os, "sched_getparam", lambda thread: os.sched_param(50 if thread else 0))
    monkeypatch.setattr(
        os, "sched_setscheduler", lambda thread, policy, param: asked.append((policy, param.sched_priority))
    )
    before = sys.getswitchinterval()
    with behind._beside_loops():
        assert sys.getswitchinterval() == pytest.approx(behind._TURN)
        assert asked == [(os.SCHED_FIFO, 49)]
        if (child := os.fork()) == 0:
            os._exit(sys.getswitchinterval() != before)
        assert os.waitpid(child, 0)[1] == 0
    assert sys.getswitchinterval() == before
    assert asked[1:] == [(os.sched_getscheduler(0), 0)]


def test_a_library_of_another_layout_is_refused(tmp_path: pathlib.Path, caplog: pytest.LogCaptureFixture) -> None:
    other = everything("ur5").compile(wait=True)._artifact.library
    assert other is not None
    with pytest.raises(CompileError, match="another layout"):
        core_of(small.stack().compile(backend="vm")).assembly.offer(behind.load_library(other))  # type: ignore[attr-defined]


def test_a_change_that_is_interrupted_is_done_again(gate: threading.Event, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C between any two instructions of the change: the tick goes on here or there, to the same bits."""
    wanted = [state.tobytes() for state in states(small.stack().compile(backend="vm"), 12)]
    original = small.stack().compile()
    gate.set()
    assert changes(original)
    lines, counted = 0, True
    while counted:
        controller = original.clone()
        controller.may_change = False
        found = []
        counted = False
        for k, state in enumerate(states(controller, 12)):
            found.append(state.tobytes())
            if k == 5:
                counted = interrupted(core_of(controller).assembly.change_over, lines)
                controller.may_change = True
        lines += 1
        assert found == wanted, lines
        assert controller.tier == "native"
    assert lines > 8


def interrupted(call: Callable[[], None], lines: int) -> bool:
    """Call it, with a KeyboardInterrupt before line ``lines`` of it; whether there was one."""
    left = lines

    def trace(frame: Any, event: str, _: Any) -> Any:
        nonlocal left
        if frame.f_code.co_name != "change_over" and frame.f_back.f_code.co_name != "change_over":
            return None
        if event == "line":
            left -= 1
            if left < 0:
                raise KeyboardInterrupt
        return trace

    sys.settrace(trace)
    try:
        call()
    except KeyboardInterrupt:
        return True
    finally:
        sys.settrace(None)
    return False


def test_a_fork_has_the_same_bits_and_holds_no_lock(gate: threading.Event, tmp_path: pathlib.Path) -> None:
    """The child is there while its parent compiles; it goes on as it is, and may wait for native code of its own."""
    controller = small.stack().compile()
    (read, write), (ready, go) = os.pipe(), os.pipe()
    child = os.fork()
    if child == 0:
        try:
            os.write(write, controller.step(small.Q).v.tobytes() + controller.tier.encode())
            os.read(ready, 1)
            gate.set()
            settled = controller.settled()
            os.write(write, settled.step(small.Q).v.tobytes() + settled.tier.encode())
        finally:
            os._exit(0)
    try:
        found = os.read(read, 1000)
        gate.set()
        assert changes(controller)
        copy = controller.clone()
        assert found == copy.step(small.Q).v.tobytes() + b"vm"
        for path in (tmp_path / "cache").glob(".*.lock"):
            with path.open("a") as file:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        os.write(go, b".")
        assert os.read(read, 1000) == copy.step(small.Q).v.tobytes() + b"native"
    finally:
        os.waitpid(child, 0)
        for end in (read, write, ready, go):
            os.close(end)


def test_what_nobody_has_any_more_is_not_compiled(gate: threading.Event, tmp_path: pathlib.Path) -> None:
    first = small.stack().compile()
    second = arm("ur5").compile()
    library = second._artifact.behind
    assert library is not None
    del second
    gc.collect()
    gate.set()
    assert changes(first)
    wait_for(library)
    assert library.library(wait=False) is None


#: Seconds that no process of these tests lives, however busy the machine is
LONGER = 600.0
#: A compiler that takes its time over rows, and says that it is at work
SLOW = """#!/bin/sh
case "$*" in *rows.c*) touch "$WBC_AT_WORK"; sleep {seconds};; esac
exec {gcc} "$@"
"""
ENDS = """
import os, pathlib, time
from tests.stack import small
controller = small.stack().compile()
while not os.path.exists(os.environ["WBC_AT_WORK"]):
    time.sleep(0.01)
print(controller.tier, controller.step(small.Q).v.size)
"""
INTERRUPTED = """
import os, signal, time
from tests.stack import small
controller = small.stack().compile()
while not os.path.exists(os.environ["WBC_AT_WORK"]):
    time.sleep(0.01)
try:
    os.killpg(0, signal.SIGINT)
    time.sleep(600)
except KeyboardInterrupt:
    controller._artifact.behind.ended.wait()
controller.step(small.Q)
print(controller.tier, controller.step(small.Q).v.size)
"""


def run(script: str, folder: pathlib.Path, seconds: float) -> tuple[str, list[str]]:
    """What a process says that does not live as long as LONGER, and what is left in its cache."""
    compiler = toolchain.compiler()
    cc, kept, work = folder / "cc", folder / "cache", folder / "work"
    cc.write_text(SLOW.format(gcc=compiler, seconds=seconds))
    cc.chmod(0o755)
    process = subprocess.Popen(
        [sys.executable, "-c", script],
        env={**os.environ, "WBC_CC": str(cc), "WBC_CACHE": str(kept), "WBC_AT_WORK": str(work)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    said, errors = process.communicate(timeout=LONGER)
    assert process.returncode == 0, errors
    return said.strip(), [p.name for p in kept.iterdir() if p.is_dir() and p.name[0] == "."]


def test_the_end_of_the_process_ends_the_compiler(tmp_path: pathlib.Path) -> None:
    said, left = run(ENDS, tmp_path, 2.0 * LONGER)
    assert said == "vm 2"
    assert left == [], "nothing half made in the cache"
    assert not any(str(tmp_path / "cc").encode() in _command_line(p) for p in pathlib.Path("/proc").glob("[0-9]*"))


def _command_line(process: pathlib.Path) -> bytes:
    try:
        return (process / "cmdline").read_bytes()
    except OSError:
        return b""


def test_an_interrupt_does_not_end_the_compiler(tmp_path: pathlib.Path) -> None:
    said, left = run(INTERRUPTED, tmp_path, 0.3)
    assert said == "native 2"
    assert left == []
