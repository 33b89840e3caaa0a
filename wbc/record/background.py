"""Writing in a thread, so that ticks do not wait for a disk."""

from __future__ import annotations

import contextlib
import errno
import os
import threading
from collections.abc import Mapping
from queue import SimpleQueue
from typing import Any

from wbc.log.file import LogWriter


class BackgroundWriter:
    """Chunks of ticks that a :class:`~wbc.log.LogWriter` writes in a thread, with the priority of the loop.

    Their memory is made and touched at the beginning and handed round: what asks the system for more, or collects
    garbage, holds the interpreter's lock meanwhile.

    Attributes:
        writer: what writes. written: ticks that are in it [bytes].

    Args:
        size: of a chunk [bytes]. waiting: chunks that may wait to be written; a loop that is ahead by more waits.
    """

    def __init__(self, writer: LogWriter, size: int, waiting: int) -> None:
        self.writer, self.written, self._problem = writer, 0, OSError()
        self._free = SimpleQueue[memoryview]()
        self._full = SimpleQueue[tuple[memoryview, int] | threading.Event | None]()
        for _ in range(waiting + 1):
            # Ones, as memory of zeros is given when it is first written
            self._free.put(memoryview(bytearray(b"\1") * size))
        self._thread = threading.Thread(target=self._write, daemon=True)
        self._policy = 0, 0

    def begin(self, about: Mapping[str, Any], attached: Mapping[str, bytes]) -> memoryview:
        """Begin the other one; returns memory for the first chunk.

        Raises:
            LogFileError: it cannot be written.
        """
        self.writer.begin(about, attached)
        self._thread.start()
        return self._free.get()

    def exchange(self, chunk: memoryview, end: int) -> memoryview:
        """Have the first bytes of a chunk written; returns memory for the next one.

        Raises:
            OSError: what came before could not be written.
        """
        self._check()
        if hasattr(os, "sched_getscheduler"):
            policy = os.sched_getscheduler(0), os.sched_getparam(0).sched_priority
            if policy != self._policy:
                # A thread that holds the interpreter's lock and is not let run would keep the loop waiting
                self._policy = policy
                with contextlib.suppress(OSError):
                    os.sched_setscheduler(self._thread.native_id or 0, policy[0], os.sched_param(policy[1]))
        # Where Ctrl-C ends the waiting, nothing has changed
        fresh = self._free.get()
        self._full.put((chunk, end))
        return fresh

    def wait(self) -> None:
        """Until all is written.

        Raises:
            OSError: it could not be.
        """
        self._full.put(reached := threading.Event())
        reached.wait()
        self._check()

    def close(self) -> None:
        """Nothing more comes.

        Raises:
            OSError: it could not be written.
        """
        self._full.put(None)
        self._thread.join()
        self._check()
        self.writer.close()

    def abandon(self) -> None:
        """Leave what is written as it is: another process writes it, or nobody can."""
        self._full.put(None)
        self.writer.abandon()

    def _check(self) -> None:
        if self._problem.errno is not None:
            raise self._problem

    def _write(self) -> None:
        while (given := self._full.get()) is not None:
            if isinstance(given, threading.Event):
                given.set()
                continue
            chunk, end = given
            try:
                if self._problem.errno is None:
                    self.writer.write(chunk[:end])
                    self.written += end
            except OSError as error:
                self._problem = error
            except MemoryError:
                self._problem = OSError(errno.ENOMEM, os.strerror(errno.ENOMEM))
            self._free.put(chunk)
