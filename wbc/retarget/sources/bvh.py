"""BVH files: a hierarchy of joints with channels in any order, and a line of numbers a frame."""

from __future__ import annotations

import pathlib
from dataclasses import dataclass, field

import numpy as np

from wbc import validation
from wbc.errors import ClipFileError
from wbc.retarget.sources.recorded import Recorded, in_the_world, no_clip, unlike
from wbc.validation import Array

#: Axes of channels, by their first letter
AXES = {"x": 0, "y": 1, "z": 2}
#: Positions of a joint below this share of its offset are counted from the offset, not from the parent
NO_MOVE = 0.1


@dataclass
class _BvhTree:
    """The part above MOTION: joints in order, and (joint, whether it turns, axis) of each channel."""

    names: list[str] = field(default_factory=list)
    parents: list[int] = field(default_factory=list)
    offsets: list[list[float]] = field(default_factory=list)
    ends: list[bool] = field(default_factory=list)
    channels: list[tuple[int, bool, int]] = field(default_factory=list)


def read_bvh(path: pathlib.Path) -> Recorded:
    """A BVH file.

    Raises:
        ClipFileError: it is none, or ends before its second frame; the text says in which line.
    """
    lines = validation.text_of("clip", path, ClipFileError).splitlines()
    tree, row = _hierarchy(path, lines)
    notes: list[str] = []
    count, rate, row = _motion_head(path, lines, row)
    table = _frames(path, lines[row:], row, len(tree.channels), count, notes)
    offsets = np.array(tree.offsets)
    names = unlike(tree.names, notes)
    missing = np.isnan(table)
    seen = np.ones((len(table), len(names)), dtype=bool)
    if missing.any():
        for joint, parent in enumerate(tree.parents):
            columns = [column for column, (of, _, _) in enumerate(tree.channels) if of == joint]
            seen[:, joint] = ~missing[:, columns].any(axis=1) & (True if parent < 0 else seen[:, parent])
        table = _filled(path, table, tree, notes)
    own = np.broadcast_to(np.eye(3), (len(table), len(names), 3, 3)).copy()
    moves: dict[int, Array] = {}
    for column, (joint, turning, axis) in enumerate(tree.channels):
        if turning:
            own[:, joint] = own[:, joint] @ _turn(axis, np.radians(table[:, column]))
        else:
            moves.setdefault(joint, np.tile(offsets[joint], (len(table), 1)))[:, axis] = table[:, column]
    for joint, move in moves.items():
        size = float(np.linalg.norm(offsets[joint]))
        if tree.parents[joint] >= 0 and size > 0 and np.median(np.linalg.norm(move, axis=1)) < NO_MOVE * size:
            move += offsets[joint]
            notes.append(f"positions of {names[joint]} are counted from its offset")
    points, turns = in_the_world(tree.parents, offsets, own, moves)
    return Recorded(
        names, tree.parents, points, rate, offsets, turns, tree.ends, seen, usual="y", notes=notes,
    )  # fmt: skip


def _hierarchy(path: pathlib.Path, lines: list[str]) -> tuple[_BvhTree, int]:
    tree, started = _BvhTree(), False
    open_joints: list[int] = []
    for row, line in enumerate(lines):
        words = line.split()
        if not words:
            continue
        word = words[0].upper()
        if word == "HIERARCHY":
            started = True
        elif not started:
            raise no_clip(path, f"no BVH: line {row + 1} is {line.strip()[:40]!r}, expected HIERARCHY")
        elif word in ("ROOT", "JOINT") or word == "END":
            parent = open_joints[-1] if open_joints else -1
            end = word == "END"
            if parent < 0 and word != "ROOT":
                raise no_clip(path, f"line {row + 1}: a {words[0]} outside of a ROOT")
            tree.names.append(f"{tree.names[parent]}End" if end else " ".join(words[1:]).rstrip("{").strip())
            tree.parents.append(parent)
            tree.offsets.append([0.0, 0.0, 0.0])
            tree.ends.append(end)
            open_joints.append(len(tree.names) - 1)
        elif word == "OFFSET" and open_joints:
            tree.offsets[open_joints[-1]] = _numbers(path, row, words[1:], 3)
        elif word == "CHANNELS" and open_joints:
            kinds = words[2:]
            if len(words) < 2 or not words[1].isdigit() or int(words[1]) != len(kinds):
                raise no_clip(
                    path, f"line {row + 1}: {line.strip()[:60]!r} has another number of channels than it says"
                )
            for kind in kinds:
                axis, what = AXES.get(kind[:1].lower()), kind[1:].lower()
                if axis is None or what not in ("position", "rotation"):
                    raise no_clip(path, f"line {row + 1}: unknown channel {kind!r}; expected Xposition ... Zrotation")
                tree.channels.append((open_joints[-1], what == "rotation", axis))
        elif word == "}" and open_joints:
            open_joints.pop()
        elif word == "MOTION":
            if open_joints or not tree.names:
                raise no_clip(path, f"line {row + 1}: the hierarchy is not closed before MOTION")
            return tree, row + 1
        elif word != "{":
            raise no_clip(path, f"line {row + 1}: {line.strip()[:40]!r} is not understood")
    raise no_clip(path, "the file is empty" if not started else "the file ends before MOTION: it is cut off")


def _motion_head(path: pathlib.Path, lines: list[str], row: int) -> tuple[int, float, int]:
    """Number of frames, frames a second, and the row of the first frame."""
    count, time = -1, -1.0
    first = row
    for row in range(first, len(lines)):
        name, colon, value = lines[row].partition(":")
        if not lines[row].strip():
            continue
        if not colon:
            break
        number = _numbers(path, row, value.split()[:1], 1)[0]
        if name.strip().lower() == "frames":
            count = int(number)
        elif name.strip().lower() == "frame time":
            time = number
    if count < 0:
        raise no_clip(path, "the file ends before the line 'Frames:': it is cut off")
    # A time of 0 says no rate
    return count, 1.0 / time if time > 0.0 else 0.0, row


def _frames(path: pathlib.Path, lines: list[str], row: int, columns: int, count: int, notes: list[str]) -> Array:
    rows = []
    for number, line in enumerate(lines):
        words = line.split()
        if not words:
            continue
        if len(words) != columns:
            # Only the last line may be cut off
            if any(rest.strip() for rest in lines[number + 1 :]) or len(words) > columns:
                reason = f"line {row + number + 1} has {len(words)} numbers, where the hierarchy has {columns} channels"
                raise no_clip(path, reason)
            break
        rows.append(_numbers(path, row + number, words, columns))
    if len(rows) < 2:
        raise no_clip(path, f"the file has {len(rows)} of {count} frames: a clip has at least 2")
    if len(rows) < count:
        notes.append(f"the file is cut off: it has {len(rows)} of {count} frames")
    elif len(rows) > count:
        notes.append(f"the file has {len(rows)} frames and says {count}: all are read")
    return np.array(rows)


def _numbers(path: pathlib.Path, row: int, words: list[str], count: int) -> list[float]:
    try:
        out = [float(word) for word in words]
    except ValueError as error:
        raise no_clip(path, f"line {row + 1}: {error}") from error
    if len(out) != count:
        raise no_clip(path, f"line {row + 1} has {len(out)} numbers, expected {count}")
    return out


def _filled(path: pathlib.Path, table: Array, tree: _BvhTree, notes: list[str]) -> Array:
    """Channels without gaps: angles go the short way round."""
    out = np.where(np.isfinite(table), table, np.nan)
    frames = np.arange(len(out))
    for column, (joint, turning, _) in enumerate(tree.channels):
        good = np.isfinite(out[:, column])
        if good.all():
            continue
        if not good.any():
            raise no_clip(path, f"a channel of {tree.names[joint]} has no number in any frame")
        values = np.unwrap(out[good, column], period=360.0) if turning else out[good, column]
        out[:, column] = np.interp(frames, frames[good], values)
    gaps = int((~np.isfinite(table)).any(axis=1).sum())
    notes.append(f"numbers are missing in {gaps} of {len(out)} frames: filled in between their neighbours")
    return out


def _turn(axis: int, angles: Array) -> Array:
    cosines, sines = np.cos(angles), np.sin(angles)
    out = np.zeros((len(angles), 3, 3))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    out[:, axis, axis] = 1.0
    out[:, i, i] = out[:, j, j] = cosines
    out[:, j, i], out[:, i, j] = sines, -sines
    return out
