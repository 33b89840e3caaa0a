"""The log of a walk as it is written while walking: numpy arrays one after the other in one file, ``run.part``.

First a text with names and meta, then the table of holds, then when each hold was there (the last such table counts),
and then ticks by the chunk, each with what the controller said of them. What a program that is killed leaves ends
within an array; all before it can be read.
"""

from __future__ import annotations

import functools
import io
import os
import pathlib
import tokenize
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbc.errors import WbcError

#: Names of the files in a run's folder: while it is walked, and whole
PART, FILE = "run.part", "run.npz"
#: Longest array that is read [bytes]; a number beyond it is none that was written
LONGEST = 1 << 31

Records = NDArray[Any]


class WalkLogError(WbcError):
    """A log of a walk that is missing, cannot be read or written, or is of another format."""


class PartWriter:
    """Appends arrays to ``run.part`` in a folder, each call by one write to the file.

    Attributes:
        error: why nothing more is written, "" where all is well.

    Raises:
        WalkLogError: the file cannot be made.
    """

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        path = pathlib.Path(folder) / PART
        self.error = ""
        try:
            self._file = path.open("wb", buffering=0)
        except OSError as error:
            raise WalkLogError("path", str(path), f"cannot be written: {error.strerror}") from error

    def add(self, arrays: Sequence[Records]) -> None:
        """Write arrays. Where that fails, as on a full disk, the walk goes on, and nothing more is written."""
        if self.error:
            return
        data = b"".join(part for array in arrays for part in (_header(array.dtype, array.shape), array.tobytes()))
        try:
            if self._file.write(data) != len(data):
                self.error = "no space left"
        except OSError as error:
            self.error = str(error.strerror)

    def close(self) -> None:
        """Nothing more is written."""
        self._file.close()


def read_part(path: pathlib.Path) -> list[Records]:
    """The arrays of a file that are whole, in order.

    Raises:
        WalkLogError: the file cannot be read.
    """
    out = list[Records]()
    try:
        data = io.BytesIO(path.read_bytes())
    except OSError as error:
        raise WalkLogError("run", str(path), f"cannot be read: {error.strerror}") from error
    while True:
        try:
            begin = data.tell()
            version = np.lib.format.read_magic(data)
            if version != (1, 0):
                return out
            shape, _, dtype = np.lib.format.read_array_header_1_0(data)
            size = int(np.prod(shape, dtype=object)) * dtype.itemsize
            if dtype.hasobject or not 0 <= size <= min(LONGEST, data.getbuffer().nbytes - data.tell()):
                return out
            data.seek(begin)
            out.append(np.lib.format.read_array(data, allow_pickle=False))
        except (ValueError, EOFError, TypeError, SyntaxError, tokenize.TokenError, OverflowError):
            return out


@functools.lru_cache(maxsize=64)
def _header(dtype: np.dtype[Any], shape: tuple[int, ...]) -> bytes:
    """Made once for arrays of a kind: it would take longer than the numbers of a chunk."""
    out = io.BytesIO()
    np.lib.format.write_array_header_1_0(out, np.lib.format.header_data_from_array_1_0(np.empty(shape, dtype)))
    return out.getvalue()
