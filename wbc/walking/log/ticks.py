"""What the controller said of every tick, kept beside the log as ``ticks.npz``."""

from __future__ import annotations

import os
import pathlib
import zipfile
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from wbc.validation import Array
from wbc.walking.log.part import FILE, PART, Records, WalkLogError, read_part

#: Name of the file in a run's folder
TICKS = "ticks.npz"
#: A tick in ``run.part``
TICK = np.dtype([("path_time", "f8"), ("body_error", "f8"), ("slip", "f8"), ("cost", "f8"), ("solved", "?")])


@dataclass(frozen=True, eq=False)
class TickColumns:
    """n ticks; entry k belongs to the step from row k of the log to row k + 1.

    Attributes:
        path_time: u [s]. body_error: distance of the body from its command [m]. slip: of the worst held hand [m].
        cost: of the controller's tick [s]. solved: whether the controller's answer is one of all rows.
    """

    path_time: Array
    body_error: Array
    slip: Array
    cost: Array
    solved: NDArray[np.bool_]

    @classmethod
    def of(cls, records: Records) -> TickColumns:
        """From rows of the type :data:`TICK`."""
        return cls(*(np.array(records[f.name]) for f in fields(cls)))

    def records(self) -> Records:
        """As rows of the type :data:`TICK`."""
        out = np.zeros(len(self.cost), TICK)
        for f in fields(self):
            out[f.name] = getattr(self, f.name)
        return out

    def save(self, path: str | os.PathLike[str]) -> pathlib.Path:
        """Writes the columns into a folder, whole or not at all; returns the file.

        Raises:
            WalkLogError: the file cannot be written.
        """
        file = pathlib.Path(path) / TICKS
        fresh = file.with_name(f".{TICKS}")
        try:
            with fresh.open("wb") as stream:
                np.savez_compressed(stream, allow_pickle=False, **{f.name: getattr(self, f.name) for f in fields(self)})
            fresh.replace(file)
        except OSError as error:
            raise WalkLogError("path", str(path), f"cannot be written: {error.strerror}") from error
        return file

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> TickColumns:
        """What :meth:`save` wrote, from the file or its folder, or what was written while walking.

        Raises:
            WalkLogError: no such file, or not such a one.
        """
        file = pathlib.Path(path)
        if file.is_dir():
            if not (file / FILE).is_file() and (file / PART).is_file():
                chunks = [array for array in read_part(file / PART) if array.dtype == TICK]
                # The step of the last row leads to one that was not written
                return cls.of(np.concatenate([np.zeros(0, TICK), *chunks])[:-1])
            file = file / TICKS
        try:
            with np.load(file, allow_pickle=False) as data:
                return cls(*(data[f.name] for f in fields(cls)))
        except (OSError, ValueError, EOFError, KeyError, zipfile.BadZipFile) as error:
            raise WalkLogError("ticks", str(path), f"no ticks of a walk: {error}") from error
