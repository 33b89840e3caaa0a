"""A clip: where the joints of a skeleton are, frame by frame."""

from __future__ import annotations

from collections.abc import Container, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from wbc.retarget.words import words

Array = NDArray[np.float64]
Marks = NDArray[np.bool_]


@dataclass(frozen=True)
class Skeleton:
    """Joints of a person, an animal or a robot as a tree, in an order in which parents come first.

    Attributes:
        names: of the joints; of markers and key points without a hierarchy, theirs.
        parents: number of each joint's parent; -1 at the root, and for all where the file has no hierarchy.
        offsets: from the parent to the joint in the rest pose, along world axes [joints, 3], z up [m].
        ends: whether a joint is only the end of a bone (BVH's End Site) [joints].
    """

    names: tuple[str, ...]
    parents: tuple[int, ...]
    offsets: Array
    ends: tuple[bool, ...]

    @cached_property
    def rest(self) -> Array:
        """Positions at rest [joints, 3] [m]."""
        places = np.array(self.offsets, dtype=float)
        for joint, parent in enumerate(self.parents):
            if parent >= 0:
                places[joint] += places[parent]
        return places

    @cached_property
    def children(self) -> list[list[int]]:
        """Numbers of each joint's children."""
        below: list[list[int]] = [[] for _ in self.names]
        for child, parent in enumerate(self.parents):
            if parent >= 0:
                below[parent].append(child)
        return below

    def path(self, start: int, end: int) -> tuple[int, ...]:
        """Joints from one to another along the tree, both included."""
        up, down = ancestors(self.parents, start), ancestors(self.parents, end)
        meeting = next(joint for joint in up if joint in down)
        return (*up[: up.index(meeting) + 1], *reversed(down[: down.index(meeting)]))

    def bones(self, chain: Sequence[int]) -> Array:
        """Lengths from joint to joint of a chain at rest [m]."""
        return np.asarray(np.linalg.norm(np.diff(self.rest[list(chain)], axis=0), axis=1))

    def length(self, chain: Sequence[int]) -> float:
        """Of a chain at rest [m]."""
        return float(self.bones(chain).sum())

    def said(self, chains: Sequence[Sequence[int]]) -> set[str]:
        """Words of the names of chains' joints."""
        return {word for chain in chains for joint in chain for word in words(self.names[joint])}


@dataclass(frozen=True)
class Clip:
    """Joints over time, as every reader of files leaves them: z up, metres, NaN nowhere.

    Attributes:
        skeleton: whose motion it is.
        rate: frames a second [Hz].
        points: positions in the world [frames, joints, 3] [m]; filled in where they were not seen.
        turns: rotations of the joints from the rest pose, in the world [frames, joints, 3, 3]; None where the file has
            points alone.
        seen: whether a point was in the file, and not filled in [frames, joints].
        name: of the file, without its folder.
        notes: what was found in the file and changed: units, the axis that is up, gaps, swapped markers.
    """

    skeleton: Skeleton
    rate: float
    points: Array
    turns: Array | None
    seen: Marks
    name: str
    notes: tuple[str, ...] = ()


def ancestors(parents: Sequence[int], joint: int) -> list[int]:
    """A joint and all above it, up to the root."""
    chain = [joint]
    while parents[chain[-1]] >= 0:
        chain.append(parents[chain[-1]])
    return chain


def nearest_above(parents: Sequence[int], joint: int, there: Container[int]) -> int:
    """The nearest of some joints above one; -1 where there is none."""
    return next((above for above in ancestors(parents, joint)[1:] if above in there), -1)


def intervals(marks: Marks) -> list[tuple[int, int]]:
    """First frame and the one after the last of every run of true."""
    between = np.zeros(len(marks) + 2, dtype=bool)
    between[1:-1] = marks
    edges = np.flatnonzero(between[1:] != between[:-1]).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))


def listed(entries: Sequence[str]) -> str:
    """The first eight entries in a line, with dots where there are more."""
    return ", ".join([*entries[:8], *(["..."] if len(entries) > 8 else [])])
