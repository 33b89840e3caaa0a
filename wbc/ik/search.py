"""What a search for a configuration is given and what it finds, and the search in C: one, or many on all cores."""

from __future__ import annotations

import ctypes
import functools
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from wbc.tick.native import NativeTick
from wbc.validation import Array

#: How a search ended, as in ``native/converge.h``: with a configuration that meets every tolerance
FOUND = 0
#: The same: every restart was used
EXHAUSTED = 1
#: The same: the time was used
OUT_OF_TIME = 2
#: The same: an input was refused
REFUSED = 3


@dataclass(frozen=True, eq=False)
class Query:
    """One search.

    Attributes:
        starts: configurations to start again from [restarts, nq].
        chosen: 1 where a restart takes a number of ``starts``, 0 where the first configuration's stays [nq].
        tolerance: of each task row in its unit, negative for secondary tasks [task rows].
        seeking: weights of the task rows while the goals are sought [task rows].
        settling: weights while secondary tasks are followed [task rows].
        room: how far constraints may be off at the answer, in row units.
        secondary: there are secondary tasks to follow once the goals are met.
    """

    starts: Array
    chosen: Array
    tolerance: Array
    seeking: Array
    settling: Array
    room: float
    secondary: bool


@dataclass(frozen=True)
class SearchResult:
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
        (name, ctypes.c_double) for name in ("restarts", "seconds", "room", "secondary")
    ]

    @classmethod
    def of(cls, query: Query, seconds: float) -> CQuery:
        """Points into the arrays of the query, which must outlive it; the search ends after some seconds."""
        arrays = (query.starts, query.chosen, query.tolerance, query.seeking, query.settling)
        numbers = (float(len(query.starts)), seconds, query.room, float(query.secondary))
        return cls(*(array.ctypes.data for array in arrays), *numbers)


class CFound(ctypes.Structure):
    """``wbc_found`` of ``native/converge.h``."""

    _fields_ = [(name, ctypes.c_double) for name in ("ending", "ticks", "descents", "seconds", "cost")]

    @property
    def found(self) -> SearchResult:
        """A copy."""
        return SearchResult(
            int(self.ending), int(self.ticks), int(self.descents), float(self.seconds), float(self.cost)
        )


class NativeSearch:
    """``native/converge.h`` on a tick's memory: searches from the tick's q, where the answer then is."""

    def __init__(self, tick: NativeTick) -> None:
        self._tick = tick
        self._found = CFound()
        self._query: Query | None = None

    def run(self, query: Query, seconds: float) -> SearchResult:
        """Search for some seconds; keeps the interpreter lock, as a tick does."""
        if query is not self._query:
            self._query, self._given = query, CQuery.of(query, seconds)
            self._call = functools.partial(
                self._tick.converge_function,
                self._tick.pointer,
                ctypes.byref(self._given),
                ctypes.byref(self._found),
            )
        self._given.seconds = seconds
        self._call()
        return self._found.found


def search_many(
    ticks: Sequence[NativeTick], query: Query, seconds: float, first: Array, parameters: Array
) -> tuple[Array, list[SearchResult]]:
    """Search for some seconds from each configuration [count, nq] with its run-time values [count, parameters].

    In C, with the interpreter lock released. The ticks, one a thread, have the same switches. Answers do not depend on
    how many there are.

    Returns:
        configurations [count, nq], and how each search ended.
    """
    q, p = np.ascontiguousarray(first), np.ascontiguousarray(parameters)
    found = (CFound * len(q))()
    given = CQuery.of(query, seconds)
    edges = np.linspace(0, len(q), len(ticks) + 1).astype(int)

    def run(number: int) -> None:
        start, count = int(edges[number]), int(edges[number + 1] - edges[number])
        tick = ticks[number]
        places = (q.ctypes.data + start * q.strides[0], p.ctypes.data + start * p.strides[0])
        size = ctypes.sizeof(CFound)
        tick.converge_many(
            tick.pointer,
            ctypes.byref(given),
            ctypes.c_int(count),
            *(ctypes.c_void_p(place) for place in places),
            ctypes.c_void_p(ctypes.addressof(found) + start * size),
        )

    with ThreadPoolExecutor(len(ticks)) as pool:
        list(pool.map(run, range(len(ticks))))
    return q, [f.found for f in found]
