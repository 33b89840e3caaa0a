"""What a search of a locus may take before it leaves branches open."""

from __future__ import annotations

import os
import time

from wbc import validation
from wbc.errors import RangeError


class Budget:
    """Branches and time of one search; what is left over when they are spent stays open.

    Args:
        branches: looked at, at most. minutes: by the clock, from :meth:`start` or the first branch on.

    Raises:
        RangeError: numbers that are not positive.
    """

    def __init__(self, branches: int = 2000, minutes: float = 30.0) -> None:
        branches = validation.integer("branches", branches, low=1)
        if validation.scalar("minutes", minutes) <= 0.0:
            raise RangeError("minutes", minutes, "expected more than 0")
        self._left, self.minutes = branches, minutes
        self._until: float | None = None

    def start(self) -> None:
        """The clock starts, if it has not yet."""
        if self._until is None:
            self._until = time.monotonic() + 60.0 * self.minutes

    def part(self, share: float) -> Budget:
        """A budget of the first part of the time that is left, with as many branches."""
        share = validation.scalar("share", share, low=0.0, high=1.0)
        first = Budget(self._left, self.minutes)
        first._until = time.monotonic() + share * self.seconds
        return first

    @property
    def seconds(self) -> float:
        """What is left of the time, at least 0."""
        self.start()
        assert self._until is not None
        return max(0.0, self._until - time.monotonic())

    def take(self) -> bool:
        """One branch more, if there is still something left."""
        if self._left <= 0 or self.seconds <= 0.0:
            self.end()
            return False
        self._left -= 1
        return True

    def end(self) -> None:
        """Nothing more, as after a keyboard interrupt."""
        self._left = 0


def processor_seconds() -> float:
    """Processor time so far of this process with all its threads and of its children that have ended."""
    return sum(os.times()[:4])
