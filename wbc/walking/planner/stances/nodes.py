"""What a search over stances is made of: stances with their way, and what was found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

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
