"""Runs as tables: text, and arrays of numpy."""

from __future__ import annotations

import csv
import pathlib

import numpy as np

from wbc.formats.run import Run, SeenTick
from wbc.formats.sink import Sink
from wbc.log import Log, save


class CsvSink(Sink):
    """A row a tick; the head has the units."""

    def __init__(self, path: pathlib.Path) -> None:
        self._file = path.open("x", newline="", encoding="utf-8")
        self._writer = csv.writer(self._file)

    def begin(self, run: Run) -> None:
        self._writer.writerow(f"{name} [{unit}]" if unit else name for name, unit in run.units.items())

    def write(self, log: Log, seen: list[SeenTick]) -> None:
        self._writer.writerows(zip(*(values.tolist() for values in log.columns.values()), strict=True))
        self._file.flush()

    def close(self) -> None:
        self._file.close()


class WholeSink(Sink):
    """What is written as a whole: it is kept until then, in memory."""

    def __init__(self, path: pathlib.Path) -> None:
        self._path, self._logs = path, list[Log]()

    def begin(self, run: Run) -> None:
        self._units, self._about = run.units, run.about

    def write(self, log: Log, seen: list[SeenTick]) -> None:
        self._logs.append(log)

    def whole(self) -> Log:
        """All ticks."""
        columns = {name: np.concatenate([log[name] for log in self._logs] or [np.zeros(0)]) for name in self._units}
        return Log(columns, self._units, self._about, self._logs[-1].tables if self._logs else {})


class NpzSink(WholeSink):
    """A log for :func:`wbc.log.load` and ``numpy.load``, with the same names in every run."""

    def close(self) -> None:
        save(self.whole(), self._path.parent, "npz", self._path.stem)
