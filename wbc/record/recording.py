"""A recording of ticks: what every one was given and what it commanded. See :mod:`wbc.log.file`."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from wbc.log import Log, LogFile, LogFileError
from wbc.log.log import joined
from wbc.tick.outcome import STATUSES
from wbc.validation import Array, Entries

#: Version that is written
FORMAT = 3
#: Versions that are read; 2 has no names, residuals and margins
READ = (2, 3)


class RecordingError(LogFileError):
    """A recording that cannot be written or read, or that is of another stack or version."""


class Recording(LogFile):
    """A recording that was read.

        recording = wbc.Recording("run.npz")
        recording.time, recording["q"], recording["v"]         ticks x numbers
        recording.residuals["hand"], recording.margins["ball"], recording.inputs["hand.target"]
        recording.table()                                      a column a number, as for pandas.DataFrame

    ``recording[PART]`` is a part of every tick: ``q``, ``v_last``, ``v_in``, ``use_v``, ``dt``, ``p``, ``weight``,
    ``enabled``, ``bound_enabled``, ``reset`` (1: the solver had forgotten its active set), ``v`` (the command),
    ``flag``, ``error`` and ``margin`` (of all rows).

    Attributes:
        stack_pickle: the declaration; None where it could not be pickled.

    Raises:
        RecordingError: no such file, not a recording, of another format, or damaged.
    """

    error = RecordingError
    field = "recording"

    def __init__(self, path: str | os.PathLike[str]) -> None:
        super().__init__(path)
        self.stack_pickle = self.attached.get("stack.pickle")
        if self.about.get("format") not in READ:
            known = " and ".join(map(str, READ))
            reason = f"is of another format, this version reads {known}"
            raise RecordingError("recording", self.about.get("format"), reason)

    @property
    def time(self) -> Array:
        """When each tick began, from the first one on, as the sum of what their commands were for [s]."""
        dt = self["dt"][:, 0]
        return np.concatenate([np.zeros(min(1, dt.size)), np.cumsum(dt[:-1])])

    @property
    def status(self) -> tuple[str, ...]:
        """How each tick ended."""
        return tuple(str(STATUSES[int(flag)]) for flag in self["flag"][:, 0])

    @property
    def residuals(self) -> dict[str, Array]:
        """Name of a task -> its error before each tick, ticks x rows, in the units of :attr:`units`.

        Raises:
            RecordingError: it is of an older version, which kept no names, residuals and margins.
        """
        return self._by_item("residuals", "error")

    @property
    def margins(self) -> dict[str, Array]:
        """Name of a constraint with margins -> these before each tick, ticks x rows; at least 0 where they are kept.

        Raises:
            RecordingError: it is of an older version, which kept no names, residuals and margins.
        """
        return self._by_item("margins", "margin")

    @property
    def inputs(self) -> dict[str, Array]:
        """``"hand.target"`` and all other run-time inputs -> what they were in each tick, ticks x numbers; a pose is
        its rotation by columns, then its position.

        Raises:
            RecordingError: it is of an older version, which kept no names, residuals and margins.
        """
        places, p = self._names("inputs"), self["p"]
        return Entries("inputs", {f"{item}.{name}": p[:, start:stop] for item, name, start, stop, _ in places})

    @property
    def units(self) -> dict[str, str]:
        """Unit of each column of :meth:`table` that has one.

        Raises:
            RecordingError: it is of an older version, which kept no names, residuals and margins.
        """
        return {"time": "s"} | {name: unit for name, unit, _, _ in self._columns() if unit}

    def table(self) -> dict[str, Array | tuple[str, ...]]:
        """All that a reader asks for, name of a column -> one entry a tick: ``time``, ``status``, ``dt``, ``q.JOINT``,
        the command (``v.JOINT``, or ``a.JOINT``), ``residual.TASK.ROW``, ``margin.CONSTRAINT.ROW``, and
        ``TASK.INPUT``, with ``.0``, ``.1``, ... where it has several numbers.

        Raises:
            RecordingError: it is of an older version, which kept no names, residuals and margins.
        """
        parts: dict[str, Array] = {}
        out: dict[str, Array | tuple[str, ...]] = {"time": self.time, "status": self.status}
        for name, _, part, place in self._columns():
            if part not in parts:
                parts[part] = self[part]
            out[name] = parts[part][:, place]
        return out

    def log(self) -> Log:
        """The numbers of :meth:`table` as a :class:`wbc.log.Log`, with ``t`` for the time and ``flag`` for the status.

        Raises:
            RecordingError: it is of an older version, which kept no names, residuals and margins.
        """
        log = joined([log for log, _ in self.logs()], self.column_units, self.about)
        return Log({**log.columns, "flag": log["flag"].astype(int)}, log.units, log.meta)

    @property
    def column_units(self) -> dict[str, str]:
        """Column of :meth:`log` -> unit, "" for none.

        Raises:
            RecordingError: it is of an older version, which kept no names, residuals and margins.
        """
        return {"t": "s", "flag": ""} | {name: unit for name, unit, _, _ in self._columns()}

    def logs(self, wait: Callable[[], bool] | None = None) -> Iterator[tuple[Log, Array]]:
        """Each chunk in turn: its log, and its rows as they are.

        Args:
            wait: as of :meth:`wbc.log.LogFile.chunks`.

        Raises:
            RecordingError: damaged, or of an older version, which kept no names, residuals and margins.
        """
        units, time = self.column_units, 0.0
        places = {name: self.parts[part].start + place for name, _, part, place in self._columns()}
        for rows in self.chunks(wait):
            times = np.cumsum([time, *rows[:, places["dt"]]])
            time = float(times[-1])
            columns: dict[str, np.ndarray] = {"t": times[:-1], "flag": rows[:, self.parts["flag"].start].astype(int)}
            columns |= {name: rows[:, place] for name, place in places.items()}
            yield Log(columns, units, self.about), rows

    def _names(self, part: str) -> list[list[Any]]:
        """What ``about.json`` says of the numbers of a part."""
        if "names" not in self.about:
            reason = "has no names, residuals and margins, as older versions kept none; wbc.record.replayed gives them"
            raise RecordingError("recording", self.about["format"], reason)
        found: list[list[Any]] = self.about["names"][part]
        return found

    def _columns(self) -> Iterator[tuple[str, str, str, int]]:
        """(column, unit, part, place in it) of the numbers of :meth:`table`."""
        yield "dt", "s", "dt", 0
        own = {"q": "q.", "v": "v." if self.about.get("command") == "velocity" else "a.", "others": ""}
        for part, prefix in own.items():
            for place, (name, unit) in enumerate(self._names(part)):
                yield f"{prefix}{name}", unit, part, place
        for part, prefix in (("error", "residual"), ("margin", "margin")):
            for place, (item, row, unit) in enumerate(self._names(part)):
                yield f"{prefix}.{item}.{row}", unit, part, place
        for item, name, start, stop, unit in self._names("inputs"):
            for place in range(start, stop):
                yield f"{item}.{name}" + (f".{place - start}" if stop - start > 1 else ""), unit, "p", place

    def _by_item(self, field: str, part: str) -> dict[str, Array]:
        rows, numbers = self._names(part), self[part]
        return Entries(field, {item: numbers[:, [row[0] == item for row in rows]] for item, *_ in rows})
