"""What a reader finds in a file, before units, axes, gaps and swapped markers are looked at."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from wbc.errors import ClipFileError
from wbc.validation import Array


@dataclass
class Recorded:
    """A clip as its file has it.

    Attributes:
        names: of the joints or markers.
        parents: number of each joint's parent; -1 at roots and where nothing is known.
        points: along the file's axes [frames, joints, 3]; NaN where a point is missing.
        rate: frames a second [Hz]; 0 where the file does not say.
        offsets: from the parent in the rest pose, along its axes [joints, 3]; None where there is none.
        turns: rotations from the rest pose, from its axes to the file's [frames, joints, 3, 3]; None: points alone.
        ends: joints that only end a bone.
        seen: whether a point was there [frames, joints]; None: where it is not NaN.
        unit: length of the file's unit [m]; 0 where the file does not say.
        up: the axis that the file's format says is up, such as ``"z"``; "" where it does not say.
        usual: the axis that is usually up in such files; "" where there is none.
        rest_up: the axis that is up in the rest pose; "" where that is the file's.
        notes: what was found.
    """

    names: list[str]
    parents: list[int]
    points: Array
    rate: float
    offsets: Array | None = None
    turns: Array | None = None
    ends: list[bool] = field(default_factory=list)
    seen: NDArray[np.bool_] | None = None
    unit: float = 0.0
    up: str = ""
    usual: str = ""
    rest_up: str = ""
    notes: list[str] = field(default_factory=list)


def in_the_world(parents: list[int], offsets: Array, own: Array, moves: dict[int, Array]) -> tuple[Array, Array]:
    """Positions and rotations of a tree's joints in the file's axes.

        R_j = R_parent R_own,j        p_j = p_parent + R_parent d_j

    Args:
        own: rotations in the parent's axes [frames, joints, 3, 3].
        moves: joint -> d_j of each frame [frames, 3]; elsewhere it is the joint's offset.
    """
    points, turns = np.empty(own.shape[:3]), np.empty_like(own)
    for joint, parent in enumerate(parents):
        step = moves.get(joint, offsets[joint])
        if parent < 0:
            turns[:, joint] = own[:, joint]
            points[:, joint] = step
        else:
            turns[:, joint] = turns[:, parent] @ own[:, joint]
            step = np.broadcast_to(step, (len(own), 3))
            points[:, joint] = points[:, parent] + np.einsum("fij,fj->fi", turns[:, parent], step)
    return points, turns


def unlike(names: list[str], notes: list[str]) -> list[str]:
    """Names of which none is twice: a second one gets a number, which a note says."""
    out: list[str] = []
    for name in names:
        fresh, number = name, 2
        while fresh in out:
            fresh, number = f"{name}_{number}", number + 1
        if fresh != name:
            notes.append(f"the name {name!r} is there more than once: one of them is now {fresh!r}")
        out.append(fresh)
    return out


def no_clip(path: object, reason: str) -> ClipFileError:
    """The error for a file without a clip."""
    return ClipFileError("clip", str(path), reason)
