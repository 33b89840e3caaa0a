"""Rows of ticks: the parts of a tick side by side, and from where in its memory each is copied."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping


class TickRow:
    """The parts of a tick in their order.

    Attributes:
        sizes: part -> how many numbers.
    """

    def __init__(self) -> None:
        self.sizes = dict[str, int]()

    @property
    def size(self) -> int:
        """Of all parts so far [bytes]."""
        return 8 * sum(self.sizes.values())

    def add(self, places: Mapping[str, slice]) -> list[tuple[int, int, int]]:
        """Lay out parts by their places in memory: where each piece that is copied at once begins in the row, and in
        memory, and its size [bytes]. Parts that touch, but for one number that C has more, are a piece with it.
        """
        pieces: list[tuple[int, slice]] = []
        for name, place in sorted(places.items(), key=lambda pair: (pair[1].start, pair[1].stop)):
            begin, piece = pieces[-1] if pieces else (0, slice(-2, -2))
            if place.start == piece.stop + 1:
                self.sizes[f"before {name}"] = 1
            elif place.start != piece.stop:
                begin, piece = self.size, slice(place.start, place.start)
                pieces.append((begin, piece))
            pieces[-1] = begin, slice(piece.start, place.stop)
            self.sizes[name] = place.stop - place.start
        return [(begin, 8 * p.start, 8 * (p.stop - p.start)) for begin, p in pieces if p.start != p.stop]


class RowWriting(ctypes.Structure):
    """``wbc_recording`` of ``native/builtins.h``: C records ticks with their values in one call.

    Attributes:
        ready: not 0: the last tick was recorded, and nothing else has changed what the solver remembers.
        end: bytes of the chunk that are full. count: ticks so far. row, size: of a tick, and of the chunk [bytes].
        chunk, pieces: addresses of the chunk and of the pieces of :meth:`TickRow.add`.
        given, told: pieces that are copied before a tick, and after it. reset: where in the row ``reset`` is [bytes].
    """

    _fields_ = tuple(
        (name, ctypes.c_int64)
        for name in ("ready", "end", "count", "row", "size", "chunk", "pieces", "given", "told", "reset")
    )
    ready: int
    end: int
    count: int
    row: int
    size: int
    chunk: int
    pieces: int
    given: int
    told: int
    reset: int
