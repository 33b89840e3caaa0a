"""Where links come too near to each other or to the scene, limb by limb and pair by pair, each looked at once."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from wbc.climb.along.spans import SpanTable
from wbc.climb.along.swings import SwingKey
from wbc.validation import Array

#: Instants between those at which limbs that hold are looked at
LOOKS = 3


class Touches:
    """What is known of the spans of a table, and of swings between them.

    Args:
        table: of the spans.
    """

    def __init__(self, table: SpanTable) -> None:
        self._table, self._world = table, table.world
        self._spans: dict[tuple[int, int], tuple[int, Array]] = {}
        self._pairs: dict[tuple[int, int, int, int], NDArray[np.intp]] = {}
        self._swings: dict[SwingKey, tuple[bool, Array]] = {}
        self._beside: dict[tuple[SwingKey, int, int], bool] = {}

    def until(self, rows: Sequence[int], now: int, without: int = -1) -> int:
        """The last instant to which limbs can hold spans together, from an instant on; -1: they cannot there.

        Args:
            without: a limb that does not count.
        """
        table, some = self._table, [limb for limb in range(len(rows)) if limb != without]
        last = min((int(table.ends[limb][rows[limb]]) for limb in some), default=len(table.track.instants) - 1)
        for one, other in itertools.combinations(some, 2):
            marked = self._pair(one, rows[one], other, rows[other])
            next_ = int(np.searchsorted(marked, now))
            if next_ < len(marked):
                last = min(last, int(marked[next_]) - LOOKS)
        return last if last >= now else -1

    def clear(self, key: SwingKey, instants: NDArray[np.int32], angles: Array, rows: Sequence[int]) -> bool:
        """Whether a swing is clear of the scene, the body, and the other limbs of ``rows``.

        Args:
            instants: at which it is looked at. angles: there.
        """
        limb = key[0]
        alone, pieces = self._alone(key, instants, angles)
        return alone and all(
            self._apart(key, instants, pieces, other, row) for other, row in enumerate(rows) if other != limb
        )

    def _alone(self, key: SwingKey, instants: NDArray[np.int32], angles: Array) -> tuple[bool, Array]:
        if key not in self._swings:
            limb, rows = key[:2]
            pieces = self._world.pieces(limb, angles)
            bodies = self._table.track.places[instants]
            tips = self._world.limbs.touch(limb, angles)[:, 9:, None]
            tips = bodies[:, 9:] + (bodies[:, :9].reshape(-1, 3, 3) @ tips)[:, :, 0]
            ends = self._table.limbs[limb].place[list(rows)].astype(np.int32)
            off = np.linalg.norm(tips[:, None] - self._world.places[ends, 9:], axis=2)
            contact = ends[np.argmin(off, axis=1)]
            self._swings[key] = not self._world.alone(limb, pieces, bodies, contact, off.min(axis=1)).any(), pieces
        return self._swings[key]

    def _apart(self, key: SwingKey, instants: NDArray[np.int32], pieces: Array, other: int, row: int) -> bool:
        full = key, other, row
        if full not in self._beside:
            begin, held = self._held(other, row)
            at = instants - begin
            inside = bool(at[0] >= 0 and at[-1] < len(held))
            self._beside[full] = inside and not self._world.beside(key[0], pieces, other, held[at]).any()
        return self._beside[full]

    def _pair(self, one: int, row: int, other: int, beside: int) -> NDArray[np.intp]:
        """Instants at which two spans do not go together."""
        key = one, row, other, beside
        if key not in self._pairs:
            (begin, a), (start, b) = self._held(one, row), self._held(other, beside)
            first, last = max(begin, start), min(begin + len(a), start + len(b))
            marks = np.empty(0, dtype=np.bool_)
            if first < last:
                parts = a[first - begin : last - begin : LOOKS], b[first - start : last - start : LOOKS]
                marks = self._world.beside(one, parts[0], other, parts[1])
            self._pairs[key] = first + LOOKS * np.flatnonzero(marks)
        return self._pairs[key]

    def _held(self, limb: int, row: int) -> tuple[int, Array]:
        """The first instant of a span, and poses of the limb's pieces from there on."""
        if (limb, row) not in self._spans:
            begin, angles = self._table.near(limb, row)
            self._spans[limb, row] = begin, self._world.pieces(limb, angles)
        return self._spans[limb, row]
