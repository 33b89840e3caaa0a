"""Leaving a configuration in which a task is at rest because no joint serves its error."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from wbc.controller import hooks
from wbc.validation import Array

if TYPE_CHECKING:
    from wbc.controller.core import Core

#: Joints slower than this rest; how fast the way out is gone [rad/s, characteristic lengths per second]; how long [s]
_RESTS, _SPEED, _LONGEST = 1e-3, 0.2, 2.0
#: Errors below this are none [rad, characteristic lengths]
_NEAR = 1e-4


class Escape:
    """A controller's ticks with the escape of its policy; in place of ``core.call``."""

    def __init__(self, core: Core, tick: Callable[[], int]) -> None:
        self._core, self._tick = core, tick
        self._dofs = core.layout.dof_scales(core.stack)[: core.layout.nv]
        self._scales = core.layout.row_scales(core.stack)
        self._memory = core.context.memory
        self._way: Array | None = None
        self._gone, self._resets = 0.0, core.resets
        #: inputs and configuration at which there was no way out
        self._refused: tuple[bytes, Array] | None = None

    def __call__(self) -> int:
        """One tick on the buffers as they are, returns its flag."""
        core = self._core
        flag = self._tick()
        if core.resets != self._resets:
            self._way, self._refused, self._resets = None, None, core.resets
        if flag:
            self._way = None
        elif self._way is not None or self._rests():
            self._lead()
        return flag

    def _rests(self) -> bool:
        """Nothing moves, an error is left, and it is not known that there is no way out."""
        tick, memory = self._core.tick, self._memory
        if np.abs(tick.report[memory["v"]][: len(self._dofs)] / self._dofs).max(initial=0.0) > _RESTS:
            return False
        on = tick.weight > 0.0
        if not np.abs(np.where(on, tick.report[memory["error"]] / self._scales, 0.0)).max(initial=0.0) > _NEAR:
            return False
        known = self._refused
        here = (tick.p.tobytes() + tick.weight.tobytes() + tick.enabled.tobytes(), tick.q.copy())
        return known is None or known[0] != here[0] or float(np.abs(known[1] - here[1]).max(initial=0.0)) > 1e-3

    def _lead(self) -> None:
        core, tick = self._core, self._core.tick
        begins = self._way is None
        way: Array | None = hooks.escape(core.snapshot(), core.context, self._way)
        self._gone = 0.0 if begins else self._gone + float(tick.dt[0])
        if way is None or self._gone > _LONGEST or not core.fallback.lead(way, _SPEED):
            if begins or self._gone > _LONGEST:
                numbers = tick.p.tobytes() + tick.weight.tobytes() + tick.enabled.tobytes()
                self._refused = numbers, tick.q.copy()
            way = None
        self._way = way
