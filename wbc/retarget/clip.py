"""A clip: where the joints of a skeleton are, frame by frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Marks = NDArray[np.bool_]


@dataclass(frozen=True)
class Skeleton:
    """Joints of a person or an animal as a tree, in an order in which parents come first.

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

    @property
    def rest(self) -> Array:
        """Positions at rest [joints, 3] [m]."""
        return rest_places(self.parents, self.offsets)


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


def rest_places(parents: Sequence[int], offsets: Array) -> Array:
    """Positions of a tree at rest, of offsets from the parents [joints, 3]."""
    places = np.array(offsets, dtype=float)
    for joint, parent in enumerate(parents):
        if parent >= 0:
            places[joint] += places[parent]
    return places


def ancestors(parents: Sequence[int], joint: int) -> list[int]:
    """A joint and all above it, up to the root."""
    chain = [joint]
    while parents[chain[-1]] >= 0:
        chain.append(parents[chain[-1]])
    return chain


def intervals(marks: Marks) -> list[tuple[int, int]]:
    """First frame and the one after the last of every run of true."""
    edges = np.flatnonzero(np.diff(np.asarray(marks, dtype=np.int8), prepend=0, append=0)).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))


def listed(entries: Sequence[str], most: int, apart: str = ", ") -> str:
    """The first entries in a line, with dots where there are more."""
    return apart.join([*entries[:most], *(["..."] if len(entries) > most else [])])
