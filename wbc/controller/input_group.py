"""Inputs of several items that are written together in every tick, with one check."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from typing import TYPE_CHECKING

import numpy as np

from wbc.errors import NotFiniteError
from wbc.validation import Array

if TYPE_CHECKING:
    from wbc.controller.controller import Controller


class InputGroup:
    """Parts of a controller's buffer of inputs as one array; not for users, whose values :class:`Handle` checks.

    Args:
        inputs: (item, input, which of its numbers; None: all), in the order of the array. Poses are rotations by
            columns, then positions.

    Attributes:
        size: how many numbers it has. written: the last ones, None before the first.
    """

    def __init__(self, controller: Controller, inputs: Sequence[tuple[str, str, slice | None]]) -> None:
        self._controller, self._p = controller, controller.tick.p
        self._slots = [controller.layout.blocks[item].slots[name] for item, name, _ in inputs]
        self._field = ", ".join(f"{item}.{name}" for item, name, _ in inputs)
        spans = [np.arange(slot.span.start, slot.span.stop) for slot in self._slots]
        index = np.concatenate(
            [span if part is None else span[part] for span, (*_, part) in zip(spans, inputs, strict=True)]
        )
        self.size = len(index)
        whole = self.size == index[-1] - index[0] + 1 and bool((np.diff(index) == 1).all())
        # Numbers that lie side by side are written in half the time
        self._index: slice | np.ndarray = slice(int(index[0]), int(index[-1]) + 1) if whole else index
        self.written: Array | None = None

    def write(self, numbers: Array) -> None:
        """Write all numbers ``[size]``; that rotations are rotations and directions of length 1 is up to the caller.

        Raises:
            NotFiniteError: nothing is written.
        """
        if not isfinite(numbers.dot(numbers)):
            raise NotFiniteError(self._field, numbers, "expected finite numbers")
        self._p[self._index] = numbers
        if self.written is None:
            # They no longer follow the first configuration
            for slot in self._slots:
                self._controller.write(slot, self._p[slot.span].copy())
        self.written = numbers
