"""Many ticks in one call of C, each with its row of inputs and from where the one before led to."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np

from wbc.validation import Array


class _FollowStruct(ctypes.Structure):
    """``wbc_follow`` of ``native/follow.h``."""

    _fields_ = [
        ("cycle", ctypes.c_void_p), ("at", ctypes.c_void_p),
        *((name, ctypes.c_longlong) for name in ("numbers", "first", "end")),
        *((name, ctypes.c_double) for name in ("most", "rest")),
        *((name, ctypes.c_int) for name in ("flag", "stopped")),
    ]  # fmt: skip


class RowFollower:
    """What ticks along rows.

    Args:
        function: ``wbc_tick_follow``. cycle: address of a ``wbc_cycle``. places: where each number of a row goes in
            ``p``. rows: general rows that are watched.

    Attributes:
        flag: of the last tick. stopped: it has a flag, misses a pair or its watched rows give way: it is not counted.
    """

    def __init__(self, function: Any, cycle: int, places: np.ndarray, rows: slice) -> None:
        self._function, self._places = function, np.ascontiguousarray(places, np.intc)
        self._function.restype = ctypes.c_longlong
        self._struct = _FollowStruct(
            cycle=cycle, at=self._places.ctypes.data, numbers=len(places), first=rows.start, end=rows.stop
        )
        self._at = ctypes.byref(self._struct)

    def __call__(self, rows: Array, q: Array, most: float, rest: float) -> int:
        """How many ticks are done; arguments as of :meth:`wbc.controller.row_ticks.RowTicks.run`, arrays in a row."""
        self._struct.most, self._struct.rest = most, rest
        at = ctypes.c_void_p
        return int(self._function(self._at, at(rows.ctypes.data), ctypes.c_longlong(len(rows)), at(q.ctypes.data)))

    @property
    def flag(self) -> int:
        return int(self._struct.flag)

    @property
    def stopped(self) -> bool:
        return bool(self._struct.stopped)
