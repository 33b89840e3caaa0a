"""Rows of a stack as native code, compiled behind ticks that meanwhile have them from CasADi's virtual machine."""

from __future__ import annotations

import atexit
import ctypes
import logging
import pathlib
import threading
import weakref
from collections.abc import Callable
from typing import Protocol

from wbc.errors import CompileError
from wbc.native import cache, toolchain
from wbc.native.library import load_library

log = logging.getLogger("wbc")

_LIBRARY = "rows.so"
#: Threads that compile; what the end of the process waits for, so that nothing is left in the cache, and how long [s]
_working: set[threading.Thread] = set()
_PATIENCE = 5.0


@atexit.register
def _end() -> None:
    toolchain.end_behind()
    for thread in list(_working):
        thread.join(_PATIENCE)


class Changing(Protocol):
    """A tick whose rows may change over to native code."""

    def change_over(self, library: ctypes.PyDLL) -> None:
        """From the next call on; may be called twice."""


class RowsLibrary:
    """A library in the making. Ticks change over when it is there; where it fails they stay as they are.

    A tick holds the interpreter's lock, and so does the change: it falls between two of them. A forked process has no
    thread that compiles, so there ticks that have not changed stay as they are. No lock is held here that a fork could
    take along.

    Args:
        named: gives the name of the cache's entry; a compiler is asked for its version. source: C of the functions.
        what: it is, for the log.

    Attributes:
        ended: set when it is there, or has failed.
    """

    def __init__(self, named: Callable[[], str], source: pathlib.Path, what: str) -> None:
        self.ended = threading.Event()
        self._named, self._source, self._what = named, source, what
        self._library: ctypes.PyDLL | None = None
        self._ticks: list[weakref.ref[Changing]] = []
        self._thread = threading.Thread(target=self._work, name="wbc-rows", daemon=True)
        _working.add(self._thread)
        self._thread.start()

    def give(self, tick: Changing) -> None:
        """The tick changes over, now or when the library is there."""
        self._ticks.append(weakref.ref(tick))
        # The other thread has set this before it looks at who waits
        if self._library is not None:
            tick.change_over(self._library)

    def _work(self) -> None:
        try:
            folder, _ = cache.fetch(self._named(), self._fill, library=True, what=f"rows of {self._what}")
            self._library = load_library(folder / _LIBRARY)
        except (CompileError, OSError) as error:
            if not toolchain.ends():
                log.warning("rows of %s stay on CasADi's virtual machine: %s", self._what, error)
        else:
            for waiting in list(self._ticks):
                if (tick := waiting()) is not None:
                    tick.change_over(self._library)
            log.info("rows of %s are native code from here on", self._what)
        finally:
            self.ended.set()
            _working.discard(self._thread)

    def _fill(self, folder: pathlib.Path) -> None:
        toolchain.compile_rows(self._source.read_text(), folder / _LIBRARY, behind=True)
