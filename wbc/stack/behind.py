"""A stack's library, compiled behind ticks that meanwhile run in the code that all stacks share."""

from __future__ import annotations

import atexit
import contextlib
import ctypes
import logging
import os
import signal
import subprocess
import sys
import threading
import weakref
from collections.abc import Iterator
from pathlib import Path
from typing import Protocol

from wbc.errors import CompileError
from wbc.native import cache
from wbc.native.library import load_library
from wbc.stack.compiling import LIBRARY, compile_behind

log = logging.getLogger("wbc")

#: How long the end of the process waits for what clears the cache up [s]
_PATIENCE = 5.0
#: Priority of the process that compiles (nice)
_LOW = 10
#: How long a loop waits for the interpreter's lock while its library is loaded behind it [s]; Python's own is 5 ms
_TURN = 1e-4
#: Where modules are looked for is told last, so that nothing there hides Python's own
_CHILD = """
import pathlib, signal, sys
signal.signal(signal.SIGTERM, lambda *_: sys.exit("ended"))
sys.path += sys.argv[2:]
from wbc.stack.compiling import compile_behind
print(compile_behind(pathlib.Path(sys.argv[1])))
"""


def _stop(child: subprocess.Popen[str]) -> None:
    """End a compiler, and what it has started where there are groups of processes."""
    with contextlib.suppress(OSError):
        if hasattr(os, "killpg"):
            os.killpg(child.pid, signal.SIGTERM)
        else:
            child.terminate()


class _Work:
    """What compiles in this process: one library at a time, each in a process of its own.

    Attributes:
        interval: how long threads waited for the interpreter's lock before :func:`_beside_loops`, within it [s].
    """

    interval: float | None = None

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """A forked process has no thread of its parent's, and must not end its compiler."""
        self.turn, self.ends = threading.Lock(), threading.Event()
        self.threads: set[threading.Thread] = set()
        self.child: subprocess.Popen[str] | None = None
        if self.interval is not None:
            sys.setswitchinterval(self.interval)

    def end(self) -> None:
        """End it, for good."""
        self.ends.set()
        if (child := self.child) is not None:
            _stop(child)
        for thread in list(self.threads):
            thread.join(_PATIENCE)


_work = _Work()


atexit.register(_work.end)
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_work.forget)


@contextlib.contextmanager
def _beside_loops() -> Iterator[None]:
    """What this thread does keeps no tick of another one waiting for long: the interpreter's lock changes hands every
    :data:`_TURN`, and beside loops in real time who holds it is held up by no other process, nor holds up the loops.
    """
    before, own = sys.getswitchinterval(), None
    _work.interval = before
    sys.setswitchinterval(min(before, _TURN))
    with contextlib.suppress(OSError, AttributeError):
        own = os.sched_getscheduler(0), os.sched_getparam(0)
        threads = [thread.native_id for thread in threading.enumerate() if thread.native_id]
        highest = max(os.sched_getparam(thread).sched_priority for thread in threads)
        if highest > 1:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(highest - 1))
    try:
        yield
    finally:
        sys.setswitchinterval(before)
        _work.interval = None
        if own is not None:
            with contextlib.suppress(OSError):
                os.sched_setscheduler(0, *own)


class Changing(Protocol):
    """A tick that may change over to the library of its stack."""

    def offer(self, library: ctypes.PyDLL) -> None:
        """To be taken between two ticks; may be called twice.

        Raises:
            CompileError: it is of another layout.
        """


class NativeBehind:
    """A library in the making. Ticks are offered it when it is there; where it fails they stay as they are.

    No lock is held here that a fork could take along: the process that compiles holds that of the cache. A forked
    process goes on with what it has, and compiles for itself where it is asked to wait.

    Args:
        folder: see :func:`wbc.stack.compiling.compile_behind`. what: it is, for the log.

    Attributes:
        ended: set when it is there, or has failed.
    """

    def __init__(self, folder: Path, what: str) -> None:
        self.ended = threading.Event()
        self._folder, self._what, self._owner = folder, what, 0
        self._made: tuple[Path, ctypes.PyDLL] | None = None
        self._ticks: list[weakref.ref[Changing]] = []

    def give(self, tick: Changing) -> None:
        """The tick is offered the library, now or when it is there."""
        self._ticks.append(weakref.ref(tick))
        if not self._owner:
            self._owner = os.getpid()
            self._begin()
        # The other thread has set this before it looks at who waits
        if self._made is not None:
            tick.offer(self._made[1])

    def library(self, wait: bool) -> Path | None:
        """Its file if it is there; ``wait``: or will be."""
        if wait and self._owner == os.getpid():
            self.ended.wait()
        elif wait and self._made is None:
            self._run()
        return self._made and self._made[0]

    def _begin(self) -> None:
        """A process starts with the interpreter's lock held: before there are ticks, unless another is at work."""
        begun, child = _work.turn.acquire(blocking=False), None
        try:
            with contextlib.suppress(OSError, CompileError):
                child = _start(self._folder) if begun else None
            thread = threading.Thread(target=self._run, args=(begun, child), name="wbc-behind", daemon=True)
            _work.threads.add(thread)
            thread.start()
        except BaseException:
            if begun:
                _work.turn.release()
            raise

    def _run(self, begun: bool = False, child: subprocess.Popen[str] | None = None) -> None:
        if not begun:
            _work.turn.acquire()
        try:
            if child is not None or any(tick() is not None for tick in self._ticks):
                self._make(child or _start(self._folder))
        except (CompileError, OSError) as error:
            if not _work.ends.is_set():
                log.warning("%s stays on CasADi's virtual machine: %s", self._what, error)
        finally:
            _work.turn.release()
            self.ended.set()
            _work.threads.discard(threading.current_thread())

    def _make(self, child: subprocess.Popen[str] | None) -> None:
        name = compile_behind(self._folder) if child is None else _finish(child)
        with _beside_loops():
            path = cache.base_of(name, library=True) / name / LIBRARY
            if cache.find(name, library=True) is None:
                raise CompileError("library", str(path), "is not what was compiled")
            made = path, load_library(path)
            self._made = made
            for waiting in list(self._ticks):
                if (tick := waiting()) is not None:
                    tick.offer(made[1])
        log.info("%s: native code is there, and controllers change over with their next tick", self._what)


def _start(folder: Path) -> subprocess.Popen[str] | None:
    """The process that makes a library from what a folder has, and prints its name; None without an interpreter."""
    if getattr(sys, "frozen", False) or not sys.executable:
        return None
    if _work.ends.is_set():
        raise CompileError("compiler", None, "the process ends")
    paths = [path for path in sys.path if path]
    child = _work.child = subprocess.Popen(
        [sys.executable, "-P", "-c", _CHILD, str(folder), *paths],
        env={**os.environ, "WBC_CACHE": str(cache.base_of(f"{folder.name}-", library=True))},
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, errors="replace",
        process_group=0,
    )  # fmt: skip
    with contextlib.suppress(OSError, AttributeError):
        os.setpriority(os.PRIO_PGRP, child.pid, _LOW)
        # Of a loop in real time it has no share
        os.sched_setscheduler(child.pid, os.SCHED_OTHER, os.sched_param(0))
    return child


def _finish(child: subprocess.Popen[str]) -> str:
    """Wait for it: the name of what it made."""
    with child:
        if _work.ends.is_set():
            _stop(child)
        printed, errors = child.communicate()
        _work.child = None
    if child.returncode != 0:
        lines = errors.strip().splitlines() or [f"exit status {child.returncode}, no message"]
        raise CompileError("compiler", sys.executable, lines[-1])
    return printed.splitlines()[-1]
