"""Inverse kinematics for many targets on all cores: a search each, in C, with the interpreter lock released."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from wbc.controller.native import NativeTick
from wbc.controller.search import CFound, CQuery, Found, Query
from wbc.validation import Array


def search_many(
    ticks: Sequence[NativeTick], query: Query, seconds: float, first: Array, parameters: Array
) -> tuple[Array, list[Found]]:
    """Search for some seconds from each configuration [count, nq] with its run-time values [count, parameters].

    The ticks, one a thread, have the same switches. Answers do not depend on how many there are.

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
