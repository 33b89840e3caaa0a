"""What a reader finds in a file, before units, axes, gaps and swapped markers are looked at."""

from __future__ import annotations

import pathlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from wbc.errors import ClipFileError
from wbc.retarget.clip import Array, Marks

#: Keys of frames a second in files of arrays
RATES = ("rate", "fps", "mocap_framerate", "mocap_frame_rate", "frequency", "sample_rate")


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
    seen: Marks | None = None
    unit: float = 0.0
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
            turns[:, joint], points[:, joint] = own[:, joint], step
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


def first_of(data: Mapping[str, Any], keys: Sequence[str]) -> Any:
    """The value of the first of some keys that is there; None where none is."""
    return next((data[key] for key in keys if key in data), None)


def rate_in(data: Mapping[str, Any]) -> float:
    """Frames a second that arrays by name say [Hz]; 0 where they do not."""
    rate = first_of(data, RATES)
    return float(np.ravel(rate)[0]) if rate is not None and np.size(rate) == 1 else 0.0


def text_of(path: pathlib.Path) -> str:
    """What a text file holds, with or without a mark of its byte order; letters of other encodings are left open."""
    try:
        return path.read_bytes().decode("utf-8-sig", errors="replace")
    except OSError as error:
        raise no_clip(path, f"cannot be read: {error}") from error


def no_clip(path: object, reason: str) -> ClipFileError:
    """The error for a file without a clip."""
    return ClipFileError("clip", str(path), reason)
