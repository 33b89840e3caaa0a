"""Rows that become native code behind the ticks: the same bits before, at and after the change."""

from __future__ import annotations

import fcntl
import logging
import os
import pathlib
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tests.controller.stacks import DT, arm, everything, humanoid, randomise
from tests.levels import arms
from tests.repeats import repeats
from tests.stack import small
from tests.torque import problems
from wbc.api import Controller, Stack
from wbc.controller import core_of
from wbc.errors import CompileError, ShapeError
from wbc.native import cache, toolchain
from wbc.stack import rows

#: Seconds until a library of rows is there, on a busy machine
PATIENCE = 60.0
FAMILY: dict[str, Callable[[], tuple[Stack, str]]] = {
    "small": lambda: (small.stack(), "velocity"),
    "panda": lambda: (everything("panda"), "velocity"),
    "ur5, plain": lambda: (everything("ur5", calm=False), "velocity"),
    "humanoid": lambda: (humanoid(), "velocity"),
    "levels": lambda: (arms.levels(), "velocity"),
    "torque": lambda: (problems.stack("panda"), "torque"),
    "acceleration": lambda: (arm("panda"), "acceleration"),
}


@pytest.fixture
def gate(monkeypatch: pytest.MonkeyPatch) -> Iterator[threading.Event]:
    """Rows are neither taken from the cache nor compiled before this is set."""
    gate = threading.Event()

    def fetch(*arguments: Any, **named: Any) -> Any:
        assert gate.wait(PATIENCE)
        return cache.fetch(*arguments, **named)

    monkeypatch.setattr(rows, "cache", SimpleNamespace(fetch=fetch))
    yield gate
    gate.set()


def rows_of(controller: Controller) -> rows.RowsLibrary:
    found = controller._artifact.rows
    assert found is not None
    return found


def changed(controller: Controller) -> bool:
    """Wait for the library."""
    assert rows_of(controller).ended.wait(PATIENCE)
    return controller.tier == "rows"


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


@pytest.mark.parametrize("name", FAMILY)
def test_the_bits_stay_the_same(name: str, gate: threading.Event) -> None:
    stack, command = FAMILY[name]()
    count = repeats(20)
    still = stack.compile(backend="vm", command=command)
    wanted = list(states(still, 2 * count))
    controller = stack.compile(command=command, wait=False)
    found = []
    for k, state in enumerate(states(controller, 2 * count)):
        assert controller.tier == ("vm" if k < count else "rows")
        found.append(state)
        if k == count - 1:
            gate.set()
            assert changed(controller)
    np.testing.assert_array_equal(found, wanted)
    assert still.tier == "vm", "it was asked for"


def test_clones_change_over_too(gate: threading.Event) -> None:
    controller = small.stack().compile(wait=False)
    before = controller.clone()
    gate.set()
    assert changed(controller)
    after = controller.clone()
    assert [c.tier for c in (before, after)] == ["rows", "rows"]
    commands = {c.step(small.Q).v.tobytes() for c in (controller, before, after)}
    assert commands == {small.stack().compile(backend="vm").step(small.Q).v.tobytes()}


def test_it_changes_under_threads_that_tick(gate: threading.Event) -> None:
    stack, wrong = arm("panda"), []
    first = stack.compile(wait=False)
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
            last = rows_of(first).ended.is_set()
            wrong.extend([controller.tier] * (run(controller) != wanted))

    threads = [threading.Thread(target=work, args=(controller,)) for controller in crew]
    for thread in threads:
        thread.start()
    gate.set()
    for thread in threads:
        thread.join(PATIENCE)
    assert wrong == []
    assert [c.tier for c in crew] == ["rows"] * 3


def test_a_compiler_that_fails_leaves_them_as_they_are(
    monkeypatch: pytest.MonkeyPatch, tmp_path: pathlib.Path, caplog: pytest.LogCaptureFixture
) -> None:
    def fail(text: str, output: pathlib.Path, behind: bool = False) -> None:
        raise CompileError("compiler", "cc", "failed: no room")

    monkeypatch.setenv("WBC_CACHE", str(tmp_path))
    monkeypatch.setattr(toolchain, "compile_rows", fail)
    with caplog.at_level(logging.WARNING, "wbc"):
        controller = small.stack().compile(wait=False)
        assert not changed(controller)
    assert "stay on CasADi's virtual machine" in caplog.text
    assert "no room" in caplog.text
    assert controller.tier == "vm"
    assert small.command(controller) == small.command(small.stack().compile(backend="vm"))


def test_what_it_says(gate: threading.Event, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO, "wbc"):
        controller = small.stack().compile(wait=False)
        gate.set()
        assert changed(controller)
        time.sleep(0.01)
    assert [r.levelname for r in caplog.records if "native code from here on" in r.getMessage()] == ["INFO"]
    with pytest.raises(ShapeError, match="wait"):
        small.stack().compile(wait="no")  # type: ignore[arg-type]


def test_a_fork_has_the_same_bits_and_holds_no_lock(monkeypatch: pytest.MonkeyPatch, tmp_path: pathlib.Path) -> None:
    """The child is there while its parent compiles; afterwards the entry's lock is free, though the child lives."""
    gate, compile_rows = threading.Event(), toolchain.compile_rows

    def wait(text: str, output: pathlib.Path, behind: bool = False) -> None:
        assert gate.wait(PATIENCE)
        compile_rows(text, output, behind)

    monkeypatch.setattr(toolchain, "compile_rows", wait)
    monkeypatch.setenv("WBC_CACHE", str(tmp_path / "cache"))
    controller = small.stack().compile(wait=False)
    until = time.monotonic() + PATIENCE
    while not (locks := list((tmp_path / "cache").glob(".*.lock"))) or len(locks) < 2:
        assert time.monotonic() < until
        time.sleep(0.01)
    (read, write), (ready, go) = os.pipe(), os.pipe()
    child = os.fork()
    if child == 0:
        os.write(write, controller.step(small.Q).v.tobytes() + controller.tier.encode())
        os.read(ready, 1)
        os._exit(0)
    try:
        found = os.read(read, 1000)
        gate.set()
        assert changed(controller)
        assert found == controller.clone().step(small.Q).v.tobytes() + b"vm"
        for path in locks:
            with path.open("a") as file:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    finally:
        os.write(go, b".")
        os.waitpid(child, 0)
        for end in (read, write, ready, go):
            os.close(end)


#: A compiler that takes its time over rows, and says that it is at work
SLOW = """#!/bin/sh
case "$*" in *rows.c*) case "$*" in *-shared*) touch "$WBC_AT_WORK"; sleep {seconds};; esac;; esac
exec {gcc} "$@"
"""
ENDS = """
import os, pathlib, time
from tests.stack import small
controller = small.stack().compile(wait=False)
while not os.path.exists(os.environ["WBC_AT_WORK"]):
    time.sleep(0.01)
print(controller.tier, controller.step(small.Q).v.size)
"""
INTERRUPTED = """
import os, signal, time
from tests.stack import small
controller = small.stack().compile(wait=False)
while not os.path.exists(os.environ["WBC_AT_WORK"]):
    time.sleep(0.01)
try:
    os.killpg(0, signal.SIGINT)
    time.sleep(60)
except KeyboardInterrupt:
    controller._artifact.rows.ended.wait(60)
print(controller.tier, controller.step(small.Q).v.size)
"""


def run(script: str, folder: pathlib.Path, seconds: float) -> tuple[str, float, list[str]]:
    """What a process says, how long it lives after its compiler began, and what is left in its cache."""
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
    until = time.monotonic() + PATIENCE
    while not work.exists() and process.poll() is None and time.monotonic() < until:
        time.sleep(0.01)
    began = time.monotonic()
    said, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, errors
    return said.strip(), time.monotonic() - began, [p.name for p in kept.iterdir() if p.is_dir() and p.name[0] == "."]


def test_the_end_of_the_process_ends_the_compiler(tmp_path: pathlib.Path) -> None:
    said, lived, left = run(ENDS, tmp_path, 30.0)
    assert said == "vm 2"
    assert lived < 20.0
    assert left == [], "nothing half made in the cache"
    assert not any(str(tmp_path / "cc").encode() in _command_line(p) for p in pathlib.Path("/proc").glob("[0-9]*"))


def _command_line(process: pathlib.Path) -> bytes:
    try:
        return (process / "cmdline").read_bytes()
    except OSError:
        return b""


def test_an_interrupt_does_not_end_the_compiler(tmp_path: pathlib.Path) -> None:
    said, _, left = run(INTERRUPTED, tmp_path, 0.3)
    assert said == "rows 2"
    assert left == []
