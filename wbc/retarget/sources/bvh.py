"""BVH files: a hierarchy of joints with channels in any order, and a line of numbers a frame."""

from __future__ import annotations

import pathlib

import numpy as np

from wbc.retarget.clip import Array
from wbc.retarget.sources.recorded import Recorded, no_clip, text_of, unlike
from wbc.rotations import exponential

#: Axes of channels, by their first letter
AXES = {"x": 0, "y": 1, "z": 2}
#: Lines that are not blank: number and words
Lines = list[tuple[int, list[str]]]
#: Of each channel: its joint, whether it turns it, and about or along which axis
Channels = list[tuple[int, bool, int]]


def read_bvh(path: pathlib.Path) -> Recorded:
    """A BVH file; :class:`ClipFileError`, with the line, where it is none or ends before its second frame."""
    lines = [(row, words) for row, line in enumerate(text_of(path).splitlines(), 1) if (words := line.split())]
    motion = next((k for k, (_, words) in enumerate(lines) if words[0].upper() == "MOTION"), len(lines))
    clip, channels = _hierarchy(path, lines[: motion + 1])
    table = _motion(path, lines[motion + 1 :], len(channels), clip)
    offsets = np.asarray(clip.offsets)
    own = np.broadcast_to(np.eye(3), (len(table), len(offsets), 3, 3)).copy()
    moves: dict[int, Array] = {}
    for (joint, turning, axis), column in zip(channels, table.T, strict=True):
        if turning:
            own[:, joint] = own[:, joint] @ exponential(np.outer(np.radians(column), np.eye(3)[axis]))
        else:
            moves.setdefault(joint, np.tile(offsets[joint], (len(table), 1)))[:, axis] = column
    return clip.place(path, own, moves)


def _hierarchy(path: pathlib.Path, lines: Lines) -> tuple[Recorded, Channels]:
    """The skeleton and its channels, of the lines up to MOTION."""
    names, parents, offsets, ends = list[str](), list[int](), list[Array](), list[bool]()
    channels, inside, word = Channels(), list[int](), ""
    for number, (row, (first, *words)) in enumerate(lines):
        word, shown = first.upper(), f"line {row}: {' '.join([first, *words])[:60]!r}"
        if number == 0:
            if word != "HIERARCHY":
                raise no_clip(path, f"no BVH: {shown}, expected HIERARCHY")
        elif word == "ROOT" or (word in ("JOINT", "END") and inside):
            parent, end = inside[-1] if inside else -1, word == "END"
            inside.append(len(names))
            names.append(f"{names[parent]}End" if end else " ".join(words).rstrip("{").strip())
            parents.append(parent)
            offsets.append(np.zeros(3))
            ends.append(end)
        elif word == "OFFSET" and inside:
            offsets[inside[-1]] = _numbers(path, row, words, 3)
        elif word == "CHANNELS" and inside:
            if words[:1] != [str(len(words) - 1)]:
                raise no_clip(path, f"{shown} has another number of channels than it says")
            for kind in words[1:]:
                axis, what = AXES.get(kind[:1].lower()), kind[1:].lower()
                if axis is None or what not in ("position", "rotation"):
                    raise no_clip(path, f"line {row}: unknown channel {kind!r}; expected Xposition ... Zrotation")
                channels.append((inside[-1], what == "rotation", axis))
        elif word == "}" and inside:
            inside.pop()
        elif word == "MOTION" and (inside or not names):
            raise no_clip(path, f"line {row}: the hierarchy is not closed before MOTION")
        elif word not in ("{", "MOTION"):
            raise no_clip(path, f"{shown} is not understood")
    if word != "MOTION":
        raise no_clip(path, "the file ends before MOTION: it is cut off" if lines else "the file is empty")
    notes: list[str] = []
    names = unlike(names, notes)
    points = np.zeros((0, len(names), 3))
    return Recorded(names, parents, points, offsets=np.array(offsets), ends=ends, notes=notes), channels


def _motion(path: pathlib.Path, lines: Lines, columns: int, clip: Recorded) -> Array:
    """Numbers of all frames [frames, channels], NaN where they are none; sets the clip's rate."""
    head: dict[str, float] = {}
    while lines and ":" in " ".join(lines[0][1]):
        row, words = lines.pop(0)
        name, _, value = " ".join(words).lower().partition(":")
        if value:
            head[name.strip()] = float(_numbers(path, row, value.split()[:1], 1)[0])
    if "frames" not in head:
        raise no_clip(path, "the file ends before the line 'Frames:': it is cut off")
    # Only the last line may be cut off
    if lines and len(lines[-1][1]) < columns:
        lines.pop()
    expected = f"where the hierarchy has {columns} channels"
    table = np.array([_numbers(path, row, words, columns, expected) for row, words in lines])
    count, time = int(head["frames"]), head.get("frame time", 0.0)
    if len(table) < 2:
        raise no_clip(path, f"the file has {len(table)} of {count} frames: a clip has at least 2")
    if len(table) < count:
        clip.notes.append(f"the file is cut off: it has {len(table)} of {count} frames")
    elif len(table) > count:
        clip.notes.append(f"the file has {len(table)} frames and says {count}: all are read")
    # A time of 0 says no rate
    clip.rate = 1.0 / time if time > 0.0 else 0.0
    return np.where(np.isfinite(table), table, np.nan)


def _numbers(path: pathlib.Path, row: int, words: list[str], count: int, expected: str = "") -> Array:
    """The numbers of a line; those that are ``expected`` of frames may be none."""
    try:
        out = np.array([float(word) for word in words])
    except ValueError as error:
        raise no_clip(path, f"line {row}: {error}") from error
    if len(out) != count:
        raise no_clip(path, f"line {row} has {len(out)} numbers, {expected or f'expected {count}'}")
    if not expected and not np.isfinite(out).all():
        raise no_clip(path, f"line {row}: expected finite numbers")
    return out
