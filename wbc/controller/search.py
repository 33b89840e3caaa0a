"""What a search for a configuration is given and what it finds, and the search in C."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass

from wbc.controller.native import NativeTick
from wbc.validation import Array

#: How a search ended, as in ``native/converge.h``
FOUND, EXHAUSTED, OUT_OF_TIME, REFUSED = 0, 1, 2, 3


@dataclass(frozen=True, eq=False)
class Query:
    """One search.

    Attributes:
        starts: configurations to start again from [restarts, nq].
        chosen: 1 where a restart takes a number of ``starts``, 0 where the first configuration's stays [nq].
        tolerance: of each task row in its unit, negative for wishes [task rows].
        seeking: weights of the task rows while the goals are sought [task rows].
        settling: weights while wishes are followed [task rows].
        seconds: until the search ends.
        room: how far constraints may be off at the answer, in row units.
        wishes: there are wishes to follow once the goals are met.
    """

    starts: Array
    chosen: Array
    tolerance: Array
    seeking: Array
    settling: Array
    seconds: float
    room: float
    wishes: bool


@dataclass(frozen=True)
class Found:
    """How a search ended: :data:`FOUND` and so on, ticks, descents that came to their end, time [s], and the weighted
    square of the goals' errors (infinite where no configuration kept the constraints).
    """

    ending: int
    ticks: int
    descents: int
    seconds: float
    cost: float


class CQuery(ctypes.Structure):
    """``wbc_search`` of ``native/converge.h``."""

    _fields_ = [(name, ctypes.c_void_p) for name in ("starts", "chosen", "tolerance", "seeking", "settling")] + [
        (name, ctypes.c_double) for name in ("restarts", "seconds", "room", "wishes")
    ]

    @classmethod
    def of(cls, query: Query) -> CQuery:
        """Points into the arrays of the query, which must outlive it."""
        arrays = (query.starts, query.chosen, query.tolerance, query.seeking, query.settling)
        numbers = (float(len(query.starts)), query.seconds, query.room, float(query.wishes))
        # of the ways to an array's address a quick one
        return cls(*(array.__array_interface__["data"][0] for array in arrays), *numbers)


class CFound(ctypes.Structure):
    """``wbc_found`` of ``native/converge.h``."""

    _fields_ = [(name, ctypes.c_double) for name in ("ending", "ticks", "descents", "seconds", "cost")]

    @property
    def found(self) -> Found:
        """A copy."""
        return Found(int(self.ending), int(self.ticks), int(self.descents), float(self.seconds), float(self.cost))


class NativeSearch:
    """``native/converge.h`` on a tick's memory: searches from the tick's q, where the answer then is."""

    def __init__(self, tick: NativeTick) -> None:
        self._tick = tick
        self._found = CFound()

    def run(self, query: Query) -> Found:
        """Search; keeps the interpreter lock, as a tick does."""
        given = CQuery.of(query)
        self._tick.converge_function(self._tick.pointer, ctypes.byref(given), ctypes.byref(self._found))
        return self._found.found
