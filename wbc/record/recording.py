"""The file of a recording: what every tick was given and what it commanded, in chunks that are written as they fill.

The file is a zip archive without compression, so ``numpy.load`` and ``unzip`` open it:

    about.json      format, versions, robot, solver, back end, parts of a tick and their sizes
    stack.pickle    the declaration; absent where it could not be pickled
    ticks.NNNNNN    a chunk, one .npy array: ticks n, number of varying columns k, their k indices, the first tick's
                    numbers (all columns), then n x k numbers of the columns that vary within the chunk

A reader takes the members one after the other and needs no directory at the end, so a file whose writer was killed
gives all its whole chunks.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import pathlib
import struct
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import IO, Any

import numpy as np

from wbc import validation
from wbc.errors import WbcError
from wbc.tick.outcome import STATUSES
from wbc.validation import Array

#: Of what is written, and of what is read: 2 has no names, residuals and margins
FORMAT, READ = 3, (2, 3)
#: Bytes of a chunk, and the ticks that it has at least and at most
CHUNK, FEWEST, MOST = 1 << 18, 16, 1024
#: Head of a member, and the length of the end of the directory
_LOCAL, _END = struct.Struct("<4s5H3L2H"), 22


class RecordingError(WbcError):
    """A recording that cannot be written or read, or that is of another stack or version."""


@dataclass(frozen=True)
class Columns:
    """Places of the parts of a tick in its row of numbers."""

    slices: Mapping[str, slice]
    width: int

    @classmethod
    def of(cls, sizes: Mapping[str, int]) -> Columns:
        """Columns side by side."""
        ends = np.cumsum([0, *sizes.values()]).tolist()
        return cls({n: slice(a, b) for n, a, b in zip(sizes, ends, ends[1:], strict=False)}, ends[-1])

    def __getitem__(self, name: str) -> slice:
        return self.slices[name]


class Writer:
    """Rows into a file, chunk by chunk; memory holds one chunk and a short entry for each that was written."""

    def __init__(self, path: pathlib.Path, about: Mapping[str, Any], stack: bytes | None, overwrite: bool) -> None:
        try:
            self._file: IO[bytes] = path.open("wb" if overwrite else "xb")
        except FileExistsError:
            raise RecordingError("path", str(path), "there is a file; choose another, or overwrite=True") from None
        except OSError as error:
            raise RecordingError("path", str(path), f"cannot be written: {error.strerror}") from error
        self._archive = zipfile.ZipFile(self._file, "w")
        try:
            self._put("about.json", json.dumps(dict(about)).encode())
            if stack is not None:
                self._put("stack.pickle", stack)
        except OSError as error:
            self.abandon()
            raise RecordingError("path", str(path), f"cannot be written: {error.strerror}") from error
        self._chunks = 0
        self._width = sum(about["sizes"].values())
        #: ticks of a chunk
        self.chunk = max(FEWEST, min(MOST, CHUNK // (8 * self._width)))

    def write(self, numbers: bytes) -> None:
        """Rows of ticks, end to end, as the next chunk."""
        rows = np.frombuffer(numbers).reshape(-1, self._width)
        count, bits = len(rows), rows.view(np.uint64)
        varying = np.flatnonzero((bits != bits[0]).any(axis=0))
        packed = np.concatenate(([count, len(varying)], varying, rows[0], rows[:, varying].ravel()))
        stream = io.BytesIO()
        np.save(stream, packed, allow_pickle=False)
        self._put(f"ticks.{self._chunks:06d}.npy", stream.getvalue())
        self._chunks += 1

    def close(self) -> None:
        """Write the directory."""
        self._archive.close()
        self._file.close()

    def abandon(self) -> None:
        """Leave the file as it is: another process writes it, or nobody can."""
        self._archive.fp = None
        with contextlib.suppress(OSError):
            self._file.close()

    def _put(self, name: str, content: bytes) -> None:
        self._archive.writestr(zipfile.ZipInfo(name), content)
        self._file.flush()


class Recording:
    """A recording that was read.

        recording = wbc.Recording("run.npz")
        recording.time, recording["q"], recording["v"]         ticks x numbers
        recording.residuals["hand"], recording.margins["ball"], recording.inputs["hand.target"]
        recording.table()                                      a column a number, as for pandas.DataFrame

    Attributes:
        about: what ``about.json`` says.

    Raises:
        RecordingError: no such file, not a recording, of another format, or damaged.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = validation.file_path("path", path)
        self.stack_pickle: bytes | None = None
        self.about: dict[str, Any] = {}
        for name, content in self._members():
            if name == "about.json":
                self.about = json.loads(content)
            elif name == "stack.pickle":
                self.stack_pickle = content
            else:
                break
        if "format" not in self.about:
            raise RecordingError("recording", str(self.path), "this file is no recording of ticks")
        if self.about["format"] not in READ:
            known = " and ".join(map(str, READ))
            raise RecordingError("recording", self.about["format"], f"is of another format, this version reads {known}")
        self.parts = Columns.of(self.about["sizes"])

    @property
    def complete(self) -> bool:
        """The file was closed; else its writer was killed, and what did not fill a chunk is missing."""
        with self.path.open("rb") as file:
            file.seek(-_END, os.SEEK_END)
            return file.read(4) == b"PK\x05\x06"

    def chunks(self) -> Iterator[Array]:
        """The rows of each chunk in turn, ticks x all numbers; memory holds one chunk.

        Raises:
            RecordingError: a chunk is damaged.
        """
        for name, content in self._members():
            if not name.startswith("ticks."):
                continue
            packed = np.load(io.BytesIO(content), allow_pickle=False)
            count, varying = int(packed[0]), int(packed[1])
            columns = packed[2 : 2 + varying].astype(np.intp)
            first, values = (
                packed[2 + varying : 2 + varying + self.parts.width],
                packed[2 + varying + self.parts.width :],
            )
            rows = np.tile(first, (count, 1))
            rows[:, columns] = values.reshape(count, varying)
            yield rows

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
        return self._by_item("error")

    @property
    def margins(self) -> dict[str, Array]:
        """Name of a constraint with margins -> these before each tick, ticks x rows; at least 0 where they are kept.

        Raises:
            RecordingError: it is of an older version, which kept no names, residuals and margins.
        """
        return self._by_item("margin")

    @property
    def inputs(self) -> dict[str, Array]:
        """``"hand.target"`` and all other run-time inputs -> what they were in each tick, ticks x numbers; a pose is
        its rotation by columns, then its position.

        Raises:
            RecordingError: it is of an older version, which kept no names, residuals and margins.
        """
        places, p = self._names("inputs"), self["p"]
        return {f"{item}.{name}": p[:, start:stop] for item, name, start, stop, _ in places}

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

    def _names(self, part: str) -> list[list[Any]]:
        """What ``about.json`` says of the numbers of a part.

        Raises:
            RecordingError: the recording is of an older version, which kept no names, residuals and margins.
        """
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

    def _by_item(self, part: str) -> dict[str, Array]:
        rows, numbers = self._names(part), self[part]
        return {item: numbers[:, [row[0] == item for row in rows]] for item, *_ in rows}

    def __getitem__(self, name: str) -> Array:
        """A part of every tick: ``q``, ``v_last``, ``v_in``, ``use_v``, ``dt``, ``p``, ``weight``, ``enabled``,
        ``bound_enabled``, ``reset`` (1: the solver had forgotten its active set), ``v`` (the command), ``flag``,
        ``error`` and ``margin`` (of all rows).

        Raises:
            UnknownNameError: no such part.
        """
        validation.one_of("part", name, self.parts.slices)
        part = self.parts[name]
        return np.concatenate([np.zeros((0, part.stop - part.start)), *(rows[:, part] for rows in self.chunks())])

    def _members(self) -> Iterator[tuple[str, bytes]]:
        """(name, content) of every whole member, in the order of the file."""
        try:
            file = self.path.open("rb")
        except OSError as error:
            reason = validation.no_such(self.path, f"cannot be read: {error.strerror}")
            raise RecordingError("recording", str(self.path), reason) from error
        with file:
            while len(head := file.read(_LOCAL.size)) == _LOCAL.size:
                mark, _, _, method, _, _, check, size, plain, name_size, extra = _LOCAL.unpack(head)
                if mark != b"PK\x03\x04":
                    return
                name = file.read(name_size).decode("utf-8", "replace")
                file.seek(extra, os.SEEK_CUR)
                content = file.read(size)
                # The sizes of a member are written last
                if len(content) < size or size == 0:
                    return
                if method != 0 or size != plain or zlib.crc32(content) != check:
                    raise RecordingError("recording", str(self.path), f"the part {name} is damaged")
                yield name, content
