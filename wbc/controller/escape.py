"""Leaving a configuration in which a task is at rest because no joint serves its error."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from wbc import explain
from wbc.controller.policy import Fallback
from wbc.tick.buffers import Buffers
from wbc.tick.context import Context
from wbc.validation import Array

#: Joints slower than this rest [rad/s, characteristic lengths per second]
_RESTS = 1e-3
#: Speed along the way out [rad/s, characteristic lengths per second]
_SPEED = 0.2
#: How long a way out takes at most [s]
_LONGEST = 2.0
#: Moved by this, another configuration may have a way out [rad, m]
_MOVED = 1e-3
#: Errors below this are none [rad, characteristic lengths]
_NEAR = 1e-4


class Escape:
    """A controller's ticks with the escape of its policy.

    Args:
        call: one tick on the buffers as they are, returns its flag.
        snapshot: a copy of the buffers.
    """

    def __init__(
        self,
        call: Callable[[], int],
        tick: Buffers,
        fallback: Fallback,
        context: Context,
        snapshot: Callable[[], bytes],
    ) -> None:
        self._call, self._tick, self._fallback, self._context, self._snapshot = call, tick, fallback, context, snapshot
        self._dofs = context.layout.dof_scales(context.stack)[: context.nv]
        self._scales = context.layout.row_scales(context.stack)
        self.reset()

    def reset(self) -> None:
        """Forget the way and where there was none."""
        self._way: Array | None = None
        self._gone = 0.0
        #: inputs and configuration at which there was no way out
        self._refused: tuple[bytes, Array] | None = None

    def __call__(self) -> int:
        """One tick, returns its flag."""
        flag = self._call()
        if flag:
            self._way = None
        elif self._way is not None or self._rests():
            self._lead()
        return flag

    def _inputs(self) -> bytes:
        return b"".join(part.tobytes() for part in (self._tick.p, self._tick.weight, self._tick.enabled))

    def _rests(self) -> bool:
        """Nothing moves, an error is left, and it is not known that there is no way out."""
        tick, memory = self._tick, self._context.memory
        if np.abs(tick.report[memory["v"]][: len(self._dofs)] / self._dofs).max(initial=0.0) > _RESTS:
            return False
        off = np.where(tick.weight > 0.0, tick.report[memory["error"]] / self._scales, 0.0)
        if not np.abs(off).max(initial=0.0) > _NEAR:
            return False
        known = self._refused
        return known is None or known[0] != self._inputs() or float(np.abs(known[1] - tick.q).max(initial=0.0)) > _MOVED

    def _lead(self) -> None:
        before = self._way
        way = explain.escape(self._snapshot(), self._context, before)
        self._gone = 0.0 if before is None else self._gone + float(self._tick.dt[0])
        late = self._gone > _LONGEST
        if way is None or late or not self._fallback.lead(way, _SPEED):
            if before is None or late:
                self._refused = self._inputs(), self._tick.q.copy()
            way = None
        self._way = way
