"""Ticks of a run as they come: the memory of every log, and what goes to its writer meanwhile."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from typing import Any

import numpy as np

from wbc.log.file import LogWriter
from wbc.log.log import Log
from wbc.validation import Array

log = logging.getLogger("wbc")


class TickRecorder:
    """Rows of numbers, in memory that doubles when it is full.

        recorder = TickRecorder({"t": ("s", "f8"), "q.joint1": ("rad", "f8")}, {"robot": "arm"})
        recorder.write_to(wbc.log.FileWriter(path, overwrite=True))         # where it is to be kept meanwhile
        recorder.extend(np.array([[0.0, 0.1]]))
        recorder.send()
        recorder.log()

    Args:
        columns: name -> unit and kind of number as numpy spells it: "f8", "i8", "?"; in the order of a row.
        meta: plain data. capacity: rows that there is place for at first.
    """

    def __init__(self, columns: Mapping[str, tuple[str, str]], meta: Mapping[str, Any], capacity: int = 2048) -> None:
        self._kinds = {name: kind for name, (_, kind) in columns.items()}
        self._units = {name: unit for name, (unit, _) in columns.items()}
        self._meta, self._rows, self._count = dict(meta), np.zeros((capacity, len(columns))), 0
        self._writer: LogWriter | None = None
        self._sent = 0

    def __len__(self) -> int:
        return self._count

    @property
    def rows(self) -> Array:
        """All rows so far; not a copy."""
        return self._rows[: self._count]

    def extend(self, rows: Array) -> None:
        """Rows, n x columns."""
        end = self._count + len(rows)
        while end > len(self._rows):
            self._rows = np.concatenate([self._rows, np.zeros_like(self._rows)])
        self._rows[self._count : end] = rows
        self._count = end

    def write_to(self, writer: LogWriter) -> None:
        """From now on :meth:`send` writes there, all rows from the first one on.

        Raises:
            LogFileError: it cannot be written.
        """
        sizes = dict.fromkeys(self._kinds, 1)
        self._sent = 0
        writer.begin({"sizes": sizes, "units": self._units, "kinds": self._kinds, "meta": self._meta}, {})
        self._writer = writer

    def send(self, tables: Mapping[str, np.ndarray] | None = None) -> None:
        """Write what was not written yet, and tables that are new. Where that fails, as on a full disk, one line in the
        log says so, and the run goes on without it.
        """
        if self._writer is None:
            return
        try:
            for name, values in ({} if tables is None else tables).items():
                self._writer.table(name, values)
            if self._count > self._sent:
                self._writer.write(self._rows[self._sent : self._count].tobytes())
            self._sent = self._count
        except OSError as error:
            self._leave(self._writer, error)

    def close(self) -> None:
        """Write what was not written yet, and no more; where that fails, as of :meth:`send`."""
        self.send()
        if self._writer is not None:
            try:
                self._writer.close()
            except OSError as error:
                self._leave(self._writer, error)

    def _leave(self, writer: LogWriter, error: OSError) -> None:
        log.warning("what is written of the run ends after %d ticks: %s", self._sent, error.strerror)
        writer.abandon()
        self._writer = None

    def log(self, tables: Mapping[str, np.ndarray] | None = None) -> Log:
        """What was recorded so far."""
        columns = {name: self.rows[:, k].astype(kind) for k, (name, kind) in enumerate(self._kinds.items())}
        return Log(columns, self._units, self._meta, {} if tables is None else tables)
