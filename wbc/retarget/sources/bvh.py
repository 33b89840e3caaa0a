"""BVH files: a hierarchy of joints with channels in any order, and a line of numbers a frame."""

from __future__ import annotations

import pathlib
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from wbc.retarget.clip import Array
from wbc.retarget.sources.recorded import Recorded, in_the_world, no_clip, text_of, unlike
from wbc.rotations import exponential

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
    lines = text_of(path).splitlines()
    notes: list[str] = []
    tree, row = _hierarchy(path, lines)
    table, rate = _motion(path, lines, row, len(tree.channels), notes)
    offsets, names = np.array(tree.offsets), unlike(tree.names, notes)
    missing = ~np.isfinite(table)
    seen = np.ones((len(table), len(names)), dtype=bool)
    if missing.any():
        for joint, parent in enumerate(tree.parents):
            columns = [column for column, (of, _, _) in enumerate(tree.channels) if of == joint]
            seen[:, joint] = ~missing[:, columns].any(axis=1) & (True if parent < 0 else seen[:, parent])
        for column, (joint, turning, _) in enumerate(tree.channels):
            good = np.flatnonzero(~missing[:, column])
            if not good.size:
                raise no_clip(path, f"a channel of {names[joint]} has no number in any frame")
            if good.size < len(table):
                # Angles go the short way round
                values = np.unwrap(table[good, column], period=360.0) if turning else table[good, column]
                table[:, column] = np.interp(np.arange(len(table)), good, values)
        lacking = f"{int(missing.any(axis=1).sum())} of {len(table)} frames"
        notes.append(f"numbers are missing in {lacking}: filled in between their neighbours")
    own = np.broadcast_to(np.eye(3), (len(table), len(names), 3, 3)).copy()
    moves: dict[int, Array] = {}
    for column, (joint, turning, axis) in enumerate(tree.channels):
        if turning:
            own[:, joint] = own[:, joint] @ exponential(np.outer(np.radians(table[:, column]), np.eye(3)[axis]))
        else:
            moves.setdefault(joint, np.tile(offsets[joint], (len(table), 1)))[:, axis] = table[:, column]
    for joint, move in moves.items():
        size = float(np.linalg.norm(offsets[joint]))
        if tree.parents[joint] >= 0 and size > 0 and np.median(np.linalg.norm(move, axis=1)) < NO_MOVE * size:
            move += offsets[joint]
            notes.append(f"positions of {names[joint]} are counted from its offset")
    points, turns = in_the_world(tree.parents, offsets, own, moves)
    return Recorded(names, tree.parents, points, rate, offsets, turns, tree.ends, seen, usual="y", notes=notes)


def _hierarchy(path: pathlib.Path, lines: Sequence[str]) -> tuple[_BvhTree, int]:
    """The tree, and the row behind MOTION."""
    tree, started = _BvhTree(), False
    open_joints: list[int] = []
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
            tree.names.append(f"{tree.names[parent]}End" if end else " ".join(words[1:]).rstrip("{").strip())
            tree.parents.append(parent)
            tree.offsets.append([0.0, 0.0, 0.0])
            tree.ends.append(end)
            open_joints.append(len(tree.names) - 1)
        elif word == "OFFSET" and open_joints:
            tree.offsets[open_joints[-1]] = _numbers(path, row, words[1:], "expected 3", 3)
        elif word == "CHANNELS" and open_joints:
            if words[1:2] != [str(len(words) - 2)]:
                raise no_clip(path, f"{shown} has another number of channels than it says")
            for kind in words[2:]:
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
            raise no_clip(path, f"{shown} is not understood")
    raise no_clip(path, "the file is empty" if not started else "the file ends before MOTION: it is cut off")


def _motion(path: pathlib.Path, lines: Sequence[str], row: int, columns: int, notes: list[str]) -> tuple[Array, float]:
    """Numbers of all frames [frames, channels], and frames a second [Hz]."""
    head: dict[str, float] = {}
    while row < len(lines) and (not lines[row].strip() or ":" in lines[row]):
        name, _, value = lines[row].partition(":")
        if value:
            head[name.strip().lower()] = _numbers(path, row, value.split()[:1], "expected 1")[0]
        row += 1
    if "frames" not in head:
        raise no_clip(path, "the file ends before the line 'Frames:': it is cut off")
    count, time = int(head["frames"]), head.get("frame time", 0.0)
    given = [(number, words) for number in range(row, len(lines)) if (words := lines[number].split())]
    # Only the last line may be cut off
    if given and len(given[-1][1]) < columns:
        given.pop()
    expected = f"where the hierarchy has {columns} channels"
    table = np.array([_numbers(path, number, words, expected, columns) for number, words in given])
    if len(table) < 2:
        raise no_clip(path, f"the file has {len(table)} of {count} frames: a clip has at least 2")
    if len(table) < count:
        notes.append(f"the file is cut off: it has {len(table)} of {count} frames")
    elif len(table) > count:
        notes.append(f"the file has {len(table)} frames and says {count}: all are read")
    # A time of 0 says no rate
    return table, 1.0 / time if time > 0.0 else 0.0


def _numbers(path: pathlib.Path, row: int, words: Sequence[str], expected: str, count: int = 1) -> list[float]:
    try:
        out = [float(word) for word in words]
    except ValueError as error:
        raise no_clip(path, f"line {row + 1}: {error}") from error
    if len(out) != count:
        raise no_clip(path, f"line {row + 1} has {len(out)} numbers, {expected}")
    return out
