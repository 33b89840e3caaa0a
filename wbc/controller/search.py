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


class _Query(ctypes.Structure):
    _fields_ = [(name, ctypes.c_void_p) for name in ("starts", "chosen", "tolerance", "seeking", "settling")] + [
        (name, ctypes.c_double) for name in ("restarts", "seconds", "room", "wishes")
    ]


class _Found(ctypes.Structure):
    _fields_ = [(name, ctypes.c_double) for name in ("ending", "ticks", "descents", "seconds", "cost")]


class NativeSearch:
    """``native/converge.h`` on a tick's memory: searches from the tick's q, where the answer then is."""

    def __init__(self, tick: NativeTick) -> None:
        self._tick = tick
        self._call = tick.converge_function
        self._found = _Found()

    def run(self, query: Query) -> Found:
        """Search; keeps the interpreter lock, as a tick does."""
        arrays = (query.starts, query.chosen, query.tolerance, query.seeking, query.settling)
        numbers = (float(len(query.starts)), query.seconds, query.room, float(query.wishes))
        # of the ways to an array's address a quick one
        given = _Query(*(array.__array_interface__["data"][0] for array in arrays), *numbers)
        self._call(self._tick.pointer, ctypes.byref(given), ctypes.byref(self._found))
        f = self._found
        return Found(int(f.ending), int(f.ticks), int(f.descents), float(f.seconds), float(f.cost))
