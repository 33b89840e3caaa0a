"""Generators and closed form in C, where there is a compiler: a step takes what two calls of LAPACK by numpy take."""

from __future__ import annotations

import ctypes
import functools
import logging
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from wbc.errors import CompileError
from wbc.validation import Array

log = logging.getLogger("wbc")

#: Systems with more rows and joints than this together go to LAPACK: in C their numbers are on the stack
MOST = 100
_SOURCES = Path(__file__).parent / "native"
#: Function -> how many arrays it takes, and then three sizes
_FUNCTIONS = ("wbc_least", "wbc_coordinates", "wbc_orthogonal", "wbc_blocked")


class Generated(NamedTuple):
    """What a generator found.

    Attributes:
        vectors: [K, M]. rank: of J. order: rows of J, independent ones first. active: joints that move; those of the
            first block come first. leaving: of each further vector by blocks the joint that stands still for another.
    """

    vectors: Array
    rank: int
    order: list[int]
    active: list[int]
    leaving: list[int]


#: No joint moves the task
NONE = Generated(np.zeros((0, 0)), 0, [], [], [])


def library(size: int = 0) -> ctypes.PyDLL | None:
    """The functions for systems of so many rows and joints; None where they are too many, or without a compiler."""
    return _loaded() if size <= MOST else None


def generated(name: str, J: Array, x: Array, held: Iterable[int], free: bool) -> Generated | None:
    """By ``wbc_orthogonal`` or ``wbc_blocked``; None where numpy has to do it."""
    n, m = J.shape
    functions = library(n + m)
    if functions is None:
        return None
    still = bytearray(m)
    for joint in held:
        still[joint] = 1
    vectors, found = np.empty((m + 1, m)), np.empty(2 + 2 * m + n, dtype=np.int32)
    count = getattr(functions, name)(J, x, still, vectors, found, n, m, free)
    if count < 0:
        return None
    if count == 0:
        return NONE
    numbers = found.tolist()
    rank, rows = numbers[0], 2 + m
    further = count - rank
    leaving = numbers[rows + n : rows + n + further]
    return Generated(vectors[: further + 1], rank, numbers[rows : rows + n], numbers[2 : 2 + count], leaving)


@functools.cache
def _loaded() -> ctypes.PyDLL | None:
    """Says once in the log if there is none."""
    from wbc.native.kernel import kernel
    from wbc.native.library import load_library

    try:
        found = load_library(kernel(_SOURCES / "fsp.c"))
    except CompileError as error:
        log.warning("%s: spaces of solutions are made by numpy, which takes some 5 times as long", error)
        return None
    for name in _FUNCTIONS:
        getattr(found, name).argtypes = [ctypes.py_object] * 5 + [ctypes.c_int] * 3
    return found
