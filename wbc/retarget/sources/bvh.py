"""BVH files: a hierarchy of joints with channels in any order, and a line of numbers a frame."""

from __future__ import annotations

import pathlib
from collections.abc import Sequence

import numpy as np

from wbc.retarget.clip import Array
from wbc.retarget.sources.recorded import Recorded, no_clip, place, text_of, unlike
from wbc.rotations import exponential

#: Axes of channels, by their first letter
AXES = {"x": 0, "y": 1, "z": 2}
#: Positions of a joint below this share of its offset are counted from the offset, not from the parent
NO_MOVE = 0.1
#: Of each channel: its joint, whether it turns it, and about or along which axis
Channels = list[tuple[int, bool, int]]


def read_bvh(path: pathlib.Path) -> Recorded:
    """A BVH file.

    Raises:
        ClipFileError: it is none, or ends before its second frame; the text says in which line.
    """
    lines = text_of(path).splitlines()
    clip, channels, row = _hierarchy(path, lines)
    table = _motion(path, lines, row, len(channels), clip)
    clip.names = unlike(clip.names, clip.notes)
    offsets = clip.offsets = np.array(clip.offsets)
    own = np.broadcast_to(np.eye(3), (len(table), len(offsets), 3, 3)).copy()
    moves: dict[int, Array] = {}
    for (joint, turning, axis), column in zip(channels, table.T, strict=True):
        if turning:
            own[:, joint] = own[:, joint] @ exponential(np.outer(np.radians(column), np.eye(3)[axis]))
        else:
            moves.setdefault(joint, np.tile(offsets[joint], (len(table), 1)))[:, axis] = column
    for joint, move in moves.items():
        size = float(np.linalg.norm(offsets[joint]))
        known = move[np.isfinite(move).all(axis=1)]
        if clip.parents[joint] >= 0 and len(known) and np.median(np.linalg.norm(known, axis=1)) < NO_MOVE * size:
            move += offsets[joint]
            clip.notes.append(f"positions of {clip.names[joint]} are counted from its offset")
    return place(clip, path, own, moves)


def _hierarchy(path: pathlib.Path, lines: Sequence[str]) -> tuple[Recorded, Channels, int]:
    """The skeleton, its channels, and the row behind MOTION."""
    names: list[str] = []
    parents: list[int] = []
    offsets: list[list[float]] = []
    ends: list[bool] = []
    channels: Channels = []
    open_joints: list[int] = []
    started = False
    for row, line in enumerate(lines):
        words, shown = line.split(), f"line {row + 1}: {line.strip()[:60]!r}"
        if not words:
            continue
        word = words[0].upper()
        if word == "HIERARCHY":
            started = True
        elif not started:
            raise no_clip(path, f"no BVH: {shown}, expected HIERARCHY")
        elif word in ("ROOT", "JOINT", "END"):
            parent, end = open_joints[-1] if open_joints else -1, word == "END"
            if parent < 0 and word != "ROOT":
                raise no_clip(path, f"{shown} outside of a ROOT")
            names.append(f"{names[parent]}End" if end else " ".join(words[1:]).rstrip("{").strip())
            parents.append(parent)
            offsets.append([0.0, 0.0, 0.0])
            ends.append(end)
            open_joints.append(len(names) - 1)
        elif word == "OFFSET" and open_joints:
            offsets[open_joints[-1]] = _numbers(path, row, words[1:], "expected 3", 3).tolist()
        elif word == "CHANNELS" and open_joints:
            if words[1:2] != [str(len(words) - 2)]:
                raise no_clip(path, f"{shown} has another number of channels than it says")
            for kind in words[2:]:
                axis, what = AXES.get(kind[:1].lower()), kind[1:].lower()
                if axis is None or what not in ("position", "rotation"):
                    raise no_clip(path, f"line {row + 1}: unknown channel {kind!r}; expected Xposition ... Zrotation")
                channels.append((open_joints[-1], what == "rotation", axis))
        elif word == "}" and open_joints:
            open_joints.pop()
        elif word == "MOTION":
            if open_joints or not names:
                raise no_clip(path, f"line {row + 1}: the hierarchy is not closed before MOTION")
            clip = Recorded(names, parents, np.zeros((0, 0, 3)), 0.0, np.array(offsets), ends=ends, usual="y")
            return clip, channels, row + 1
        elif word != "{":
            raise no_clip(path, f"{shown} is not understood")
    raise no_clip(path, "the file is empty" if not started else "the file ends before MOTION: it is cut off")


def _motion(path: pathlib.Path, lines: Sequence[str], row: int, columns: int, clip: Recorded) -> Array:
    """Numbers of all frames [frames, channels], NaN where they are none; sets the clip's rate."""
    head: dict[str, float] = {}
    while row < len(lines) and (not lines[row].strip() or ":" in lines[row]):
        name, _, value = lines[row].partition(":")
        if value:
            head[" ".join(name.lower().split())] = _numbers(path, row, value.split()[:1], "expected 1", 1)[0]
        row += 1
    if "frames" not in head:
        raise no_clip(path, "the file ends before the line 'Frames:': it is cut off")
    count, time = int(head["frames"]), head.get("frame time", 0.0)
    given = [(number, words) for number in range(row, len(lines)) if (words := lines[number].split())]
    # Only the last line may be cut off
    if given and len(given[-1][1]) < columns:
        given.pop()
    expected = f"where the hierarchy has {columns} channels"
    table = np.array([_numbers(path, number, words, expected, columns, finite=False) for number, words in given])
    if len(table) < 2:
        raise no_clip(path, f"the file has {len(table)} of {count} frames: a clip has at least 2")
    if len(table) < count:
        clip.notes.append(f"the file is cut off: it has {len(table)} of {count} frames")
    elif len(table) > count:
        clip.notes.append(f"the file has {len(table)} frames and says {count}: all are read")
    # A time of 0 says no rate
    clip.rate = 1.0 / time if time > 0.0 else 0.0
    return np.where(np.isfinite(table), table, np.nan)


def _numbers(
    path: pathlib.Path, row: int, words: Sequence[str], expected: str, count: int, *, finite: bool = True
) -> Array:
    try:
        out = np.array([float(word) for word in words])
    except ValueError as error:
        raise no_clip(path, f"line {row + 1}: {error}") from error
    if len(out) != count:
        raise no_clip(path, f"line {row + 1} has {len(out)} numbers, {expected}")
    if finite and not np.isfinite(out).all():
        raise no_clip(path, f"line {row + 1}: expected finite numbers")
    return out
