"""Room between the arms of one body: capsules about upper arms, forearms, hands and necks, in the body's frame."""

from __future__ import annotations

import ctypes
from bisect import bisect_left
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking.arms.capsules import segment_distances
from wbc.walking.arms.puma import ArmKinematics
from wbc.walking.native import compiled
from wbc.walking.planner.grips.table import Grips, Ints

#: Every so many samples of a path are looked at
EVERY = 4
#: What the plan keeps of the clearance for feedback, besides the clearance itself [m]
ROOM = 0.01
#: No conflict: a sample after every path
NEVER = 1 << 40


class ArmClearance:
    """When two grips bring their arms too near to each other; answers are kept.

    Args:
        walker: its capsules and clearance. grips: over one path.

    Attributes:
        least: distances of all pairs of links but that of the necks, of arms that hold ``[15]`` [m].
    """

    def __init__(self, walker: Walker, grips: Grips) -> None:
        self._grips = grips
        self._kinematics = ArmKinematics(walker.data)  # type: ignore[arg-type]
        self._bases = np.array([arm.base.homogeneous for arm in walker.arms])
        neck, upper, fore, hand = self._kinematics.radii
        # Named points O N S E W H of an arm: capsules O-N, S-E, E-W, W-H. All pairs but that of the two necks
        self._from, self._to = [0, 2, 3, 4], [1, 3, 4, 5]
        pairs = [(i, j) for i in range(4) for j in range(4) if i or j]
        self._one, self._other = [i for i, _ in pairs], [j for _, j in pairs]
        radii = np.array([neck, upper, fore, hand])
        self.least = radii[self._one] + radii[self._other] + walker.data.clearance + ROOM  # type: ignore[union-attr]
        self._conflicts: dict[tuple[int, int], list[int]] = {}

    def prepare(self, pairs: Iterable[tuple[int, int]]) -> None:
        """Look at pairs of grips together."""
        known = self._conflicts
        todo = sorted({pair for a, b in pairs if (pair := _pair(a, b)) not in known})
        if not todo:
            return
        # Samples, multiples of EVERY, that two grips share
        table, grips = np.array(todo, dtype=np.int64), self._grips
        first = -(-grips.first[table].max(axis=1) // EVERY) * EVERY
        count = np.maximum((grips.last[table].min(axis=1) - first) // EVERY + 1, 0)
        near = self._near_along(table, first, count)
        ends = np.cumsum(count)
        for pair, start, size, end in zip(todo, first.tolist(), count.tolist(), ends.tolist(), strict=True):
            self._conflicts[pair] = (start + EVERY * np.nonzero(near[end - size : end])[0]).tolist()

    def _near_along(self, pairs: Ints, first: Ints, count: Ints) -> NDArray[np.bool_]:
        """Whether pairs of grips are too near to each other, at ``count`` samples of each one after the other."""
        grips, library = self._grips, compiled.library()
        out = np.empty(int(count.sum()), dtype=np.bool_)
        if library is not None:
            bases = compiled.packed(self._bases[grips.arm[pairs]])
            library.grips_near(
                ctypes.byref(compiled.arm(self._kinematics.data)),
                ctypes.byref(grips.table),
                ctypes.c_long(len(pairs)),
                *(compiled.at(array) for array in (pairs, bases)),
                ctypes.c_long(EVERY),
                *(compiled.at(array) for array in (first, count, self.least, out)),
            )
            return out
        which = np.repeat(np.arange(len(pairs)), count)
        samples = first[which] + EVERY * (np.arange(len(which)) - (np.cumsum(count) - count)[which])
        sides = []
        for grip in pairs[which].T:
            postures, points = grips.posture(grip, samples), np.empty((len(grip), 6, 3))
            for arm in np.unique(grips.arm[grip]):
                points[grips.arm[grip] == arm] = self.points(int(arm), postures[grips.arm[grip] == arm])
            sides.append(points)
        return self.near(sides[0], sides[1])

    def first_conflict(self, one: int, other: int, sample: int) -> int:
        """The first sample from ``sample`` on at which the arms are too near, NEVER if there is none."""
        pair = _pair(one, other)
        if pair not in self._conflicts:
            self.prepare([pair])
        found = self._conflicts[pair]
        place = bisect_left(found, sample - EVERY + 1)
        return found[place] if place < len(found) else NEVER

    def free_from(self, one: int, other: int, sample: int) -> int:
        """The first sample from ``sample`` on at which the arms are far enough from each other."""
        while (conflict := self.first_conflict(one, other, sample)) <= sample:
            sample = conflict + EVERY
        return sample

    def points(self, arm: int, postures: Array) -> Array:
        """Named points of an arm in the body's frame, ``[..., 6, 3]``."""
        base, library = self._bases[arm], compiled.library()
        if library is None:
            return np.asarray(self._kinematics.points(postures) @ base[:3, :3].T + base[:3, 3])
        out, rows = np.empty((*postures.shape[:-1], 6, 3)), compiled.packed(postures)
        library.points_of(
            ctypes.byref(compiled.arm(self._kinematics.data)),
            compiled.at(base),
            ctypes.c_long(rows.size // 6),
            compiled.at(rows),
            compiled.at(out),
        )
        return out

    def between(self, one: Array, other: Array) -> Array:
        """Least distance beyond radii and clearance of two arms given by their points ``[m, 6, 3]``: ``[m]``."""
        a, b = one[:, self._from][:, self._one], one[:, self._to][:, self._one]
        c, d = other[:, self._from][:, self._other], other[:, self._to][:, self._other]
        out: Array = (segment_distances(a, b, c, d) - self.least).min(axis=1)
        return out

    def near(self, one: Array, other: Array, less: float = 0.0) -> NDArray[np.bool_]:
        """Whether arms given by their points are nearer than radii and clearance less ``less`` [m] allow: ``[m]``."""
        least, library = self.least - less, compiled.library()
        out = np.zeros(len(one), dtype=np.bool_)
        if library is not None:
            sides = [compiled.packed(side) for side in (one, other)]
            places = [compiled.at(array) for array in (*sides, least, out)]
            library.arms_near(ctypes.c_long(len(one)), *places)
            return out
        a, b = one[:, self._from], one[:, self._to]
        c, d = other[:, self._from], other[:, self._to]
        # Capsules whose middles are far apart need no closer look
        halves = [0.5 * np.sqrt(((q - p) ** 2).sum(axis=2)) for p, q in ((a, b), (c, d))]
        gap = (0.5 * (a + b))[:, self._one] - (0.5 * (c + d))[:, self._other]
        reach = halves[0][:, self._one] + halves[1][:, self._other] + least
        row, pair = np.nonzero((gap * gap).sum(axis=2) < reach * reach)
        i, j = np.array(self._one)[pair], np.array(self._other)[pair]
        close = segment_distances(a[row, i], b[row, i], c[row, j], d[row, j]) < least[pair]
        out[row[close]] = True
        return out

    def stay_clear(self, points: Array, samples: Array, others: Ints, less: float) -> NDArray[np.bool_]:
        """Whether moving arms stay clear of arms that hold.

        Args:
            points: of moving arms in the body's frame ``[m, n, 6, 3]``. samples: at which they are there ``[m, n]``.
            others: grips that hold ``[m]``. less: as of :meth:`near`.
        """
        library, grips = compiled.library(), self._grips
        out = np.zeros(len(others), dtype=np.bool_)
        if library is None:
            postures, held = grips.between(others[:, None], samples), np.empty_like(points)
            for arm in np.unique(grips.arm[others]):
                rows = grips.arm[others] == arm
                held[rows] = self.points(int(arm), postures[rows])
            near = self.near(points.reshape(-1, 6, 3), held.reshape(-1, 6, 3), less)
            return np.asarray(~near.reshape(samples.shape).any(axis=1))
        given = [compiled.packed(array) for array in (points, samples, self._bases[grips.arm[others]])]
        places = [compiled.at(array) for array in (*given, others, self.least - less, out)]
        sizes = (ctypes.c_long(size) for size in samples.shape)
        arm = compiled.arm(self._kinematics.data)
        library.swings_clear(ctypes.byref(arm), ctypes.byref(grips.table), *sizes, *places)
        return out


def _pair(one: int, other: int) -> tuple[int, int]:
    return (one, other) if one < other else (other, one)
