"""Writing in a thread, so that ticks do not wait for a disk."""

from __future__ import annotations

import contextlib
import errno
import os
import queue
import threading
from collections.abc import Mapping
from typing import Any

import numpy as np

from wbc.log.file import LogWriter

#: Chunks that wait to be written at most; a loop that is ahead by more waits for the disk
WAITING = 256


class BackgroundWriter:
    """A :class:`~wbc.log.LogWriter` whose ticks another one writes, in a thread with the priority of the loop.

    Attributes:
        written: ticks that are in the other one [bytes].
    """

    def __init__(self, writer: LogWriter) -> None:
        self.writer, self.written, self._problem = writer, 0, OSError()
        self._waiting: queue.Queue[bytes | None] = queue.Queue(WAITING)
        self._thread = threading.Thread(target=self._write, daemon=True)
        self._policy = 0

    def begin(self, about: Mapping[str, Any], attached: Mapping[str, bytes]) -> None:
        """See :class:`~wbc.log.LogWriter`."""
        self.writer.begin(about, attached)
        self._thread.start()

    def table(self, name: str, values: np.ndarray) -> None:
        """See :class:`~wbc.log.LogWriter`."""
        self.wait()
        self.writer.table(name, values)

    def write(self, numbers: bytes | memoryview) -> None:
        """Have them written.

        Raises:
            OSError: what came before could not be.
        """
        self._check()
        if hasattr(os, "sched_getscheduler") and (policy := os.sched_getscheduler(0)) != self._policy:
            # A thread that holds the interpreter's lock and is not let run would keep the loop waiting
            self._policy = policy
            with contextlib.suppress(OSError):
                os.sched_setscheduler(self._thread.native_id or 0, policy, os.sched_getparam(0))
        self._waiting.put(bytes(numbers))

    def wait(self) -> None:
        """Until all is written.

        Raises:
            OSError: it could not be.
        """
        self._waiting.join()
        self._check()

    def close(self) -> None:
        """See :class:`~wbc.log.LogWriter`."""
        self._waiting.put(None)
        self._thread.join()
        self._check()
        self.writer.close()

    def abandon(self) -> None:
        """See :class:`~wbc.log.LogWriter`."""
        self.writer.abandon()

    def _check(self) -> None:
        if self._problem.errno is not None:
            # Nothing more comes: the thread ends
            self._waiting.put(None)
            raise self._problem

    def _write(self) -> None:
        while (numbers := self._waiting.get()) is not None:
            try:
                if self._problem.errno is None:
                    self.writer.write(numbers)
                    self.written += len(numbers)
            except OSError as error:
                self._problem = error
            except MemoryError:
                self._problem = OSError(errno.ENOMEM, os.strerror(errno.ENOMEM))
            self._waiting.task_done()
