"""What a reader finds in a file, before units, axes, gaps and swapped markers are looked at."""

from __future__ import annotations

import pathlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from wbc.errors import ClipFileError
from wbc.retarget.clip import Array, Marks
from wbc.retarget.sources.mending import between
from wbc.rotations import continuous_quaternions

#: Keys of frames a second in files of arrays
RATES = ("rate", "fps", "mocap_framerate", "mocap_frame_rate", "frequency", "sample_rate")


@dataclass
class Recorded:
    """A clip as its file has it, along the file's axes; NaN where a point is missing, rate 0 where it is not said.

    Attributes:
        parents: number of each joint's parent; -1 at roots and where nothing is known.
        offsets: from the parent in the rest pose, along its axes [joints, 3]; None where there is none.
        turns: rotations from the rest pose, from its axes to the file's [frames, joints, 3, 3]; None: points alone.
        ends: joints that only end a bone. seen: whether a point was there; None: where it is not NaN.
    """

    names: list[str]
    parents: list[int]
    points: Array
    rate: float = 0.0
    offsets: Array | None = None
    turns: Array | None = None
    ends: list[bool] = field(default_factory=list)
    seen: Marks | None = None
    notes: list[str] = field(default_factory=list)

    def place(self, path: pathlib.Path, own: Array, moves: dict[int, Array]) -> Recorded:
        """Points and rotations of its tree; numbers that are missing are filled in between their neighbours.

            R_j = R_parent R_own,j        p_j = p_parent + R_parent d_j

        Of R_own [frames, joints, 3, 3], and of d where it is not a joint's offset, by joint [frames, 3].
        """
        points = np.broadcast_to(np.asarray(self.offsets), own.shape[:3]).copy()
        for joint, move in moves.items():
            points[:, joint] = move
        turns, seen = own.copy(), np.isfinite(own).all(axis=(2, 3)) & np.isfinite(points).all(axis=2)
        if not seen.all():
            lacking = f"{int((~seen.all(axis=1)).sum())} of {len(own)} frames"
            self.notes.append(f"numbers are missing in {lacking}: filled in between their neighbours")
        for joint, parent in enumerate(self.parents):
            good = np.flatnonzero(seen[:, joint])
            if not good.size:
                raise no_clip(path, f"a channel of {self.names[joint]} has no number in any frame")
            if good.size < len(own):
                points[:, joint] = between(points[:, joint])
                known = np.full((len(own), 4), np.nan)
                known[good] = continuous_quaternions(Rotation.from_matrix(own[good, joint]).as_quat())
                turns[:, joint] = Rotation.from_quat(between(known)).as_matrix()
            if parent >= 0:
                above = turns[:, parent]
                turns[:, joint] = above @ turns[:, joint]
                points[:, joint] = points[:, parent] + np.einsum("fij,fj->fi", above, points[:, joint])
                seen[:, joint] &= seen[:, parent]
        self.points, self.turns, self.seen = points, turns, seen
        return self


def unlike(names: Sequence[str], notes: list[str]) -> list[str]:
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
    rate = np.ravel(first_of(data, RATES))
    return float(rate[0]) if rate.size == 1 and rate.dtype.kind in "fiu" else 0.0


def text_of(path: pathlib.Path) -> str:
    """What a text file holds, with or without a mark of its byte order; letters of other encodings are left open."""
    try:
        return path.read_bytes().decode("utf-8-sig", errors="replace")
    except OSError as error:
        raise no_clip(path, f"cannot be read: {error}") from error


def no_clip(path: object, reason: str) -> ClipFileError:
    """The error for a file without a clip."""
    return ClipFileError("clip", str(path), reason)
