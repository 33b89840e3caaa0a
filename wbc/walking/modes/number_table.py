"""Tables of numbers with named columns, from CSV and npz files."""

from __future__ import annotations

import csv
import os
import pathlib
import zipfile
from collections.abc import Sequence

import numpy as np

from wbc.errors import WbcError
from wbc.validation import Array


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
        raise NumberTableError("file", str(path), f"cannot be read: {error}") from error
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
