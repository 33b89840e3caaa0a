"""Which pairs have which rows: the closest ones, and those that were close enough to stay."""

from __future__ import annotations

import numpy as np

from wbc.proximity.memory import Index
from wbc.proximity.scene import Scene
from wbc.validation import Array

#: A pair keeps its row until another one is closer by this share of its distance ...
KEEP_SHARE = 0.1
#: ... and by this share of the robot's characteristic length.
KEEP_LENGTH = 0.005
#: How much farther than the last row's pair bounds are looked at, in the same parts: a second look costs more.
LOOK = 0.05


class Choice:
    """The closest pairs of a scene, row by row.

    A pair without a row takes one from a pair with a row only if

        distance < (1 - KEEP_SHARE) max(distance of the other, 0) + min(distance of the other, 0) - KEEP_LENGTH length,

    so that noise does not swap rows. A pair stays in its row as long as it is chosen; new pairs take the free rows,
    the closest the first.

    Attributes:
        pairs: number of the pair of each row, -1 without.
    """

    def __init__(self, scene: Scene, count: int) -> None:
        length = scene.robot.characteristic_length
        self.scene, self.count = scene, count
        self.pairs: Index = np.full(count, -1, dtype=np.intp)
        self._every = len(scene.first) <= count
        self._slack, self._look = KEEP_LENGTH * length, LOOK * length
        self._has_row = np.zeros(len(scene.first), dtype=bool)
        self._reach = -np.inf

    def reset(self) -> None:
        """Forget the rows."""
        self.pairs[:] = -1
        self._has_row[:] = False
        self._reach = -np.inf

    def update(self) -> bool:
        """Measure, at the bodies' present places, what can be among the closest, and choose; whether a row changed."""
        if not self._every:
            return self._assign(*self._closest())
        self.scene.measure(None)
        fresh = self.pairs[0] < 0
        if fresh:
            self.pairs[: len(self._has_row)] = np.arange(len(self._has_row))
        return bool(fresh)

    def _closest(self) -> tuple[Index, Array, float]:
        """Pairs that can be among the closest, their scores (distances, less what lets a pair keep its row), and the
        score of the last row.
        """
        scene = self.scene
        bounds = scene.lower_bounds()
        if self._reach == -np.inf:
            # The bodies contain the centres of their spheres: those distances are upper bounds
            self._reach = float(np.partition(bounds + scene.radii, self.count - 1)[self.count - 1])
        wanted = bounds <= self._reach
        wanted |= self._has_row
        while True:
            pairs = scene.measure(wanted)
            score, worst = self._score(pairs)
            more = bounds <= worst
            more &= ~wanted
            if not np.count_nonzero(more):
                self._reach = worst + self._look
                return pairs, score, worst
            wanted |= more

    def _score(self, pairs: Index) -> tuple[Array, float]:
        score = self.scene.results.distance[pairs]
        keeps = self._has_row[pairs]
        score -= (KEEP_SHARE * np.maximum(score, 0.0) + self._slack) * keeps
        if self.pairs[0] >= 0:
            worst = float(score[keeps].max())
            if np.count_nonzero(score <= worst) == self.count:
                return score, worst
        return score, float(np.partition(score, self.count - 1)[self.count - 1])

    def _assign(self, pairs: Index, score: Array, worst: float) -> bool:
        if self.pairs[0] >= 0 and np.count_nonzero(score <= worst) == self.count and self._holds(pairs, score, worst):
            return False
        best = pairs[np.argsort(score, kind="stable")[: self.count]]
        fresh = best[~self._has_row[best]]
        self._has_row[:] = False
        self._has_row[best] = True
        self.pairs[(self.pairs < 0) | ~self._has_row[self.pairs]] = fresh
        return len(fresh) > 0

    def _holds(self, pairs: Index, score: Array, worst: float) -> bool:
        """Whether the pairs up to the worst score are those that have rows."""
        return bool(self._has_row[pairs[score <= worst]].all())
