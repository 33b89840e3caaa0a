"""Orders from a CSV file."""

from __future__ import annotations

import csv
import os
from collections.abc import Sequence

from wbc import validation
from wbc.errors import WbcError
from wbc.teleop.order import AT_ONCE, Order

COLUMNS = ("time", "pair", *(f"r{k}" for k in range(1, AT_ONCE + 1)))


class RateFileError(WbcError):
    """A file that holds no orders; ``field`` names the line."""


class RateFile:
    """Orders at times, from a file with the columns ``time, pair, r1 ... r6``; the last line is where it ends.

        time,pair,r1,r2,r3,r4,r5,r6
        0,xi | alpha,0.02,0,0,0,0,0.005
        5,alpha | xi,0.01
        9

    An order holds until the next one; ``pair`` may be empty, and so may rates, which are then zero.

    Raises:
        RateFileError: the file cannot be read, or a line is none of these.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.orders: list[tuple[float, Order]] = []
        text = validation.text_of("path", path, RateFileError)
        try:
            lines = list(csv.reader(text.splitlines()))
        except csv.Error as error:
            raise RateFileError("path", str(path), f"cannot be read: {error}") from error
        if not lines or tuple(cell.strip() for cell in lines[0]) != COLUMNS:
            raise RateFileError("line 1", lines[0] if lines else "", f"expected the columns {','.join(COLUMNS)}")
        for number, cells in enumerate(lines[1:], start=2):
            if cells:
                self._read(f"line {number}", [cell.strip() for cell in cells])
        if not self.orders:
            raise RateFileError("path", str(path), "no orders")
        self._next = 0

    @property
    def seconds(self) -> float:
        """Time of the last line [s]."""
        return self.orders[-1][0]

    def order(self, time: float, names: Sequence[str], active: str, units: Sequence[str]) -> Order | None:
        """The latest order that is due.

        Raises:
            StopIteration: the last line's time has come. UnknownNameError: of a pair, by the session.
        """
        if time >= self.seconds:
            raise StopIteration
        found = None
        while self.orders[self._next][0] <= time:
            found = self.orders[self._next][1]
            self._next += 1
        # Between lines an order is given again and again, so that it does not become stale
        return found if found is not None else (Order(self.orders[self._next - 1][1].rates) if self._next else None)

    def _read(self, where: str, cells: list[str]) -> None:
        cells = cells + [""] * (len(COLUMNS) - len(cells))
        try:
            time = float(cells[0])
            rates = tuple(float(cell or 0.0) for cell in cells[2:])
            order = Order(rates, pair=cells[1] or None)
        except (ValueError, WbcError) as error:
            raise RateFileError(where, ",".join(cells), f"no order: {error}") from error
        if not 0.0 <= time < float("inf") or (self.orders and time <= self.orders[-1][0]):
            raise RateFileError(where, cells[0], "expected a finite time after that of the line before")
        self.orders.append((time, order))
