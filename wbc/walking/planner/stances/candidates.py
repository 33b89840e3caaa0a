"""The moves from all stances of a level at once, and the stances that they lead to, in the order of their promise."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields
from functools import partial

import numpy as np

from wbc.validation import Array
from wbc.walking.planner.grips.table import Ints
from wbc.walking.planner.stances.nodes import Node
from wbc.walking.planner.swings.move import Key, Move

#: Delays are counted in steps of this [s], so that rounding decides nothing
QUANTUM = 1e-6


@dataclass(frozen=True, eq=False)
class Fan:
    """Moves ``[m]`` each: from which stance of the level, and as in :class:`Move`."""

    parent: Ints
    arm: Ints
    source: Ints
    target: Ints
    lift: Ints
    land: Ints
    duration: Array
    delay: Array

    def __len__(self) -> int:
        return len(self.parent)

    def of(self, rows: Ints) -> Fan:
        """Some of them."""
        return Fan(*(getattr(self, f.name)[rows] for f in fields(self)))

    @staticmethod
    def joined(parts: Sequence[Fan]) -> Fan:
        """One after the other."""
        return Fan(*(np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(Fan)))

    def move(self, row: int) -> Move:
        """One of them."""
        arm, source, target, lift, land = (
            int(column[row]) for column in (self.arm, self.source, self.target, self.lift, self.land)
        )
        return Move(arm, source, target, lift, land, float(self.duration[row]), float(self.delay[row]))


@dataclass(frozen=True, eq=False)
class Outlook:
    """What makes a stance promising: long grips, and time for the swings that must follow.

    With the ends e_1 <= e_2 <= ... of its grips a stance that begins at j has the slack min_k (e_k - j - (k - 1) n), as
    hands swing one after the other for n samples. What is more than ``slack`` is worth nothing. A grip that lasts to
    the end of the path needs no other.

    Attributes:
        last: of each grip. codes: of each grip, by hold and branch. finish: last sample. usual: n. slack: samples.
        spacing: of samples [s].
    """

    last: Ints
    codes: Ints
    finish: int
    usual: int
    slack: float
    spacing: float

    def promise(self, ends: Ints, samples: Ints, delays: Ints) -> Array:
        """Less is better; ends of grips ``[m, arms]``."""
        arms = ends.shape[1]
        ends = np.sort(ends, axis=1)
        ends = np.where(ends < self.finish, ends, self.finish + self.usual)
        slack = (ends - samples[:, None] - self.usual * np.arange(arms)).min(axis=1)
        out: Array = -(ends.sum(axis=1) / arms + np.minimum(slack, self.slack)) + delays * QUANTUM / self.spacing
        return out

    def order(self, keys: Ints, samples: Ints, promise: Array) -> Ints:
        """Rows by promise; ties by sample, by holds and branches, whichever arms they are of, then by grips."""
        codes = np.sort(self.codes[keys], axis=1)
        out: Ints = np.lexsort([*keys.T[::-1], *codes.T[::-1], samples, promise])
        return out


@dataclass(frozen=True, eq=False)
class Candidate:
    """A stance that moves lead to.

    Attributes:
        key: its grips. sample, delay: of the earliest of the moves. nodes: one for each move, the earliest first.
    """

    key: Key
    sample: int
    delay: int
    nodes: Callable[[], list[Node]]


def following(fan: Fan, level: Sequence[tuple[Key, Node]], outlook: Outlook, most: int | None) -> Iterator[Candidate]:
    """Stances that moves lead to, the promising ones first, each by at most so many moves, the earliest ones first."""
    if not len(fan):
        return
    keys = np.array([key for key, _ in level], dtype=np.int64)[fan.parent]
    keys[np.arange(len(fan)), fan.arm] = fan.target
    before = np.array([node.delay for _, node in level], dtype=np.int64)[fan.parent]
    delays = before + np.round(fan.delay / QUANTUM).astype(np.int64)
    rows = np.lexsort([fan.target, fan.arm, fan.parent, delays, fan.land, *keys.T])
    new = np.concatenate([[True], (keys[rows[1:]] != keys[rows[:-1]]).any(axis=1)])
    heads, ends = np.nonzero(new)[0], np.append(np.nonzero(new)[0][1:], len(rows))
    first = rows[heads]
    promise = outlook.promise(outlook.last[keys[first]], fan.land[first], delays[first])

    def nodes(begin: int, end: int) -> list[Node]:
        mine = rows[begin : end if most is None else min(begin + most, end)].tolist()
        return [Node(int(fan.land[k]), int(delays[k]), level[fan.parent[k]][0], fan.move(k)) for k in mine]

    for place in outlook.order(keys[first], fan.land[first], promise).tolist():
        row = first[place]
        of_moves = partial(nodes, int(heads[place]), int(ends[place]))
        yield Candidate(tuple(keys[row].tolist()), int(fan.land[row]), int(delays[row]), of_moves)
