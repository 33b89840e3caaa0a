"""Key points without a skeleton: arrays, and tables with names in their header."""

from __future__ import annotations

import csv
import pathlib
import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import ShapeError
from wbc.retarget.clip import Array, listed
from wbc.retarget.sources.layouts import LAYOUTS, best_layout, parents_by_name
from wbc.retarget.sources.recorded import Recorded, first_of, no_clip, rate_in, text_of, unlike

#: Keys of an npz with points
POINTS = (
    "points", "positions", "global_joint_positions", "joints", "joint_positions", "keypoints", "keypoints3d", "markers",
)  # fmt: skip
#: With names of joints
NAMES = ("names", "joint_names", "labels", "joints_names", "marker_names", "bones")
#: With numbers of parents
PARENTS = ("parents", "joint_parents", "parent_indices")
#: The end of a column's name that says which coordinate it is
COLUMN = re.compile(r"^(.*?)[\s_.:\-\[(]*([xyzXYZ])[\])]?\s*(?:[\[(](?:mm|cm|m)[\])])?$")
#: Columns of time
TIMES = ("t", "time", "time [s]", "time_s", "timestamp", "seconds")
#: Columns that are left out
COUNTERS = ("frame", "frames", "frame#", "index", "")
#: Columns of InterMimic's tensors
INTERMIMIC_COLUMNS = 591
#: The first of them of 52 joints' positions
INTERMIMIC_FIRST = 162

Names = str | Sequence[str] | None


def read_npz(path: pathlib.Path, data: dict[str, Any], names: Names) -> Recorded:
    """Arrays by name: points and, where they are there, names, parents and frames a second."""
    points, named, parents = (first_of(data, keys) for keys in (POINTS, NAMES, PARENTS))
    if points is None:
        there = ", ".join(data) or "nothing"
        raise no_clip(path, f"no points: it has {there}, and points are called {', '.join(POINTS)}")
    clip = of_points(path, points, list(map(str, np.ravel(named))) if names is None and named is not None else names)
    clip.rate = rate_in(data)
    if parents is not None:
        given = np.ravel(parents)
        if len(given) == len(clip.names) and given.dtype.kind in "iuf" and (given < np.arange(len(given))).all():
            clip.parents = np.maximum(given, -1).astype(int).tolist()
        else:
            clip.notes.append("parents that are no numbers of joints before their children are left out")
    return clip


def read_csv(path: pathlib.Path, names: Names) -> Recorded:
    """A table whose header names the columns, such as ``LeftFoot_x``, ``LeftFoot_y``, ``LeftFoot_z``, and a time."""
    lines = text_of(path).splitlines()
    try:
        rows = list(csv.reader(lines, delimiter=max(",;\t", key="".join(lines[:1]).count)))
    except csv.Error as error:
        raise no_clip(path, f"no table: {error}") from error
    header = [cell.strip() for cell in rows[0]] if rows else []
    places: dict[tuple[str, str], int] = {}
    for number, title in enumerate(header):
        match = COLUMN.match(title)
        name = match[1].strip() if match else ""
        if match and name and places.setdefault((name, match[2].lower()), number) != number:
            raise no_clip(path, f"two columns {title}")
    joints = [name for name, axis in places if axis == "x" and (name, "y") in places and (name, "z") in places]
    if not joints:
        raise no_clip(path, f"no header with names such as LeftFoot_x, LeftFoot_y, LeftFoot_z: {', '.join(header[:6])}")
    clock = [number for number, title in enumerate(header) if title.lower() in TIMES][:1]
    used, table = [places[name, axis] for name in joints for axis in "xyz"] + clock, list[list[float]]()
    other = [title for number, title in enumerate(header) if number not in used and title.lower() not in COUNTERS]
    given = [(number, row) for number, row in enumerate(rows[1:], 2) if row]
    cut = len(given) > 1 and len(given[-1][1]) < len(header)
    for number, row in given[: len(given) - cut]:
        try:
            table.append([float(row[k].strip() or "nan") if k < len(row) else np.nan for k in used])
        except ValueError as error:
            raise no_clip(path, f"line {number}: {error}") from error
    values = np.array(table).reshape(-1, len(used))
    clip = of_points(path, values[:, : 3 * len(joints)], joints if names is None else names)
    clip.notes += [f"columns that are no points: {listed(other)}"] if other else []
    clip.notes += ["the file is cut off: its last line is left out"] if cut else []
    if clock:
        steps = np.diff(values[:, -1])
        step = float(np.nanmedian(steps)) if np.isfinite(steps).any() else np.nan
        if not step > 0.0 or np.nanmax(np.abs(steps - step)) > 0.5 * step:
            raise no_clip(path, f"times of column {header[clock[0]]!r} do not rise in equal steps")
        clip.rate = 1.0 / step
    return clip


def of_points(path: pathlib.Path, points: Array, names: Names) -> Recorded:
    """A clip of points [frames, joints, 3], or in columns, with names, or those of a layout, and parents as far as they
    are known; :class:`ClipFileError`, UnknownNameError and ShapeError of what is none.
    """
    given = np.asarray(points)
    if given.dtype.kind not in "fiu" or given.ndim not in (2, 3) or 0 in given.shape:
        raise no_clip(path, f"expected points [frames, joints, 3], not {given.dtype} {list(given.shape)}")
    if path.suffix.lower() == ".pt" and given.shape[1:] == (INTERMIMIC_COLUMNS,):
        given = given[:, INTERMIMIC_FIRST : INTERMIMIC_FIRST + 52 * 3]
        names = "smplh-mujoco" if names is None else names
    if given.ndim == 2 and given.shape[1] % 3 == 0:
        given = given.reshape(len(given), -1, 3)
    if given.ndim != 3 or given.shape[2] != 3:
        raise no_clip(path, f"expected points [frames, joints, 3], not {list(given.shape)}")
    if len(given) < 2:
        raise no_clip(path, f"the file has {len(given)} frames: a clip has at least 2")
    count = given.shape[1]
    clip = Recorded([], [], np.where(np.isfinite(given), given, np.nan).astype(np.float64))
    if names is None:
        names = best_layout(clip.points)
        if not names:
            counts = ", ".join(map(str, sorted({len(layout.names) for layout in LAYOUTS.values()})))
            raise no_clip(path, f"{count} joints without names; give names= (known are layouts of {counts} joints)")
        clip.notes.append(f"names and parents are those of the layout {names!r}")
    if isinstance(names, str):
        own, parents = LAYOUTS[validation.one_of("names", names, LAYOUTS)]
        if len(own) != count:
            raise ShapeError("names", names, f"this layout has {len(own)} joints, the file {count}")
        clip.names, clip.parents = list(own), list(parents)
    else:
        clip.names = unlike(validation.strings("names", names), clip.notes)
        if len(clip.names) != count:
            raise ShapeError("names", names, f"expected {count} names, one a joint, not {len(clip.names)}")
        clip.parents = parents_by_name(clip.names)
    return clip
