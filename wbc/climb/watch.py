"""How far planning is, and when it has to end."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

#: Time between two reports of how far it is [s]
TOLD_EVERY = 0.25


class PlanWatch:
    """The clock of one plan, which begins when this is made.

    Args:
        seconds: time that planning may take at most [s].
        told: is called with what was done so far, some times a second; what it raises ends planning.
    """

    def __init__(self, seconds: float = np.inf, told: Callable[[str], None] | None = None) -> None:
        self._told, self._next = told, 0.0
        self._until = time.monotonic() + seconds

    @property
    def passed(self) -> bool:
        """Whether the time is over."""
        return time.monotonic() > self._until

    def look(self, text: Callable[[], str]) -> None:
        """Reports what was done so far, if that is due."""
        if self._told is not None and (now := time.monotonic()) >= self._next:
            self._next = now + TOLD_EVERY
            self._told(text())
