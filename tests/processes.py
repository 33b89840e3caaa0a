"""Processes that a test starts end with it: what it leaves is killed and fails it. What a pytest leaves that is itself
killed ends as well: a watch looks for it.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

#: Variable that names the pytest process a process comes from
MARK = "WBC_TESTS_OF"
#: Seconds in which the processes of a test that has ended may end by themselves
GRACE = 5.0
#: Helpers of the standard library that end with their process
LASTING = (b"multiprocessing.resource_tracker", b"multiprocessing.forkserver")
#: Before a command: it runs as one that a shell without job control has started with &, which ignores Ctrl-C
IN_BACKGROUND = ("sh", "-c", 'trap "" INT; exec "$@"', "sh")
#: Numbers of Linux's prctl
_SET_PDEATHSIG, _SET_CHILD_SUBREAPER = 1, 36

#: Waits for the end of its parent, then ends all that have its mark
WATCH = """
import os, signal, sys, time
parent, mark = int(sys.argv[1]), sys.argv[2].encode()
while os.getppid() == parent:
    time.sleep(0.5)
for number in filter(str.isdecimal, os.listdir("/proc")):
    try:
        with open(f"/proc/{number}/environ", "rb") as file:
            mine = mark in file.read().split(b"\\0")
        if mine and int(number) != os.getpid():
            os.kill(int(number), signal.SIGKILL)
    except OSError:
        pass
"""


def begin() -> None:
    """Prepare this process: it hears Ctrl-C, which tests send to it and to children, also where the shell that started
    it in the background has it ignored; processes whose parent has ended become its children; and the watch runs.
    """
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    libc = ctypes.CDLL(None)
    libc.prctl(_SET_CHILD_SUBREAPER, 1)
    # Forked processes keep the environment of their parent's start, so the watch does not see them
    os.register_at_fork(after_in_child=lambda: libc.prctl(_SET_PDEATHSIG, signal.SIGKILL))
    os.environ[MARK] = f"{os.getpid()}-{time.time_ns()}"
    mark = f"{MARK}={os.environ[MARK]}"
    command = [sys.executable, "-I", "-S", "-c", WATCH, str(os.getpid()), mark]
    null = subprocess.DEVNULL
    # Its own environment has no mark, and no Ctrl-C at the terminal reaches it
    _watch.append(subprocess.Popen(command, env={}, stdin=null, stdout=null, stderr=null, start_new_session=True))


def descendants(process: int | str = "self") -> set[int]:
    """All processes that came from one and run. Asked for twice a test, so without objects for paths."""
    found: set[int] = set()
    for child in _children(process):
        with contextlib.suppress(OSError):
            if _said(f"/proc/{child}/stat").rpartition(b")")[2].split()[0] != b"Z":
                found |= {child, *descendants(child)}
    return found


def _children(process: int | str) -> set[int]:
    found: set[int] = set()
    with contextlib.suppress(OSError):
        for thread in os.listdir(f"/proc/{process}/task"):
            with contextlib.suppress(OSError):
                found.update(map(int, _said(f"/proc/{process}/task/{thread}/children").split()))
    return found


def _said(path: str) -> bytes:
    with open(path, "rb", buffering=0) as file:
        return file.read() or b""


def processor_time(process: int) -> float:
    """What a process has used [s]."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def left(known: set[int], seconds: float = GRACE) -> dict[int, str]:
    """Commands of the descendants that are not among the known ones and do not end within some seconds."""
    until = time.monotonic() + seconds
    while True:
        commands = {}
        for process in descendants() - known:
            with contextlib.suppress(OSError):
                command = Path(f"/proc/{process}/cmdline").read_bytes()
                if not any(helper in command for helper in LASTING):
                    commands[process] = command.replace(b"\0", b" ").decode(errors="replace")
        if not commands or time.monotonic() > until:
            return commands
        time.sleep(0.01)


def ended(known: set[int]) -> list[str]:
    """End the descendants that are not among the known ones and do not end by themselves; their commands."""
    commands: list[str] = []
    seconds = GRACE
    while found := left(known, seconds):
        commands += found.values()
        for process in found:
            with contextlib.suppress(OSError):
                os.kill(process, signal.SIGKILL)
                os.waitpid(process, 0)
        seconds = 0.0
    return commands


_KNOWN: pytest.StashKey[set[int]] = pytest.StashKey()
_watch: list[subprocess.Popen[bytes]] = []


def pytest_configure(config: pytest.Config) -> None:
    begin()


def pytest_unconfigure(config: pytest.Config) -> None:
    while _watch:
        with _watch.pop() as process:
            process.kill()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_setup(item: pytest.Item) -> Iterator[None]:
    item.stash[_KNOWN] = descendants()
    return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_teardown(item: pytest.Item) -> Iterator[None]:
    try:
        result = yield
    finally:
        commands = ended(item.stash[_KNOWN])
    if commands:
        pytest.fail(f"left running, and killed: {'; '.join(commands)}", pytrace=False)
    return result
