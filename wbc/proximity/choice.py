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
#: How much farther than the last row's pair others are watched, in the same parts: the farther the more are measured
#: in every tick, and the longer until all have to be looked at again.
WATCH = 0.05
#: How far a measured distance may be off, in the same parts.
OFF = 2e-5


class Choice:
    """The closest pairs of a scene, row by row.

    A pair without a row takes one from a pair with a row only if

        distance < (1 - KEEP_SHARE) max(distance of the other, 0) + min(distance of the other, 0) - KEEP_LENGTH length,

    so that noise does not swap rows. A pair stays in its row as long as it is chosen; new pairs take the free rows,
    the closest the first.

    Measured in every tick are the pairs with rows and the *watched* ones, which were not much farther away when all
    pairs were last looked at. All others were farther then than ``_least``; until bodies have moved so far that one of
    them can be closer than a row's pair lets it, they need not be looked at.

    Attributes:
        pairs: number of the pair of each row, -1 without.
    """

    def __init__(self, scene: Scene, count: int) -> None:
        length = scene.robot.characteristic_length
        self.scene, self.count = scene, count
        self.pairs: Index = np.full(count, -1, dtype=np.intp)
        self._every = len(scene.first) <= count
        self._slack, self._watch, self._off = KEEP_LENGTH * length, WATCH * length, OFF * length
        self._has_row = np.zeros(len(scene.first), dtype=bool)
        #: lower bounds of all distances where the scene was last settled [m]
        self._floor = np.full(len(scene.first), -np.inf)
        self._least = -np.inf

    def reset(self) -> None:
        """Forget the rows."""
        self.pairs[:] = -1
        self._has_row[:] = False
        self._floor[:] = self._least = -np.inf

    def update(self) -> bool:
        """Measure, at the bodies' present places, what can be among the closest, and choose; whether a row changed."""
        fresh = self.pairs[0] < 0
        if self._every:
            self.scene.measure()
            if not fresh:
                return False
            self.pairs[: len(self._has_row)] = np.arange(len(self._has_row))
            return True
        if fresh:
            # The bodies contain the centres of their spheres: those distances are upper bounds
            upper = self.scene.lower_bounds() + self.scene.radii
            return self._look(float(np.partition(upper, self.count - 1)[self.count - 1]))
        self.scene.measure()
        mine, others = self._mine, self._others
        worst = self._kept(mine.item(mine.argmax()))
        if others.size and others.item(others.argmin()) <= worst:
            return self._look(worst)
        # Distances below 0 may jump, see :meth:`_bounds`
        if self._least - self.scene.moved() <= max(worst, 0.0):
            return self._look(worst)
        return False

    def _kept(self, distance: float) -> float:
        """How close a pair without a row must be to take that of one at a distance [m]."""
        return distance - KEEP_SHARE * max(distance, 0.0) - self._slack

    def _bounds(self) -> Array:
        """No pair is closer than this [m]: by spheres at the present places, or by what is left of a distance that was
        known before. The latter only if positive: what :mod:`wbc.proximity.judge` declares can be below it.
        """
        bounds = self.scene.lower_bounds()
        moved = self.scene.moved_bodies()
        left = self._floor - moved[self.scene.first]
        left -= moved[self.scene.second]
        np.copyto(bounds, left, where=(left > bounds) & (left > 0.0))
        return bounds

    def _look(self, reach: float) -> bool:
        """Choose among all pairs, of which at least as many as rows score up to ``reach``; whether a row changed.

        Scores are distances, less what lets a pair keep its row.
        """
        scene, bounds = self.scene, self._bounds()
        pairs = ((bounds <= reach + self._watch) | self._has_row).nonzero()[0]
        scene.watch(pairs)
        gaps = scene.measure()
        score = gaps - (KEEP_SHARE * np.maximum(gaps, 0.0) + self._slack) * self._has_row[pairs]
        order = np.argsort(score, kind="stable")
        changed = self._assign(pairs[order[: self.count]])
        worst = self._kept(float(gaps[order[: self.count]].max()))
        self._floor[:] = bounds
        self._floor[pairs] = gaps - self._off
        far = self._floor > max(worst, 0.0) + self._watch
        far |= self._has_row
        others = (~far).nonzero()[0]
        far &= ~self._has_row
        self._least = float(self._floor[far].min(initial=np.inf))
        scene.settle()
        scene.watch(np.concatenate([self.pairs, others]))
        self._mine, self._others = scene.gaps[: self.count], scene.gaps[self.count :]
        return changed

    def _assign(self, best: Index) -> bool:
        """Give the rows to these pairs, which are sorted; whether one is new."""
        fresh = best[~self._has_row[best]]
        if not len(fresh):
            return False
        self._has_row[:] = False
        self._has_row[best] = True
        self.pairs[(self.pairs < 0) | ~self._has_row[self.pairs]] = fresh
        return True
