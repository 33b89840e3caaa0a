"""Which pairs have which rows: the closest ones, and those that were close enough to stay."""

from __future__ import annotations

import numpy as np

from wbc.proximity.measured import Measured
from wbc.proximity.scene import Index
from wbc.shapes import FAR

#: A pair keeps its row until another one is closer by this share of its distance ...
KEEP_SHARE = 0.1
#: ... and by this share of the robot's characteristic length.
KEEP_LENGTH = 0.005
#: How far a distance by Coal may be off, in the same parts.
OFF = 2e-5


class Choice:
    """The closest pairs of a scene, row by row; in C ``native/choose.h``.

    A pair without a row takes one from a pair with a row only if

        distance < (1 - KEEP_SHARE) max(distance of the other, 0) + min(distance of the other, 0) - KEEP_LENGTH length,

    so that noise does not swap rows. Urgent pairs come before all others, see :mod:`wbc.proximity.missing`. A pair
    stays in its row as long as it is chosen; new pairs take the free rows, the closest the first. Where there are as
    many rows as pairs, each has the row of its number.

    Attributes:
        pairs: number of the pair of each row, -1 without.
    """

    def __init__(self, sensing: Measured, count: int, urgent: Index) -> None:
        length = sensing.scene.robot.characteristic_length
        self.sensing, self.count, self._urgent = sensing, count, urgent
        self.pairs: Index = np.full(count, -1, dtype=np.intp)
        self._slack, self._off = KEEP_LENGTH * length, OFF * length

    def update(self) -> None:
        """Measure, at the bodies' present places, what can be among the closest, and choose."""
        number = len(self.sensing.distances)
        if number <= self.count:
            self.sensing.ask(np.arange(number))
            self.pairs[:number] = np.arange(number)
            return
        has_row = np.zeros(number, dtype=bool)
        has_row[self.pairs[self.pairs >= 0]] = True
        bounds = self.sensing.bounds() - self._off
        # At first as many as there are rows, then those with rows: none that is chosen scores worse than all of these
        some = has_row.nonzero()[0] if has_row.any() else np.sort(np.argsort(bounds, kind="stable")[: self.count])
        self.sensing.ask(some)
        worst = self._scores(some, has_row).max()
        rest = (((bounds <= worst) | (self._urgent > 0)) & ~np.isin(np.arange(number), some)).nonzero()[0]
        self.sensing.ask(rest)
        self.sensing.measured += len(some)
        pairs = np.sort(np.concatenate([some, rest]))
        best = pairs[np.argsort(self._scores(pairs, has_row), kind="stable")[: self.count]]
        fresh = best[~has_row[best]]
        has_row[:] = False
        has_row[best] = True
        self.pairs[(self.pairs < 0) | ~has_row[self.pairs]] = fresh

    def _scores(self, pairs: Index, has_row: np.ndarray) -> np.ndarray:
        """Distances, less what lets a pair keep its row."""
        gaps = self.sensing.gaps(pairs)
        kept = (KEEP_SHARE * np.maximum(gaps, 0.0) + self._slack) * has_row[pairs]
        return np.asarray(gaps - FAR * self._urgent[pairs] - kept)
