"""Distances between the arms of one body, whose links are capsules, in the body's frame; and which grips conflict."""

from __future__ import annotations

import ctypes
from bisect import bisect_left
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from wbc.geometry import segment_distances
from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking.arms.puma import limb_of
from wbc.walking.native import compiled
from wbc.walking.planner.around import FINELY
from wbc.walking.planner.grips.table import Grips, Ints

#: Every so many samples of a path are looked at
EVERY = 2
#: No conflict: a sample after every path
NEVER = 1 << 40

Flags = NDArray[np.bool_]


class LimbShapes:
    """The capsules of the arms of one body, and their distances from each other.

    Args:
        walker: its limbs, clearance and margins.

    Attributes:
        limb: kinematics of an arm. bases: of the arms in the body ``[arms, 4, 4]`` [m].
        least: distances of pairs of links, of arms that hold ``[pairs]`` [m]: radii, clearance and margin. Two links
            that no joint moves are no pair.
    """

    def __init__(self, walker: Walker) -> None:
        self.limb = limb = limb_of(walker)
        self.bases = np.array([arm.base.homogeneous for arm in walker.arms])
        self._from, self._to = ([link[end] for link in limb.links] for end in (0, 1))
        count = len(limb.links)
        pairs = [(i, j) for i in range(count) for j in range(count) if max(i, j) >= limb.still]
        self._one, self._other = [i for i, _ in pairs], [j for _, j in pairs]
        radii = np.array(limb.radii)
        self.least: Array = radii[self._one] + radii[self._other] + walker.arm_data.clearance
        self.least = self.least + walker.margins.held_clearance

    def points(self, arm: int, postures: Array) -> Array:
        """Named points of an arm in the body's frame, ``[..., points, 3]``."""
        base, limb = self.bases[arm], self.limb
        library = compiled.library_for(limb)
        if library is None:
            return np.asarray(limb.points(postures) @ base[:3, :3].T + base[:3, 3])
        out, rows = np.empty((*postures.shape[:-1], 6, 3)), compiled.packed(postures)
        library.points_of(
            compiled.arm_of(limb), compiled.at(base), ctypes.c_long(rows.size // 6), compiled.at(rows), compiled.at(out)
        )
        return out

    def points_of(self, arms: Ints, postures: Array) -> Array:
        """The same of many arms (rows ``[m]``), ``[m, ..., joints]`` each."""
        count = 1 + max(max(link) for link in self.limb.links)
        out = np.empty((*postures.shape[:-1], count, 3))
        for arm in np.unique(arms):
            out[arms == arm] = self.points(int(arm), postures[arms == arm])
        return out

    def between(self, one: Array, other: Array) -> Array:
        """Least distance beyond radii and clearance of two arms given by their points ``[m, points, 3]``: ``[m]``."""
        arms = (one, self._one), (other, self._other)
        ends = [p[:, at][:, link] for p, link in arms for at in (self._from, self._to)]
        out: Array = (segment_distances(*ends) - self.least).min(axis=1)
        return out

    def near(self, one: Array, other: Array, less: float | Array = 0.0) -> Flags:
        """Whether arms given by their points are nearer than radii and clearance less ``less`` [m], for all or each,
        allow: ``[m]``.
        """
        alike = isinstance(less, float)
        least, library = self.least - np.reshape(less, (-1, 1)), compiled.library_for(self.limb) if alike else None
        out = np.zeros(len(one), dtype=np.bool_)
        if library is not None:
            given = [compiled.packed(points) for points in (one, other)]
            library.arms_near(ctypes.c_long(len(one)), *(compiled.at(array) for array in (*given, least, out)))
            return out
        a, b = one[:, self._from], one[:, self._to]
        c, d = other[:, self._from], other[:, self._to]
        # Capsules whose middles are far apart need no closer look
        halves = [0.5 * np.sqrt(((q - p) ** 2).sum(axis=2)) for p, q in ((a, b), (c, d))]
        gap = (0.5 * (a + b))[:, self._one] - (0.5 * (c + d))[:, self._other]
        reach = halves[0][:, self._one] + halves[1][:, self._other] + least
        row, pair = np.nonzero((gap * gap).sum(axis=2) < reach * reach)
        i, j = np.array(self._one)[pair], np.array(self._other)[pair]
        each = np.broadcast_to(least, reach.shape)[row, pair]
        close = segment_distances(a[row, i], b[row, i], c[row, j], d[row, j]) < each
        out[row[close]] = True
        return out


class ArmClearance:
    """When two grips bring their arms too near to each other; answers are cached.

    Args:
        walker: see :class:`LimbShapes`. grips: over one path.

    Attributes:
        shapes: of the arms.
    """

    def __init__(self, walker: Walker, grips: Grips) -> None:
        self._grips, self.shapes = grips, LimbShapes(walker)
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

    def _near_along(self, pairs: Ints, first: Ints, count: Ints) -> Flags:
        """Whether pairs of grips are too near to each other, at ``count`` samples of each one after the other."""
        grips, shapes = self._grips, self.shapes
        out, library = np.empty(int(count.sum()), dtype=np.bool_), compiled.library_for(shapes.limb)
        if library is not None:
            bases = compiled.packed(shapes.bases[grips.arm[pairs]])
            library.grips_near(
                compiled.arm_of(shapes.limb),
                ctypes.byref(grips.table),
                ctypes.c_long(len(pairs)),
                *(compiled.at(array) for array in (pairs, bases)),
                ctypes.c_long(EVERY),
                *(compiled.at(array) for array in (first, count, shapes.least, out)),
            )
            return out
        which = np.repeat(np.arange(len(pairs)), count)
        samples = first[which] + EVERY * (np.arange(len(which)) - (np.cumsum(count) - count)[which])
        one, other = (shapes.points_of(grips.arm[grip], grips.posture(grip, samples)) for grip in pairs[which].T)
        return shapes.near(one, other)

    def first_conflict(self, one: int, other: int, sample: int) -> int:
        """The first sample from ``sample`` on at which the arms are too near, NEVER if there is none."""
        pair = (one, other) if one < other else (other, one)
        found = self._conflicts.get(pair)
        if found is None:
            self.prepare([pair])
            found = self._conflicts[pair]
        if not found:
            return NEVER
        place = bisect_left(found, sample - EVERY + 1)
        return found[place] if place < len(found) else NEVER

    def free_from(self, one: int, other: int, sample: int) -> int:
        """The first sample from ``sample`` on at which the arms are far enough from each other."""
        while (conflict := self.first_conflict(one, other, sample)) <= sample:
            sample = conflict + EVERY
        return sample

    def stay_clear(self, points: Array, samples: Array, others: Ints, less: float) -> Flags:
        """Whether moving arms stay clear of arms that hold.

        Args:
            points: of moving arms in the body's frame ``[m, n, points, 3]``. samples: at which they are there
                ``[m, n]``. others: grips that hold ``[m]``. less: as of :meth:`LimbShapes.near`.
        """
        shapes, grips = self.shapes, self._grips
        library = compiled.library_for(shapes.limb)
        out = np.zeros(len(others), dtype=np.bool_)
        if library is None:
            there = shapes.points_of(grips.arm[others], grips.between(others[:, None], samples))
            one, other = (side.reshape(-1, *side.shape[2:]) for side in (points, there))
            near = shapes.near(one, other, less).reshape(samples.shape)
            clear: Flags = np.asarray(np.logical_not(near.any(axis=1)))
            self._between(points, there, less, clear)
            return clear
        # Named, so that they outlive the call
        moving, at, bases = map(compiled.packed, (points, samples, shapes.bases[grips.arm[others]]))
        least = shapes.least - less
        where = [compiled.at(array) for array in (moving, at, bases, others, least, out)]
        sizes = (ctypes.c_long(size) for size in samples.shape)
        library.swings_clear(compiled.arm_of(shapes.limb), ctypes.byref(grips.table), *sizes, *where)
        return out

    def _between(self, points: Array, there: Array, less: float, clear: Flags) -> None:
        """Marks motions that are not clear between their instants, over which all points go straight: where the middle
        is farther from the other arm than both go, all of it is.
        """
        who = np.repeat(np.arange(len(points)), points.shape[1] - 1)
        spans = [np.stack([a[:, :-1], a[:, 1:]], axis=2).reshape(-1, 2, *a.shape[2:]) for a in (points, there)]
        while len(who):
            middle = [a.mean(axis=1) for a in spans]
            both = sum(0.5 * np.linalg.norm(a[:, 1] - a[:, 0], axis=2).max(axis=1) for a in spans)
            left = clear[who] & self.shapes.near(middle[0], middle[1], less - both)
            who, spans, middle, both = who[left], [a[left] for a in spans], [a[left] for a in middle], both[left]
            clear[who[self.shapes.near(middle[0], middle[1], np.full(len(who), less))]] = False
            on = (both >= FINELY) & clear[who]
            who, spans, middle = np.tile(who[on], 2), [a[on] for a in spans], [a[on] for a in middle]
            spans = [
                np.concatenate([np.stack([a[:, 0], m], axis=1), np.stack([m, a[:, 1]], axis=1)])
                for a, m in zip(spans, middle, strict=True)
            ]


def _pair(one: int, other: int) -> tuple[int, int]:
    return (one, other) if one < other else (other, one)
