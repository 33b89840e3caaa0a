"""What a driven body is told: rates over time, from a file or a function."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from wbc import validation
from wbc.errors import RangeError
from wbc.validation import Array
from wbc.walking.modes.number_table import read_numbers

#: Columns of a file of commands: time [s], speeds of the body's origin round and along [m/s], spin [rad/s]
COLUMNS = ("t", "T", "A", "spin")


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
