"""Pairs of bodies that are measured and have no row: no command brings them nearer than a row would let them come."""

from __future__ import annotations

import logging
from collections.abc import Callable

import numpy as np

from wbc.controller.policy import Fallback
from wbc.controller.sensors import MeasuredItem
from wbc.proximity.missing import INWARD, TOO_MUCH
from wbc.tick.buffers import BRAKED, CHAIN_BRAKED, POLICY_BRAKED, UNSOUND, Buffers
from wbc.tick.native import CompiledTick

log = logging.getLogger("wbc")

#: A tick is found again at most so many times: each time what pushes keeps its row, and what comes too near has one.
ROUNDS = 8


class Watch:
    """A controller's ticks, found again until no sensed pair without a row closes faster than its row would let it.

    Where the rows are too few for what pushes, the tick brakes, or, if all that is wrong is that pairs within their
    margins open too slowly, goes on as it is; the log says either once.

    Args:
        call: one tick on the buffers as they are, returns its flag. forget: makes the next one the same tick again.
        tick: the buffers. assembly: asks the sensors. flag: where the flag is in a report.
        fallback: what follows a tick without a certified answer.
    """

    def __init__(
        self,
        call: Callable[[], int],
        forget: Callable[[], None],
        tick: Buffers,
        assembly: CompiledTick,
        fallback: Fallback,
        items: list[MeasuredItem],
    ) -> None:
        self._call, self._forget, self._tick, self._fallback = call, forget, tick, fallback
        self._assembly, self._items, self._flag, self._said = assembly, items, fallback.flag, False

    def __call__(self) -> int:
        """One tick, returns its flag."""
        return self.settle(self._call())

    def settle(self, flag: int) -> int:
        """What follows a tick that ended with a flag; returns that of the last one."""
        flag = self._finished(flag)
        for _ in range(ROUNDS):
            if flag < 0 or self._used() < TOO_MUCH:
                return flag
            self._forget()
            self._assembly.sense()
            flag = self._finished(self._call())
        if flag >= 0 and (used := self._used()) >= TOO_MUCH:
            self._say()
            if used == INWARD:
                self._forget()
                # a row that no command meets: the tick brakes, and so does its replay
                self._tick.p[[item.drift for item in self._items]] = -np.inf
                flag = self._finished(self._call())
        return flag

    def _finished(self, flag: int) -> int:
        return self._fallback.finish(flag) if flag > 0 and flag & UNSOUND else flag

    def _used(self) -> int:
        """The most that a pair without a row uses of what its row would allow; nothing where the tick brakes."""
        brakes = self._tick.report[self._flag] in (BRAKED, CHAIN_BRAKED, POLICY_BRAKED)
        return 0 if brakes else self._assembly.missed()

    def _say(self) -> None:
        if not self._said:
            names = ", ".join(repr(item.handle.item_name) for item in self._items)
            log.warning("%s: more pairs push at once than have rows; give them a larger closest", names)
            self._said = True
