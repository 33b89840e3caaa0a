"""Pairs of bodies that are measured and have no row: no command brings them nearer than a row would let them come."""

from __future__ import annotations

import logging
from collections.abc import Callable

import numpy as np

from wbc.controller.handle import Handle
from wbc.controller.policy import Fallback
from wbc.proximity.missing import INWARD, TOO_MUCH
from wbc.stack.declaration import Declaration
from wbc.stack.layout import Layout
from wbc.stack.memory import Memory
from wbc.stack.tables import brakes
from wbc.tasks.base import Sensor
from wbc.tick.buffers import BRAKED, CHAIN_BRAKED, POLICY_BRAKED, UNSOUND, Buffers
from wbc.validation import Array

log = logging.getLogger("wbc")

#: Part of its deceleration that a joint counts on in front of a margin; as in ``native/margins.h``
BRAKING_MARGIN = 0.25
#: A tick is found again at most so many times: each time what pushes keeps its row, and what comes too near has one.
ROUNDS = 8


class Watch:
    """A controller's ticks, found again until no sensed pair without a row closes faster than its row would let it.

    Where the rows are too few for what pushes, the tick brakes, or, if all that is wrong is that pairs within their
    margins open too slowly, goes on as it is; the log says either once.

    Args:
        call: one tick on the buffers as they are, returns its flag. forget: makes the next one the same tick again.
        tick: the buffers.
        fallback: what follows a tick without a certified answer.
        sensors: with the handles of their items. drifts: where in ``p`` each has the drift of its first row.
    """

    def __init__(
        self,
        call: Callable[[], int],
        forget: Callable[[], None],
        tick: Buffers,
        fallback: Fallback,
        sensors: list[tuple[Sensor, Handle]],
        drifts: list[int],
        *,
        braking: BrakingAuthority,
    ) -> None:
        self._call, self._forget, self._tick, self._fallback = call, forget, tick, fallback
        self._sensors, self._drifts, self._braking, self._said = sensors, drifts, braking, False

    def __call__(self) -> int:
        """One tick, returns its flag."""
        flag = self._found()
        for _ in range(ROUNDS):
            if flag < 0 or self._used() < TOO_MUCH:
                return flag
            self._forget()
            for sensor, handle in self._sensors:
                if handle.enabled:
                    sensor.sense(self._tick.q)
            flag = self._found()
        if flag >= 0 and (used := self._used()) >= TOO_MUCH:
            self._say()
            if used == INWARD:
                self._forget()
                # a row that no command meets: the tick brakes, and so does its replay
                self._tick.p[self._drifts] = -np.inf
                flag = self._found()
        return flag

    def _found(self) -> int:
        flag = self._call()
        return self._fallback.finish(flag) if flag > 0 and flag & UNSOUND else flag

    def _used(self) -> int:
        """The most that a pair without a row uses of what its row would allow; nothing where the tick brakes."""
        tick, braking = self._tick, self._braking
        if tick.report[braking.flag] in (BRAKED, CHAIN_BRAKED, POLICY_BRAKED):
            return 0
        v, dt, limits = tick.report[braking.v], float(tick.dt[0]), braking.limits(tick.bound_enabled)
        return max((sensor.missing(v, dt, limits) for sensor, handle in self._sensors if handle.enabled), default=0)

    def _say(self) -> None:
        if not self._said:
            names = ", ".join(repr(handle.item_name) for _, handle in self._sensors)
            log.warning("%s: more pairs push at once than have rows; give them a larger closest", names)
            self._said = True


class BrakingAuthority:
    """What margins count on: a part of the joints' accelerations in calm stacks, see docs/reach.md; else any.

    Attributes:
        v, flag: where the command and the flag are in a report.
    """

    def __init__(self, stack: Declaration, layout: Layout) -> None:
        memory = Memory(layout)
        self.v, self.flag = slice(memory["v"].start, memory["v"].start + layout.nv), memory.flag
        at, limits = brakes(stack, layout)
        self._at, self._limits = np.array(at[: layout.nv], dtype=np.intp), BRAKING_MARGIN * limits[: layout.nv]
        self._none = np.full(layout.nv, np.inf)
        self._limited = stack.calm and bool((self._at >= 0).any())

    def limits(self, bound_enabled: Array) -> Array:
        """Deceleration of each degree of freedom [nv]; infinite where it has no limit or that is off."""
        if not self._limited:
            return self._none
        return np.where((self._at >= 0) & (bound_enabled[self._at] != 0.0), self._limits, np.inf)
