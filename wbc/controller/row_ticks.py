"""Ticks along rows of inputs: as many in one call of C as nobody has to look at."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc.controller.compiled_stack import CompiledStack, core_of
from wbc.controller.handle import InputGroup
from wbc.controller.step import Step
from wbc.errors import NotFiniteError
from wbc.tick.outcome import Status
from wbc.validation import Array


class RowTicks:
    """Ticks of a controller, each with a row of numbers and from where the one before led to.

    Args:
        inputs: as of :class:`~wbc.controller.handle.InputGroup`: what a row has.
        watched: an item whose rows end a run where they give way; "" for none.

    Attributes:
        most: how much a row of the item may give way [m/s]. rest: a run ends when no velocity is larger [rad/s, m/s].
    """

    def __init__(
        self, controller: CompiledStack, inputs: Sequence[tuple[str, str, slice | None]], watched: str = ""
    ) -> None:
        self._controller, core = controller, core_of(controller)
        self._group, self._core = InputGroup(core, inputs), core
        layout = core.layout
        self._rows = layout.blocks[watched].span if watched else slice(0, 0)
        self._slack = core.tick.report[core.context.memory["slack"]][self._rows]
        self.most, self.rest = np.inf, 0.0
        self._many = core.assembly.follower(self._group.places, self._rows) if layout.moves else None

    def run(self, rows: Array, q: Array) -> tuple[int, Step | None]:
        """Ticks until one needs to be looked at.

        Args:
            rows: a row a tick [ticks, numbers]. q: configurations, of which the first is given and the others are
                written [ticks + 1, nq].

        Returns:
            How many ticks are done, and the next one's step, which is solved otherwise, or whose watched rows give
            way; None without.

        Raises:
            NotFiniteError: of the rows, nothing is changed. WbcError: as of :meth:`CompiledStack.step`.
        """
        if not np.isfinite(rows).all():
            raise NotFiniteError("rows", rows, "expected finite numbers")
        done = 0
        while done < len(rows):
            if self._many is None or self._group.written is None or self._core.gate.any() or self._core.recording:
                # One that has more to do than native ticks
                self._group.write(rows[done])
                step = self._controller.step(q[done])
            else:
                first = done
                done += self._many(rows[first:], q[first:], self.most, self.rest)
                if not self._many.stopped:
                    return done, None
                step = self._controller._finished(self._many.flag, q[done])
            if step.status is not Status.SOLVED or self._pushed():
                return done, step
            q[done + 1] = step.q_next
            done += 1
            if self._at_rest():
                break
        return done, None

    @property
    def velocity_before(self) -> Array:
        """Velocity that the last tick counted accelerations from, a copy [nv]."""
        return self._core.tick.v_in[: self._core.layout.nv].copy()

    def _pushed(self) -> bool:
        return bool(self._slack.size and self._slack.max() > self.most)

    def _at_rest(self) -> bool:
        return bool(np.abs(self._core.tick.v_last[: self._core.layout.nv]).max() < self.rest)
