"""What ticks a batch: the native loop on some threads, or controllers of their own where the tick is not all native."""

from __future__ import annotations

import ctypes
import os
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from wbc.controller.compiled_stack import CompiledStack, core_of
from wbc.controller.core import Core
from wbc.tick.buffers import RELAXED, UNSOUND
from wbc.tick.native import NativeTick
from wbc.validation import Array

#: Robots from which on a second thread is worth waking
_SMALL = 64
#: Numbers in ``wbc_shared`` (``native/many.h``)
_SHARED = 32
#: What ``wbc_tick_many`` returns while robots are left (``native/many.h``)
_MORE = 2


@dataclass(frozen=True)
class Given:
    """A value that native code checks and writes (``native/many.h``).

    Attributes:
        numbers: one value, or one of each robot, contiguous. kind: what it is, see :mod:`wbc.controller.handle`.
        at: its first place in a robot's inputs. size: of one value.
    """

    numbers: Array
    kind: int
    at: int
    size: int

    @property
    def row(self) -> tuple[int, int, int, int, int]:
        """As C reads it."""
        stride = 0 if self.numbers.size == self.size else 8 * self.size
        return self.numbers.ctypes.data, stride, self.kind, self.at, self.size


def _table(given: list[Given]) -> np.ndarray:
    """Values as C reads them."""
    return np.array([value.row for value in given], np.int64).reshape(-1, 5)


class BatchEngine(Protocol):
    """Ticks all robots of a batch."""

    def fit(self, given: list[Given]) -> bool:
        """Whether all values may be written; no where native code cannot say, too."""

    def take(self, inputs: Array, given: list[Given]) -> bool:
        """Write values if all fit."""

    def tick(self, inputs: Array, reports: Array, given: list[Given]) -> bool:
        """Write values and tick each robot if all fit: ``inputs`` [count, k] in place, ``reports`` [count, m] out."""

    def forget(self) -> None:
        """The next tick starts from no active set."""


class Compiled:
    """The loop in C (``native/many.h``), in pieces for a pool of threads; the interpreter lock is released.

    A tick that its certificate or the policy hands on is done again on a controller of its own, in Python.
    """

    def __init__(self, controller: CompiledStack, count: int, threads: int) -> None:
        self._spare = core_of(controller.clone())
        tick = self._spare.tick
        assert isinstance(tick, NativeTick)
        self._tick, self._count = tick, count
        self._ticks = [tick.twin() for _ in range(threads)]
        self._busy = min(threads, -(-count // _SMALL))
        self._carried = np.zeros((count, tick.library_function("wbc_tick_carried", ctypes.c_int)()), np.intc)
        self._many, self._take, self._fit = (
            tick.library_function(name, ctypes.c_int, unlocked=True)
            for name in ("wbc_tick_many", "wbc_many_take", "wbc_many_fit")
        )
        self._resume, self._suspend = (
            tick.library_function(name, None) for name in ("wbc_tick_resume", "wbc_tick_suspend")
        )
        self._flags = np.zeros(count, np.intc)
        self._left = sum(1 << UNSOUND + flag for flag in range(UNSOUND))
        if controller.policy.conflict == "brake":
            self._left |= 1 << RELAXED
        self._pool: tuple[int, ThreadPoolExecutor] | None = None

    def _threads(self) -> ThreadPoolExecutor:
        """A pool of this process, beside its main thread: a fork has none of its parent's threads."""
        if self._pool is None or self._pool[0] != os.getpid():
            self._pool = os.getpid(), ThreadPoolExecutor(self._busy - 1, "wbc-batch")
        return self._pool[1]

    def _shared(self, work: Callable[[int, np.ndarray], bool]) -> bool:
        """What ``work`` returns, by all threads, this one among them; alone where there is too little for several.

        After an exception no thread is at work any more. ``work`` is told the number of its thread, and where all
        count.
        """
        shared = np.zeros(_SHARED, np.int64)
        if self._busy == 1:
            return work(0, shared)
        busy, pool = list[int](), self._threads()

        def run(number: int) -> bool:
            busy.append(number)
            try:
                return work(number, shared)
            finally:
                busy.pop()

        try:
            others = [pool.submit(run, number) for number in range(1, self._busy)]
            fine = work(0, shared)
            # None of them finds another answer, and those that have not begun would find nothing to do
            for other in others:
                if not other.cancel():
                    other.result()
            return fine
        except BaseException:
            # Ctrl-C: no thread may go on with memory that the next tick takes
            shared.fill(self._count)
            pool.shutdown(cancel_futures=True)
            self._pool = None
            # A thread that was being started is not known to the pool yet
            while busy:
                time.sleep(1e-3)
            raise

    def fit(self, given: list[Given]) -> bool:
        table = _table(given)
        return self._shared(lambda _, shared: bool(self._fit(*self._values(shared, table))))

    def take(self, inputs: Array, given: list[Given]) -> bool:
        table, place = _table(given), ctypes.c_void_p(inputs.ctypes.data)
        return self._shared(lambda _, shared: bool(self._take(*self._values(shared, table), place)))

    def _values(self, shared: np.ndarray, table: np.ndarray) -> tuple[ctypes._SimpleCData[Any], ...]:
        """Where threads count, the values, and how many robots there are, for C."""
        values = ctypes.c_void_p(table.ctypes.data), ctypes.c_int(len(table))
        return ctypes.c_void_p(shared.ctypes.data), *values, ctypes.c_longlong(self._count)

    def tick(self, inputs: Array, reports: Array, given: list[Given]) -> bool:
        table = _table(given)
        if not self._shared(lambda number, shared: self._run(self._ticks[number], shared, table, inputs, reports)):
            return False
        for k in np.flatnonzero((self._left >> self._flags) & 1).tolist():
            self._finish(k, inputs, reports)
        return True

    def _run(self, tick: NativeTick, shared: np.ndarray, table: np.ndarray, inputs: Array, reports: Array) -> bool:
        places = (ctypes.c_void_p(array.ctypes.data) for array in (inputs, reports, self._carried, self._flags))
        arguments = (tick.pointer, *self._values(shared, table), *places, ctypes.c_int(self._left))
        # Between calls Python has a look at signals
        while (answer := self._many(*arguments)) == _MORE:
            pass
        return bool(answer)

    def _finish(self, k: int, inputs: Array, reports: Array) -> None:
        core, carried = self._spare, ctypes.c_void_p(self._carried[k].ctypes.data)
        self._resume(self._tick.pointer, carried)
        tick_alone(core, inputs[k], reports[k])
        self._suspend(self._tick.pointer, carried)

    def forget(self) -> None:
        self._carried[:] = 0


class Clones:
    """A controller of its own for each robot, stepped in Python, one after the other."""

    def __init__(self, controller: CompiledStack, count: int) -> None:
        self._cores = [core_of(controller.clone()) for _ in range(count)]

    def fit(self, given: list[Given]) -> bool:
        return False

    def take(self, inputs: Array, given: list[Given]) -> bool:
        return False

    def tick(self, inputs: Array, reports: Array, given: list[Given]) -> bool:
        if given:
            return False
        for core, numbers, report in zip(self._cores, inputs, reports, strict=True):
            tick_alone(core, numbers, report)
        return True

    def forget(self) -> None:
        for core in self._cores:
            core.tick.reset()


def tick_alone(core: Core, given: Array, report: Array) -> None:
    """A tick of one robot with all that its policy adds."""
    state, size = core.tick.state, len(report)
    state[size:] = given
    if flag := core.call():
        core.finish(flag)
    given[:], report[:] = state[size:], state[:size]
