"""Two hands that carry the body from one place of the relaxed search to another, and what separates places."""

from __future__ import annotations

import numpy as np

from bench.walk.reference.arm_table import Flags
from bench.walk.reference.flood import Places
from bench.walk.reference.grid import GridHolds
from bench.walk.reference.lattice import FAR, PARTS, SIDE, Ints
from bench.walk.reference.pairs import NEXT, Pairs

#: Places that have a bit of their own; all others share the last
BITS = 62
#: Cut holds are at most this much further from the other side than the nearest [grid units]
EDGE = 0.5


class Bridges:
    """What an arm table without branches says about places.

    Args:
        fits: ``[1, heights, headings, SIDE, SIDE]``. pairs: of the same rules.
    """

    def __init__(self, fits: Flags, pairs: Pairs) -> None:
        self.pairs = pairs
        one = np.ascontiguousarray(np.moveaxis(fits[0], (2, 3), (0, 1)))
        self._arms = [np.roll(one, -NEXT * arm, axis=3) for arm in range(3)]
        self._any = self._arms[0] | self._arms[1] | self._arms[2]

    def merged(self, places: Places, holds: GridHolds, ours: Ints, theirs: Ints) -> Ints:
        """For each label the label of all that two hands, or several pairs of them in turn, connect it with.

        It is complete unless some of ``ours`` are connected with some of ``theirs``: then nothing more is looked for.
        """
        count = int(places.label.max(initial=-1)) + 1
        root = np.arange(count)
        touched, bits = self._touched(places, holds, count)
        if not touched.any() or np.isin(ours, theirs).any():
            return root
        flat = places.label.ravel()
        shape = places.label.shape
        for kind in range(len(self.pairs)):
            cells = self.pairs.cells_of(kind)
            for arm in range(3):
                at = self._candidates(touched, holds, kind, arm)
                if not len(at):
                    continue
                heading = (cells[:, 1] - NEXT * arm) % shape[3]
                inner = cells[:, 0] * shape[3] + heading
                x, y = cells[:, 2] + FAR, cells[:, 3] + FAR  # from the first pose of the window about the hold
                index = (x * shape[1] + y) * shape[2] * shape[3] + inner
                start = (at - holds.first) * PARTS @ [shape[1], 1] * shape[2] * shape[3]
                for begin in start.tolist():
                    met = flat[index + begin]
                    met = met[met >= 0]
                    if len(met) and met.min() != met.max():
                        labels = np.unique(root[np.unique(met)])
                        if len(labels) > 1:
                            root[np.isin(root, labels)] = labels[0]
                            _join(touched, int(np.bitwise_or.reduce(bits[labels])))
                            bits[root == labels[0]] = np.bitwise_or.reduce(bits[labels])
                            if np.isin(root[ours], root[theirs]).any():
                                return root
        return root

    def _candidates(self, touched: Ints, holds: GridHolds, kind: int, arm: int) -> Ints:
        """Places (T, A) of the first hold at which both hands touch two places of the body, ``[n, 2]``."""
        t, a = self.pairs.offset[kind].tolist()
        size_t, size_a = holds.present.shape
        if abs(t) >= size_t or abs(a) >= size_a:
            return np.zeros((0, 2), dtype=np.int64)
        first = np.s_[max(0, -t) : size_t - max(0, t), max(0, -a) : size_a - max(0, a)]
        second = np.s_[max(0, t) : size_t + min(0, t), max(0, a) : size_a + min(0, a)]
        common = touched[arm][first] & touched[(arm + 1) % 3][second]
        # More than one bit, or the bit that many share
        found = np.argwhere(((common & (common - 1)) != 0) | (common >> BITS != 0))
        out: Ints = found + np.array([max(0, -t) + holds.first[0], max(0, -a) + holds.first[1]])
        return out

    def _touched(self, places: Places, holds: GridHolds, count: int) -> tuple[Ints, Ints]:
        """One bit for each place of the body from which an arm can hold a hold, ``[3, T, A]``, and the bit of each."""
        out = np.zeros((3, *holds.present.shape), dtype=np.int64)
        if count < 2:
            return out, np.ones(count, dtype=np.int64)
        size = np.bincount(places.label[places.label >= 0], minlength=count)
        rank = np.empty(count, dtype=np.int64)
        rank[np.argsort(-size, kind="stable")] = np.arange(count)
        bits = np.append(np.int64(1) << np.minimum(rank, BITS), 0)
        mask = bits[places.label]  # label -1 is the last entry
        for t, a in np.argwhere(holds.present).tolist():
            window = mask[PARTS * t : PARTS * t + SIDE, PARTS * a : PARTS * a + SIDE]
            total = int(np.bitwise_or.reduce(window, axis=None))
            if total & (total - 1) == 0 and not total >> BITS:
                continue
            for arm in range(3):
                out[arm, t, a] = np.bitwise_or.reduce(window[self._arms[arm]])
        return out, bits[:-1]

    def touched_from(self, body: Flags, holds: GridHolds) -> Flags:
        """Holds that some arm can hold at some of the body's poses ``[x, y, heights, headings]``, ``[T, A]``."""
        out = np.zeros(holds.present.shape, dtype=bool)
        for t, a in np.argwhere(holds.present).tolist():
            window = body[PARTS * t : PARTS * t + SIDE, PARTS * a : PARTS * a + SIDE]
            out[t, a] = bool((window & self._any).any())
        return out

    def separating(self, ours: Flags, theirs: Flags, holds: GridHolds) -> tuple[str, ...]:
        """Ids of the holds at which the way ends, for the poses on either side.

        Those that both sides touch; if there are none, those of our side that are nearest to the other's.
        """
        here, there = self.touched_from(ours, holds), self.touched_from(theirs, holds)
        cut = here & there
        if not cut.any():
            near, far = np.argwhere(here), np.argwhere(there)
            distance = np.linalg.norm(near[:, None] - far[None], axis=-1).min(axis=1)
            cut[tuple(near[distance <= distance.min() + EDGE].T)] = True
        return self.names(cut, holds)

    def names(self, some: Flags, holds: GridHolds) -> tuple[str, ...]:
        """Ids of holds ``[T, A]``."""
        first = holds.first
        return tuple(holds.ids[(t + first[0], a + first[1])] for t, a in np.argwhere(some).tolist())


def _join(touched: Ints, joined: int) -> None:
    """Makes one bit, the lowest, of several; the shared one stays."""
    joined &= ~(1 << BITS)
    if joined:
        some = (touched & joined) != 0
        touched[some] = (touched[some] & ~joined) | (joined & -joined)
