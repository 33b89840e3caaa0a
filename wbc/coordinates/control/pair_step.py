"""What a tick of a pair returns."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from wbc.controller import Status, Step
from wbc.coordinates.control.rank_loss import Condition
from wbc.tick.context import Context


class PairStep(Step):
    """A :class:`wbc.Step` that says, too, which rank the active pair loses within 0.02 rad of where it was taken."""

    __slots__ = ("_condition",)

    def __init__(self, data: bytes, context: Context, condition: Callable[[], Condition]) -> None:
        super().__init__(data, context)
        self._condition: Condition | Callable[[], Condition] = condition

    @property
    def condition(self) -> Condition:
        """As the adviser has it for the pair and the configuration of this tick."""
        if not isinstance(self._condition, Condition):
            self._condition = self._condition()
        return self._condition

    @property
    def ended(self) -> Status:
        """How the tick ended, wherever it was."""
        return super().status

    @property
    def status(self) -> Status:
        """:attr:`ended`, or :attr:`condition` where the tick is solved near a locus of the pair: ``algorithmic``,
        ``task`` or ``constraint``.
        """
        if self.ended is not Status.SOLVED or self.condition is Condition.REGULAR:
            return self.ended
        return Status(self.condition.value)

    def __reduce__(self) -> tuple[Any, ...]:
        return _again, (self._data, self._context, self.condition)


def _again(data: bytes, context: Context, condition: Condition) -> PairStep:
    return PairStep(data, context, lambda: condition)
