"""Joint 6 on holds whose roll is fixed: which of the allowed rolls, and which turn of the joint, a grip has."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import pi

import numpy as np

from wbc.validation import Array
from wbc.walking.holds.structure import Structure

#: Grips made of one stretch on a hold of fixed roll, at most: joint 6 and a whole turn away from it
MOST = 2
#: Row of :class:`Turned` for a hold that a hand may turn on
ANY = -1


@dataclass(frozen=True, eq=False)
class Turned:
    """Rows ``first`` to ``last`` of a stretch with joint 6 at ``angles`` [rad], at roll number ``roll`` of the hold.

    ``ends``: "limit", "rate" or "" where it ends with the stretch.
    """

    first: int
    last: int
    roll: int
    angles: Array
    ends: str


def turns(
    angles: Array,
    rolls: tuple[float, ...],
    limit: float,
    fastest: float,
    shortest: int,
    kept: tuple[int, float] | None = None,
) -> Iterator[Turned]:
    """Grips of one stretch: theta6 + roll + 2 pi w within the limit for as long as possible.

    Where the whole stretch is possible at several turns the one nearest to the middle of the joint is taken; of a fixed
    roll both, as a swing may take half a turn more to the one than to the other.

    Args:
        angles: theta6 at roll 0, row by row [rad]. rolls: allowed [rad].
        limit: largest size of theta6 [rad]. fastest: largest step from row to row [rad].
        shortest: rows of a grip at least. kept: a row and theta6 there [rad]: the grip that has it is found, too.
    """
    smooth = np.unwrap(angles)
    offsets = (np.array(rolls)[:, None] + 2 * pi * np.arange(-2, 3)).ravel()
    cuts = np.nonzero(np.abs(np.diff(smooth)) > fastest)[0] + 1
    for begin, end in zip([0, *cuts.tolist()], [*cuts.tolist(), len(smooth)], strict=True):
        part = smooth[begin:end] - 2 * pi * round(float(smooth[begin]) / (2 * pi))
        peaks = np.round(np.maximum(np.abs(part.max() + offsets), np.abs(part.min() + offsets)), 9)
        best = np.argsort(peaks, kind="stable")
        whole = best[peaks[best] <= limit][: MOST if len(rolls) == 1 else 1].tolist()
        if whole and end - begin >= shortest:
            found = [(0, end - begin - 1, k) for k in whole]
        else:
            found = list(_parts(part, offsets, limit, shortest))
        if kept is not None and begin <= kept[0] < end:
            found += _with(part, offsets, limit, shortest, kept[0] - begin, kept[1], found)
        for first, last, k in found:
            cut = "rate" if begin + last + 1 < len(smooth) else ""
            ends = "limit" if begin + last + 1 < end else cut
            angle = part[first : last + 1] + offsets[k]
            yield Turned(begin + first, begin + last, k // 5, angle, ends)


def _parts(part: Array, offsets: Array, limit: float, shortest: int) -> Iterator[tuple[int, int, int]]:
    """(first, last, offset): the longest stretches within the limit, none inside another."""
    runs = sorted(
        (first - last, first, last, k)
        for k, offset in enumerate(offsets.tolist())
        for first, last in _runs(np.abs(part + offset) <= limit)
        if last - first + 1 >= shortest
    )
    kept: list[tuple[int, int]] = []
    for _, first, last, k in runs:
        if not any(a <= first and last <= b for a, b in kept):
            kept.append((first, last))
            yield first, last, k


def _with(
    part: Array,
    offsets: Array,
    limit: float,
    shortest: int,
    row: int,
    angle: float,
    found: Sequence[tuple[int, int, int]],
) -> Iterator[tuple[int, int, int]]:
    """The stretch within the limit that has an angle at a row, unless it is among those found."""
    k = int(np.abs(part[row] + offsets - angle).argmin())
    for first, last in _runs(np.abs(part + offsets[k]) <= limit):
        if first <= row <= last and last - first + 1 >= shortest and (first, last, k) not in found:
            yield first, last, k


def _runs(inside: Array) -> Iterator[tuple[int, int]]:
    edges = np.diff(np.concatenate([[0], inside.astype(np.int8), [0]]))
    for first, end in zip(np.nonzero(edges == 1)[0].tolist(), np.nonzero(edges == -1)[0].tolist(), strict=True):
        yield first, end - 1


def frame_on(structure: Structure, hold: int, roll: int) -> Array:
    """Homogeneous matrix of a hand on a hold (its row) at a roll of the hold (its number; ANY: at 0)."""
    out: Array = structure.frames[hold].copy()
    if roll > 0:
        angle = structure.holds[hold].rolls[roll]
        c, s = np.cos(angle), np.sin(angle)
        out[:3, :2] = out[:3, :2] @ np.array([[c, -s], [s, c]])
    return out


def allowed_x(structure: Structure, hold: int, x: Array, z: Array) -> Array:
    """The x axis that a hand on a hold (its row) should have: the nearest roll that is allowed.

    The roll of a hand is atan2(x . Y, x . X) with X and Y of the hold; where it may tilt, its x axis goes with it.
    ``x`` and ``z`` are the hand's in the structure.
    """
    frame = structure.frames[hold]
    step = 2 * pi / max(len(structure.holds[hold].rolls), 1)
    angle = step * round(float(np.arctan2(x @ frame[:3, 1], x @ frame[:3, 0])) / step)
    out: Array = np.cos(angle) * frame[:3, 0] + np.sin(angle) * frame[:3, 1]
    if structure.tilts[hold] > 0.0:
        across = np.cross(np.cos(angle) * frame[:3, 1] - np.sin(angle) * frame[:3, 0], z)
        out = across / np.linalg.norm(across)
    return out
