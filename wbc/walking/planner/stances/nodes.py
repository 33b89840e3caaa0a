"""What a search over stances is made of: stances with their way, which grips go together, and what was found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

from wbc.walking.planner.grips.conflicts import ArmClearance
from wbc.walking.planner.grips.table import Ints
from wbc.walking.planner.swings.move import Key, Move


class Node(NamedTuple):
    """A stance: since when, by what move, and the delay until then in QUANTUM."""

    sample: int
    delay: int
    parent: Key | None
    move: Move | None


@dataclass(frozen=True)
class Found:
    """Outcome of a search.

    Attributes:
        start: the stance that it begins with.
        moves: the moves, or those of the stance that lasts longest.
        complete: the last stance lasts to the end of the path.
        reached: last sample that the last stance can hold.
        expanded: stances looked at.
        blocking: grips of the last stance whose end is ``reached``.
    """

    start: Key
    moves: tuple[Move, ...]
    complete: bool
    reached: int
    expanded: int
    blocking: tuple[int, ...]


def way_to(levels: Sequence[Mapping[Key, Node]], key: Key) -> tuple[Key, tuple[Move, ...]]:
    """The stance of the first level, and the moves from it, that lead to one of the last."""
    moves: list[Move] = []
    for level in levels[:0:-1]:
        node = level[key]
        if node.move is None or node.parent is None:
            break
        moves.append(node.move)
        key = node.parent
    return key, tuple(reversed(moves))


class StanceRooms:
    """Last samples of stances, as their grips end or their arms come too near to each other.

    Args:
        clearance: of pairs of grips. last: of each grip. spared: the same, less what is spared for landing.
    """

    def __init__(self, clearance: ArmClearance, last: Ints, spared: Ints) -> None:
        self._clearance, self._last, self._spared = clearance, last, spared

    def among(self, others: Sequence[int], sample: int) -> int:
        """Last sample that the grips of some arms can hold together, less what is spared."""
        return min([*(int(self._spared[g]) for g in others), *self._free(others, sample)])

    def until(self, key: Sequence[int], sample: int) -> int:
        """Last sample that a stance can hold, from a sample on."""
        return min([*(int(self._last[g]) for g in key), *self._free(key, sample)])

    def limits(self, key: Key, sample: int) -> tuple[list[int], list[int]]:
        """For each arm the last sample that the others can hold, less what is spared, and that it can hold itself."""
        pairs, free = list(combinations(key, 2)), self._free(key, sample)
        rooms, ends = [], []
        for grip in key:
            mine = [end for pair, end in zip(pairs, free, strict=True) if grip in pair]
            rest = [end for pair, end in zip(pairs, free, strict=True) if grip not in pair]
            rooms.append(min([*(int(self._spared[g]) for g in key if g != grip), *rest]))
            ends.append(min([int(self._last[grip]), *mine]))
        return rooms, ends

    def clear_from(self, grip: int, others: Sequence[int], sample: int) -> int:
        """The first sample from a sample on at which an arm is not in the way of others."""
        while (after := max(self._clearance.free_from(grip, other, sample) for other in others)) > sample:
            sample = after
        return sample

    def _free(self, grips: Sequence[int], sample: int) -> list[int]:
        """Last samples before pairs get in each other's way."""
        return [self._clearance.first_conflict(*pair, sample) - 1 for pair in combinations(grips, 2)]
