"""The file of a log while it is written: ticks in chunks as they fill, and what is told of them.

The file is a zip archive without compression, so ``numpy.load`` and ``unzip`` open it:

    about.json        plain data; ``sizes``: columns of a tick, name -> how many numbers
    NAME              what else belongs to the log, as the stack of a recording
    NAME.NNNNNN.npy   a table beside the ticks, as the holds of a walk; the last one counts
    ticks.NNNNNN.npy  a chunk, one array: ticks n, number of varying columns k, their k indices, the first tick's
                      numbers (all columns), then n x k numbers of the columns that vary within the chunk

A reader takes the members one after the other and needs no directory at the end, so a file whose writer was killed
gives all its whole chunks.
"""

from __future__ import annotations

import contextlib
import errno
import io
import json
import os
import pathlib
import struct
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from wbc import validation
from wbc.errors import WbcError
from wbc.validation import Array

#: Head of a member
_LOCAL = struct.Struct("<4s5H3L2H")
#: Head of an array: mark, version, length of what is said of it
_NPY = struct.Struct("<6sBBH")
#: What is kept of a member until the directory is written: check sum, size, place in the file
_ENTRY = struct.Struct("<IQQ")
#: Length of the end of the directory [bytes]
_END = 22
#: Place for the heads of a chunk: of a member, and of an array [bytes]
HEADS = 512


class LogFileError(WbcError):
    """A log that is missing, or cannot be written or read."""


#: What is said of a file that is not complete
NOT_CLOSED = "was not closed; its last ticks may be missing"


class LogWriter(Protocol):
    """Where a recorder writes. :class:`FileWriter` is the one of files; what takes logs elsewhere, as another format or
    a stream over a network, has these methods. Those after ``begin`` may raise ``OSError``: the run goes on without it.
    """

    def begin(self, about: Mapping[str, Any], attached: Mapping[str, bytes]) -> None:
        """Comes first.

        Args:
            about: plain data, in which ``sizes`` has the columns of a tick, name -> how many numbers.
            attached: what else belongs to the log, by name.

        Raises:
            LogFileError: it cannot be written.
        """

    def table(self, name: str, values: np.ndarray) -> None:
        """Numbers that are no column, in place of the table of this name that came before."""

    def write(self, numbers: bytes | memoryview) -> None:
        """Ticks, end to end, each a row of doubles."""

    def close(self) -> None:
        """Nothing more comes."""

    def abandon(self) -> None:
        """Leave what is written as it is: another process writes it, or nobody can."""


class FileWriter:
    """A :class:`LogWriter` into a file; memory holds a short entry for each chunk that was written.

    Args:
        error: what is raised.

    Raises:
        LogFileError: there is such a file and ``overwrite`` is False, or it cannot be made.
    """

    def __init__(self, path: pathlib.Path, overwrite: bool, error: type[LogFileError] = LogFileError) -> None:
        self._path, self._error = path, error
        try:
            self._file = path.open("w+b" if overwrite else "x+b", buffering=0)
        except FileExistsError:
            raise error("path", str(path), "there is a file; choose another, or overwrite=True") from None
        except OSError as problem:
            raise error("path", str(path), f"cannot be written: {problem.strerror}") from problem
        # Bytes: of objects by thousands the interpreter would collect garbage, for milliseconds, while a loop waits
        self._members = dict[str, bytes]()
        self._counts: dict[str, int] = {}
        self._width = 0
        # A chunk as it is written, behind place for its heads: memory of its size is not asked of the system each time
        self._chunk = bytearray()

    def begin(self, about: Mapping[str, Any], attached: Mapping[str, bytes]) -> None:
        self._width = sum(about["sizes"].values())
        try:
            for name, content in ({"about.json": json.dumps(dict(about)).encode()} | dict(attached)).items():
                self._put(name, content)
        except OSError as problem:
            self.abandon()
            raise self._error("path", str(self._path), f"cannot be written: {problem.strerror}") from problem

    def table(self, name: str, values: np.ndarray) -> None:
        self._put(self._next(name), _header(values.dtype, values.shape) + values.tobytes())

    def write(self, numbers: bytes | memoryview) -> None:
        rows = np.frombuffer(numbers).reshape(-1, self._width)
        count, bits = len(rows), rows.view(np.uint64)
        varying = np.flatnonzero((bits != bits[0]).any(axis=0))
        k = len(varying)
        begin, size = 2 + k + self._width, 2 + k + self._width + count * k
        if len(self._chunk) < HEADS + 8 * size:
            self._chunk = bytearray(HEADS + 8 * size)
        packed = np.frombuffer(self._chunk, count=size, offset=HEADS)
        packed[:2], packed[2 : 2 + k], packed[2 + k : begin] = (count, k), varying, rows[0]
        # Another mode than this one copies twice
        np.take(rows, varying, axis=1, out=packed[begin:].reshape(count, k), mode="clip")
        head = _header(packed.dtype, packed.shape)
        place = HEADS - len(head)
        self._chunk[place:HEADS] = head
        self._put(self._next("ticks"), memoryview(self._chunk)[place : HEADS + 8 * size], place)

    def _next(self, name: str) -> str:
        """The member of a table that comes now."""
        count = self._counts[name] = self._counts.get(name, -1) + 1
        return f"{name}.{count:06d}.npy"

    def close(self) -> None:
        """Write the directory."""
        with zipfile.ZipFile(self._file, "a") as archive:
            archive.filelist = [_member(name, *_ENTRY.unpack(entry)) for name, entry in self._members.items()]
        self._file.close()

    def abandon(self) -> None:
        with contextlib.suppress(OSError):
            self._file.close()

    def _put(self, name: str, content: bytes | memoryview, place: int = 0) -> None:
        """A member; ``place``: where in the chunk's memory it is, behind place for its head."""
        entry = zlib.crc32(content), len(content), self._file.tell()
        head = _member(name, *entry).FileHeader(zip64=False)
        if place:
            self._chunk[place - len(head) : place] = head
            content = memoryview(self._chunk)[place - len(head) : place + len(content)]
        data = content if place else head + content
        # By one write: a program that is killed leaves it whole or not at all, and a loop waits for no other
        if self._file.write(data) != len(data):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        self._members[name] = _ENTRY.pack(*entry)


def _member(name: str, check: int, size: int, place: int) -> zipfile.ZipInfo:
    """A member of the archive, without compression."""
    out = zipfile.ZipInfo(name)
    out.CRC, out.file_size, out.compress_size, out.header_offset = check, size, size, place
    return out


def _header(kind: np.dtype[Any], shape: tuple[int, ...]) -> bytes:
    """What ``numpy.save`` writes before the numbers of an array; it would take longer than the numbers of a chunk."""
    said = repr({"descr": np.lib.format.dtype_to_descr(kind), "fortran_order": False, "shape": shape}).encode("latin1")
    # The numbers begin at a multiple of 64 bytes
    said += b" " * (-(_NPY.size + len(said) + 1) % 64) + b"\n"
    return _NPY.pack(b"\x93NUMPY", 1, 0, len(said)) + said


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


class LogFile:
    """What a :class:`FileWriter` wrote, whole or as far as it came; ticks are read when they are asked for.

    Attributes:
        path: the file. about: what ``about.json`` says. parts: places of the columns in a tick. attached: name ->
            content of what came before the first tick.

    Raises:
        LogFileError: no such file, none of these, or damaged.
    """

    #: Raised of bad files, and the field that it names
    error: type[LogFileError] = LogFileError
    field = "run"

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = validation.file_path("path", path)
        self.about: dict[str, Any] = {}
        self.attached: dict[str, bytes] = {}
        for name, content in self._members():
            if name.startswith("ticks."):
                break
            self.attached[name] = content
        with contextlib.suppress(KeyError, ValueError):
            self.about = dict(json.loads(self.attached.pop("about.json")))
        if "sizes" not in self.about:
            raise self.error(self.field, str(self.path), "this file is no recording of ticks")
        self.parts = Columns.of(self.about["sizes"])

    @property
    def complete(self) -> bool:
        """The file was closed; else its writer was killed, and what did not fill a chunk is missing."""
        with self.path.open("rb") as file:
            file.seek(-_END, os.SEEK_END)
            return file.read(4) == b"PK\x05\x06"

    def chunks(self, wait: Callable[[], bool] | None = None) -> Iterator[Array]:
        """The rows of each chunk in turn, ticks x all numbers; memory holds one chunk.

        Args:
            wait: is called where a file that is still written ends: True reads on, False ends here.

        Raises:
            LogFileError: a chunk is damaged.
        """
        for name, content in self._members(wait):
            if not name.startswith("ticks."):
                continue
            packed = np.load(io.BytesIO(content), allow_pickle=False)
            count, varying = int(packed[0]), int(packed[1])
            columns, numbers = packed[2 : 2 + varying].astype(np.intp), packed[2 + varying :]
            rows = np.tile(numbers[: self.parts.width], (count, 1))
            rows[:, columns] = numbers[self.parts.width :].reshape(count, varying)
            yield rows

    def rows(self) -> Array:
        """All ticks, ticks x all numbers."""
        return np.concatenate([np.zeros((0, self.parts.width)), *self.chunks()])

    def tables(self) -> dict[str, np.ndarray]:
        """The last table of each name.

        Raises:
            LogFileError: the file is damaged.
        """
        found = ((name.split(".")[0], content) for name, content in self._members() if name.endswith(".npy"))
        last = {name: content for name, content in found if name != "ticks"}
        return {name: np.load(io.BytesIO(content), allow_pickle=False) for name, content in last.items()}

    def __getitem__(self, name: str) -> Array:
        """A part of every tick, ticks x numbers.

        Raises:
            UnknownNameError: no such part.
        """
        validation.one_of("part", name, self.parts.slices)
        part = self.parts[name]
        return np.concatenate([np.zeros((0, part.stop - part.start)), *(rows[:, part] for rows in self.chunks())])

    def _members(self, wait: Callable[[], bool] | None = None) -> Iterator[tuple[str, bytes]]:
        """(name, content) of every whole member, in the order of the file."""
        try:
            file = self.path.open("rb")
        except OSError as error:
            reason = validation.no_such(self.path, f"cannot be read: {error.strerror}")
            raise self.error(self.field, str(self.path), reason) from error
        with file:
            start, whole = 0, True
            while whole or (wait is not None and wait()):
                file.seek(start)
                head = file.read(_LOCAL.size)
                if whole := len(head) == _LOCAL.size:
                    mark, _, _, method, _, _, check, size, plain, name_size, extra = _LOCAL.unpack(head)
                    if mark != b"PK\x03\x04":
                        return
                    name = file.read(name_size).decode("utf-8", "replace")
                    file.seek(extra, os.SEEK_CUR)
                    content = file.read(size)
                    whole = len(content) == size != 0
                elif head.startswith(b"PK\x05\x06"):
                    return
                if whole:
                    if method != 0 or size != plain or zlib.crc32(content) != check:
                        raise self.error(self.field, str(self.path), f"the part {name} is damaged")
                    start = file.tell()
                    yield name, content
