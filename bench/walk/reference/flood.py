"""The relaxed question: can the body get there at all, if arms pass through each other?

At a hub, a pose at which three hands have three holds, any hand can be moved to any hold of its own, so all stances
there count as one. Two hubs next to each other are one place if two hands have each a hold, not the same, that it can
keep from one to the other. Besides, two hands can carry the body from hub to hub through poses at which the third has
no hold: those are the types of pairs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from bench.walk.reference.arm_table import Flags
from bench.walk.reference.grid import GridHolds
from bench.walk.reference.lattice import FAR, PARTS, SIDE, Ints
from bench.walk.reference.pairs import NEXT

Counts = NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class Places:
    """Where the body can be over some holds.

    Attributes:
        label: of hubs ``[x, y, heights, headings]``, -1 elsewhere; equal where one can be reached from the other.
        origin: x and y of the first [cells].
    """

    label: Ints
    origin: tuple[int, int]

    def at(self, cells: Ints) -> Ints:
        """Labels of cells (height, heading, x, y) ``[n, 4]``; -1 also outside."""
        inside, index = self._inside(cells)
        out = np.full(len(cells), -1, dtype=np.int64)
        out[inside] = self.label[index]
        return out

    def mark(self, body: Flags, cells: Ints) -> None:
        """Sets the entries of cells in an array like :attr:`label`."""
        body[self._inside(cells)[1]] = True

    def _inside(self, cells: Ints) -> tuple[Flags, tuple[Ints, Ints, Ints, Ints]]:
        x, y = cells[:, 2] - self.origin[0], cells[:, 3] - self.origin[1]
        inside = (x >= 0) & (x < self.label.shape[0]) & (y >= 0) & (y < self.label.shape[1])
        return inside, (x[inside], y[inside], cells[inside, 0], cells[inside, 1])


class Flood:
    """The relaxed search over a table.

    Args:
        fits: ``[1, heights, headings, SIDE, SIDE]`` of an arm table without branches.
    """

    def __init__(self, fits: Flags) -> None:
        one = np.ascontiguousarray(np.moveaxis(fits[0], (2, 3), (0, 1)))
        self._single, self._double, self._triple = (_joined(one, count) for count in (1, 2, 3))
        self._steps = []
        for axis in range(4):
            both = one & np.roll(one, -1, axis=axis)
            if axis == 2:
                both[:, :, -1] = False
            self._steps.append((both, _joined(both, 2)))

    def places(self, holds: GridHolds) -> Places:
        """Hubs, and which are connected by steps from hub to hub."""
        hub = self._hubs(holds)
        number = np.full(hub.shape, -1, dtype=np.int32)
        number[hub] = np.arange(int(hub.sum()), dtype=np.int32)
        begins, ends = [], []
        for axis, kernels in enumerate(self._steps):
            here = hub & np.roll(hub, -1, axis=axis) & _two(*(_stamped(kernel, holds) for kernel in kernels))
            begins.append(number[here])
            ends.append(np.roll(number, -1, axis=axis)[here])
        label = _labels(np.concatenate(begins), np.concatenate(ends), int(hub.sum()))
        whole = np.full(hub.shape, -1, dtype=np.int64)
        whole[hub] = label
        origin = PARTS * holds.first[0] - FAR, PARTS * holds.first[1] - FAR
        return Places(whole, origin)

    def _hubs(self, holds: GridHolds) -> Flags:
        single, double, triple = (_stamped(k, holds) for k in (self._single, self._double, self._triple))
        hub = triple >= 3
        for arm in range(3):
            hub &= (np.roll(single, -NEXT * arm, axis=3) >= 1) & (np.roll(double, -NEXT * arm, axis=3) >= 2)
        return hub


def _two(single: Counts, double: Counts) -> Flags:
    """Whether some two arms have different holds, of counts for arm 1 and for arms 1 and 2 together."""
    arms = [np.roll(single, -NEXT * arm, axis=3) >= 1 for arm in range(3)]
    out = np.zeros(single.shape, dtype=bool)
    for arm in range(3):
        out |= arms[arm] & arms[(arm + 1) % 3] & (np.roll(double, -NEXT * arm, axis=3) >= 2)
    return out


def _joined(kernel: Flags, arms: int) -> Counts:
    """What some of the first arms can hold."""
    out = kernel.copy()
    for arm in range(1, arms):
        out |= np.roll(kernel, -NEXT * arm, axis=3)
    return out.view(np.uint8)


def _stamped(kernel: Flags | Counts, holds: GridHolds) -> Counts:
    """How many holds each pose has, ``[x, y, heights, headings]``."""
    shape = [PARTS * (n - 1) + SIDE for n in holds.present.shape]
    out = np.zeros((*shape, *kernel.shape[2:]), dtype=np.uint8)
    stamp = kernel.view(np.uint8)
    for t, a in np.argwhere(holds.present).tolist():
        out[PARTS * t : PARTS * t + SIDE, PARTS * a : PARTS * a + SIDE] += stamp
    return out


def _labels(begins: Ints, ends: Ints, count: int) -> Ints:
    graph = coo_array((np.ones(len(begins), dtype=np.int8), (begins, ends)), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)
