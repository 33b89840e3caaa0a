"""What a search over stances is made of: stances with their moves, which grips go together, what it needs of swings,
and what was found.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from wbc.validation import Array
from wbc.walking.planner.grips.conflicts import NEVER
from wbc.walking.planner.grips.table import Ints
from wbc.walking.planner.slices import Slices
from wbc.walking.planner.swings.move import Chosen, Key, Move, Swing


class Conflicts(Protocol):
    """Which grips do not go together, and when."""

    def prepare(self, pairs: Iterable[tuple[int, int]], /) -> None:
        """Look at pairs of grips together, as the search will need them."""

    def first_conflict(self, one: int, other: int, sample: int, /) -> int:
        """The first sample from ``sample`` on at which two grips do not go together; one behind every path for none."""

    def free_from(self, one: int, other: int, sample: int, /) -> int:
        """The first sample from ``sample`` on at which they do."""


class SwingTable(Protocol):
    """Swings between grips: how long they take, and whether there is one."""

    @property
    def touch(self) -> int:
        """Samples from when a hand is on its hold until it holds."""

    def estimate(self, sources: Ints, targets: Ints, lift: Ints, land: Ints, /) -> Array:
        """About how long swings take that are lifted and land at about these samples ``[m]`` [s]."""

    def soonest(self) -> Ints:
        """First samples at which hands land on grips ``[grips]``."""

    def lands(self, targets: Ints, samples: Ints, /) -> NDArray[np.bool_]:
        """Whether hands can land on grips at samples ``[m]``."""

    def slices(self, swings: Iterable[Swing], /) -> Slices[None]:
        """Look at swings together, in slices of some milliseconds."""

    def choose(self, swing: Swing, /) -> Chosen | None:
        """How a hand swings; None where it cannot."""

    def correct(self, move: Move, duration: float, possible: bool, /) -> None:
        """A swing takes another time [s], or is not possible after all."""


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


def moves_to(levels: Sequence[Mapping[Key, Node]], key: Key) -> tuple[Key, tuple[Move, ...]]:
    """The stance of the first level, and the moves from it, that lead to one of the last."""
    moves: list[Move] = []
    for level in levels[:0:-1]:
        node = level[key]
        if node.move is None or node.parent is None:
            break
        moves.append(node.move)
        key = node.parent
    return key, tuple(reversed(moves))


class StanceEnds:
    """Last samples of stances, as their grips end or conflict.

    Args:
        conflicts: of pairs of grips. last: of each grip. spared: the same, less what is spared for landing.
    """

    def __init__(self, conflicts: Conflicts, last: Ints, spared: Ints) -> None:
        self._conflicts, self._last, self._spared = conflicts, last, spared
        self._known: dict[tuple[int, ...], int] = {}

    def among(self, others: Sequence[int], sample: int) -> int:
        """Last sample that the grips of some arms can hold together, less what is spared."""
        return min([*(int(self._spared[g]) for g in others), self._first(tuple(others), sample) - 1])

    def until(self, key: Sequence[int], sample: int) -> int:
        """Last sample that a stance can hold, from a sample on."""
        return min([*(int(self._last[g]) for g in key), self._first(tuple(key), sample) - 1])

    def by_arm(self, keys: Ints, samples: Ints) -> Ints:
        """For each arm of stances ``[n, arms]`` the last sample that it can hold itself, from a sample ``[n]`` on: of
        two arms that conflict the one whose grip ends sooner has to move first.
        """
        one, other = np.triu_indices(keys.shape[1], 1)
        size, last = int(keys.max()) + 1, self._last[keys]
        pairs = np.sort(np.stack([keys[:, one], keys[:, other]], axis=2), axis=2)
        codes, which = np.unique(pairs @ [size, 1], return_inverse=True)
        # Most pairs conflict nowhere, or only later
        whole = [self._conflicts.first_conflict(code // size, code % size, 0) for code in codes.tolist()]
        first = np.array(whole)[which.reshape(pairs.shape[:2])]
        for row, k in zip(*np.nonzero(first < samples[:, None]), strict=True):
            a, b = pairs[row, k].tolist()
            first[row, k] = self._conflicts.first_conflict(a, b, int(samples[row]))
        rank = last.argsort(axis=1, kind="stable").argsort(axis=1)
        sooner = np.where(rank[:, one] < rank[:, other], one, other)
        np.minimum.at(last, (np.arange(len(keys))[:, None], sooner), first - 1)
        return last

    def limits(self, key: Key, sample: int) -> tuple[list[int], list[int]]:
        """For each arm the last sample that the others can hold, less what is spared, and that it can hold itself."""
        pairs, free = list(combinations(key, 2)), self._free(key, sample)
        until, ends = [], []
        for grip in key:
            mine = [end for pair, end in zip(pairs, free, strict=True) if grip in pair]
            rest = [end for pair, end in zip(pairs, free, strict=True) if grip not in pair]
            until.append(min([*(int(self._spared[g]) for g in key if g != grip), *rest]))
            ends.append(min([int(self._last[grip]), *mine]))
        return until, ends

    def clear_from(self, grip: int, others: Sequence[int], sample: int) -> int:
        """The first sample from a sample on at which an arm is clear of others."""
        while (after := max(self._conflicts.free_from(grip, other, sample) for other in others)) > sample:
            sample = after
        return sample

    def _first(self, grips: tuple[int, ...], sample: int) -> int:
        """The first sample from a sample on at which two of some grips conflict; one behind every path for none."""
        first = self._known.get(grips)
        if first is None:
            first = min((self._conflicts.first_conflict(*pair, 0) for pair in combinations(grips, 2)), default=NEVER)
            self._known[grips] = first
        return first if first >= sample else min(self._free(grips, sample)) + 1

    def _free(self, grips: Sequence[int], sample: int) -> list[int]:
        """Last samples before pairs conflict."""
        return [self._conflicts.first_conflict(*pair, sample) - 1 for pair in combinations(grips, 2)]
