"""What a search of a locus may take before it leaves branches open."""

from __future__ import annotations

import time

from wbc import validation
from wbc.errors import RangeError


class Budget:
    """Branches and processor time of one search; what is left over when they are spent stays open.

    Args:
        branches: looked at, at most. minutes: of processor time, from the first branch on; one branch is always ended.

    Raises:
        RangeError: numbers that are not positive.
    """

    def __init__(self, branches: int = 2000, minutes: float = 30.0) -> None:
        if branches < 1:
            raise RangeError("branches", branches, "expected at least 1")
        if validation.scalar("minutes", minutes) <= 0.0:
            raise RangeError("minutes", minutes, "expected more than 0")
        self._left, self._minutes = branches, minutes
        self._until: float | None = None

    def take(self) -> bool:
        """One branch more, if there is still something left."""
        now = time.process_time()
        if self._until is None:
            self._until = now + 60.0 * self._minutes
        if self._left <= 0 or now >= self._until:
            self.end()
            return False
        self._left -= 1
        return True

    def end(self) -> None:
        """Nothing more, as after a keyboard interrupt."""
        self._left = 0
