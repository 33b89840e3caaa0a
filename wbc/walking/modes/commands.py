"""What drives a body: rates over time, from a file or a function; and tables of numbers as files."""

from __future__ import annotations

import csv
import os
import pathlib
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from wbc import validation
from wbc.errors import RangeError, WbcError
from wbc.validation import Array

#: Columns of a file of commands: time [s], speeds of the body's origin round and along [m/s], spin [rad/s]
COLUMNS = ("t", "T", "A", "spin")


class NumberTableError(WbcError):
    """A table of numbers that is missing, cannot be read, or lacks what is asked for; with line and column."""


def read_numbers(path: str | os.PathLike[str], columns: Sequence[str]) -> Array:
    """Rows of finite numbers ``[n, columns]``.

    Args:
        path: ``.npz`` with an array ``[n]`` a column, else CSV: the first line names the columns, empty lines and lines
            that begin with # do not count.

    Raises:
        NumberTableError: no such file, other columns, no rows, or something that is no finite number.
    """
    file = pathlib.Path(path)
    try:
        rows = _from_npz(file, columns) if file.suffix == ".npz" else _from_csv(file, columns)
    except (OSError, ValueError, EOFError, zipfile.BadZipFile, csv.Error) as error:
        reason = validation.no_such(path, f"cannot be read: {error}")
        raise NumberTableError("file", str(path), reason) from error
    if not len(rows):
        raise NumberTableError("file", str(path), "there are no rows")
    bad = np.argwhere(~np.isfinite(rows))
    if len(bad):
        row, column = bad[0].tolist()
        raise NumberTableError(f"row {row + 1}.{columns[column]}", float(rows[row, column]), "expected a finite number")
    return rows


def _from_csv(file: pathlib.Path, columns: Sequence[str]) -> Array:
    lines = [
        (number, [cell.strip() for cell in next(csv.reader([line], skipinitialspace=True))])
        for number, line in enumerate(file.read_text().splitlines(), start=1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if not lines or lines[0][1] != list(columns):
        found = ", ".join(lines[0][1]) if lines else "nothing"
        raise NumberTableError(str(file), found, f"expected the columns {', '.join(columns)}")
    out = np.zeros((len(lines) - 1, len(columns)))
    for k, (number, cells) in enumerate(lines[1:]):
        if len(cells) != len(columns):
            raise NumberTableError(f"line {number}", ", ".join(cells), f"expected {len(columns)} numbers")
        for column, cell in enumerate(cells):
            try:
                out[k, column] = float(cell)
            except ValueError as error:
                raise NumberTableError(f"line {number}.{columns[column]}", cell, "expected a number") from error
    return out


def _from_npz(file: pathlib.Path, columns: Sequence[str]) -> Array:
    with np.load(file, allow_pickle=False) as data:
        missing = [name for name in columns if name not in data.files]
        if missing:
            raise NumberTableError(str(file), missing[0], "there is no such array", tuple(data.files))
        arrays = [np.asarray(data[name]) for name in columns]
    for name, array in zip(columns, arrays, strict=True):
        if array.dtype.kind not in "fiu" or array.shape != arrays[0].shape or array.ndim != 1:
            raise NumberTableError(name, f"{array.dtype} {array.shape}", "expected as many numbers as in the others")
    return np.stack([array.astype(float) for array in arrays], axis=1)


class Commands(Protocol):
    """Rates over time."""

    def rates(self, time: float) -> Array | None:
        """Speeds round and along [m/s] and spin [rad/s] at a time since the beginning [s]; None: it is over."""


@dataclass(frozen=True, eq=False)
class CommandTable:
    """Rates that last until the next row; with the time of the last row it is over.

    Attributes:
        times: rising ``[n]`` [s]. values: ``[n, 3]`` [m/s, m/s, rad/s].

    Raises:
        ShapeError, NotFiniteError: other arrays. RangeError: fewer than two rows, or times that do not rise.
    """

    times: Array
    values: Array

    def __post_init__(self) -> None:
        times = validation.real_array("CommandTable.times", self.times)
        if times.ndim != 1 or len(times) < 2 or (np.diff(times) <= 0.0).any():
            raise RangeError("CommandTable.times", times.tolist(), "expected at least two times that rise")
        object.__setattr__(self, "times", times)
        values = validation.real_array("CommandTable.values", self.values, (len(times), 3))
        object.__setattr__(self, "values", values)

    def rates(self, time: float) -> Array | None:
        """Of the last row that is not later; zero before the first."""
        if time >= self.times[-1] - 1e-9:
            return None
        row = int(np.searchsorted(self.times, time + 1e-9, side="right")) - 1
        return np.zeros(3) if row < 0 else self.values[row].copy()


def read_commands(path: str | os.PathLike[str]) -> CommandTable:
    """A file of commands: CSV or npz with the columns t, T, A, spin [s, m/s, m/s, rad/s].

    Raises:
        NumberTableError: it cannot be read. RangeError: fewer than two rows, or times that do not rise.
    """
    rows = read_numbers(path, COLUMNS)
    return CommandTable(rows[:, 0], rows[:, 1:])
