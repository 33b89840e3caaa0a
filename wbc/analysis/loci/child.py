"""Work that can be ended at any moment, in a process of its own."""

from __future__ import annotations

import ctypes
import os
import pickle
import signal
import sys
import threading
import time
from collections.abc import Callable
from math import inf
from types import TracebackType
from typing import Any, TypeAlias

#: Given to the work, which reports by it what it has found
Report: TypeAlias = Callable[[Any], None]
#: What a process gets to answer an interrupt before it is killed [s]
GRACE = 1.0
#: prctl(PR_SET_PDEATHSIG, ...): the signal that a process gets when its parent ends
_PARENT_DIED = 1


class Child:
    """A forked copy of this process that works and reports what it finds, until its time is over.

    python-flint holds the interpreter while it factors one polynomial, which can take hours, and hears of no limit
    meanwhile. A process can be ended by the kernel: at its time, with its parent, or by :meth:`stop`.

    Use as a context. Where processes cannot be forked, the work is done at once, without a limit.

    Attributes:
        reports: everything that was reported so far, in order. done: whether the work was ended by itself.
    """

    def __init__(self, work: Callable[[Report], None], seconds: float) -> None:
        self.reports: list[Any] = []
        self.done = False
        self._until = time.monotonic() + seconds
        self._pid = 0
        self._error: Exception | None = None
        if not hasattr(os, "fork"):
            work(self.reports.append)
            self.done = True
            return
        read, write = os.pipe()
        self._pid = os.fork()
        if self._pid == 0:
            os.close(read)
            _worked(work, write, seconds)
        os.close(write)
        self._ended = threading.Event()
        self._reader = threading.Thread(target=self._read, args=(read,), daemon=True)
        self._reader.start()

    def wait(self, seconds: float = inf) -> bool:
        """Whether the work has ended within this time and its own, which began before the fork, or was killed.

        Raises:
            Whatever the work raised.
        """
        if self._pid:
            self._ended.wait(max(0.0, min(seconds, self._until - time.monotonic())))
        if self._error is not None:
            raise self._error
        return not self._pid or self._ended.is_set()

    def interrupt(self) -> None:
        """A keyboard interrupt for the work, which may answer it with what it knows, and its end."""
        if self._pid and not self._ended.is_set():
            os.kill(self._pid, signal.SIGINT)
            self._ended.wait(GRACE)
        self.stop()

    def stop(self) -> None:
        """The end of the process; what it reported stays."""
        if not self._pid:
            return
        if not self._ended.is_set():
            os.kill(self._pid, signal.SIGKILL)
        self._reader.join()
        os.waitpid(self._pid, 0)
        self._pid = 0

    def __enter__(self) -> Child:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    def _read(self, read: int) -> None:
        with open(read, "rb") as pipe:
            while True:
                try:
                    kind, what = pickle.load(pipe)
                except (EOFError, pickle.UnpicklingError):
                    break
                if kind == "report":
                    self.reports.append(what)
                elif kind == "error":
                    self._error = what
                else:
                    self.done = True
        self._ended.set()


def _worked(work: Callable[[Report], None], write: int, seconds: float) -> None:
    """The life of the process: it leaves without any of its parent's last words."""
    with open(write, "wb") as pipe:

        def send(kind: str, what: Any = None) -> None:
            pickle.dump((kind, what), pipe)
            pipe.flush()

        try:
            signal.signal(signal.SIGALRM, signal.SIG_DFL)
            signal.signal(signal.SIGINT, signal.default_int_handler)
            signal.setitimer(signal.ITIMER_REAL, max(seconds, 1e-3))
            if sys.platform == "linux":
                ctypes.CDLL(None).prctl(_PARENT_DIED, signal.SIGKILL)
            work(lambda what: send("report", what))
            send("done")
        except Exception as error:  # noqa: BLE001 - the parent raises it
            send("error", error)
        finally:
            os._exit(0)  # a keyboard interrupt as well ends here
