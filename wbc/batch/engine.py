"""What ticks a batch: the native loop on some threads, or controllers of their own where the tick is not all native."""

from __future__ import annotations

import ctypes
import os
import time
from concurrent.futures import ThreadPoolExecutor
from typing import Protocol

import numpy as np

from wbc.controller import Controller, core_of
from wbc.controller.core import Core
from wbc.controller.tick.buffers import RELAXED, UNSOUND
from wbc.controller.tick.native import NativeTick
from wbc.validation import Array

#: Robots that a thread takes at a time
_CHUNK = 64


class Engine(Protocol):
    """Ticks all robots of a batch."""

    def tick(self, inputs: Array, reports: Array) -> None:
        """One tick of each robot: ``inputs`` [count, k] in place, ``reports`` [count, m] out."""

    def forget(self) -> None:
        """The next tick starts from no active set."""


class Compiled:
    """The loop in C (``native/many.h``), in pieces for a pool of threads; the interpreter lock is released.

    A tick that its certificate or the policy hands on is done again on a controller of its own, in Python.
    """

    def __init__(self, controller: Controller, count: int, threads: int) -> None:
        self._spare = core_of(controller.clone())
        tick = self._spare.tick
        assert isinstance(tick, NativeTick)
        self._tick, self._count = tick, count
        self._ticks = [tick.twin() for _ in range(threads)]
        size = int(tick.library_function("wbc_tick_carried_size", ctypes.c_longlong)())
        self._carried = np.zeros((count, size), np.uint8)
        self._many = tick.library_function("wbc_tick_many", None, unlocked=True)
        self._resume, self._suspend = (
            tick.library_function(name, None) for name in ("wbc_tick_resume", "wbc_tick_suspend")
        )
        self._flags = np.zeros(count, np.intc)
        self._left = sum(1 << UNSOUND + flag for flag in range(UNSOUND))
        if controller.policy.conflict == "brake":
            self._left |= 1 << RELAXED
        self._pool: tuple[int, ThreadPoolExecutor] | None = None

    def _threads(self) -> ThreadPoolExecutor:
        """A pool of this process: a fork has none of its parent's threads."""
        if self._pool is None or self._pool[0] != os.getpid():
            self._pool = os.getpid(), ThreadPoolExecutor(len(self._ticks), "wbc-batch")
        return self._pool[1]

    def tick(self, inputs: Array, reports: Array) -> None:
        chunk = max(_CHUNK, -(-self._count // (4 * len(self._ticks))))
        starts = list(range(0, self._count, chunk))
        if len(self._ticks) == 1 or len(starts) == 1:
            self._run(self._ticks[0], inputs, reports, 0, self._count)
        else:
            idle = list(self._ticks)

            def run(start: int) -> None:
                tick = idle.pop()
                try:
                    self._run(tick, inputs, reports, start, min(chunk, self._count - start))
                finally:
                    idle.append(tick)

            pool = self._threads()
            try:
                list(pool.map(run, starts))
            except BaseException:
                # Ctrl-C: no thread may go on with memory that the next tick takes
                pool.shutdown(cancel_futures=True)
                self._pool = None
                # A thread that was being started is not known to the pool yet
                while len(idle) < len(self._ticks):
                    time.sleep(1e-3)
                raise
        for k in np.flatnonzero((self._left >> self._flags) & 1).tolist():
            self._finish(k, inputs, reports)

    def _run(self, tick: NativeTick, inputs: Array, reports: Array, start: int, count: int) -> None:
        places = (array[start:].ctypes.data for array in (inputs, reports, self._carried, self._flags))
        self._many(tick.pointer, ctypes.c_longlong(count), *map(ctypes.c_void_p, places), ctypes.c_int(self._left))

    def _finish(self, k: int, inputs: Array, reports: Array) -> None:
        core, carried = self._spare, ctypes.c_void_p(self._carried[k].ctypes.data)
        self._resume(self._tick.pointer, carried)
        tick_alone(core, inputs[k], reports[k])
        self._suspend(self._tick.pointer, carried)

    def forget(self) -> None:
        self._carried[:] = 0


class Clones:
    """A controller of its own for each robot, stepped in Python, one after the other."""

    def __init__(self, controller: Controller, count: int) -> None:
        self._cores = [core_of(controller.clone()) for _ in range(count)]

    def tick(self, inputs: Array, reports: Array) -> None:
        for core, given, report in zip(self._cores, inputs, reports, strict=True):
            tick_alone(core, given, report)

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
