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
from wbc.retarget.sources.layouts import LAYOUTS, best_layout, parents_by_name, parents_of
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
COLUMN = re.compile(r"^(.*?)[\s_.:\-\[(]*([xyzXYZ])[\])]?\s*(?:[\[(](mm|cm|m)[\])])?$")
#: Units of columns [m]
COLUMN_UNITS = {"mm": 0.001, "cm": 0.01, "m": 1.0}
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
    if names is None and named is not None:
        names = [str(name) for name in np.ravel(named)]
    clip = of_points(path, points, names)
    clip.rate = rate_in(data)
    if parents is not None:
        given = np.ravel(parents)
        if len(given) == len(clip.names) and given.dtype.kind in "iuf" and (given < np.arange(len(given))).all():
            clip.parents = np.maximum(given, -1).astype(int).tolist()
        else:
            clip.notes.append("parents that are no numbers of joints before their children are left out")
    if "unit" in data:
        clip.notes.append(f"the file's unit is {data['unit']}")
    return clip


def read_csv(path: pathlib.Path, names: Names) -> Recorded:
    """A table whose header names the columns, such as ``LeftFoot_x``, ``LeftFoot_y``, ``LeftFoot_z``, and a time."""
    text = text_of(path)
    title = text.partition("\n")[0]
    try:
        rows = [row for row in csv.reader(text.splitlines(), delimiter=max(",;\t", key=title.count)) if row]
    except csv.Error as error:
        raise no_clip(path, f"no table: {error}") from error
    if not rows:
        raise no_clip(path, "the file is empty")
    header = [cell.strip() for cell in rows.pop(0)]
    columns: dict[str, dict[str, int]] = {}
    other: list[str] = []
    unit, clock = 0.0, -1
    for number, title in enumerate(header):
        match = COLUMN.match(title)
        if match and match[1].strip():
            axes = columns.setdefault(match[1].strip(), {})
            if axes.setdefault(match[2].lower(), number) != number:
                raise no_clip(path, f"two columns {title}")
            unit = COLUMN_UNITS.get(match[3] or "", unit)
        elif title.lower() in TIMES:
            clock = number if clock < 0 else clock
        elif title.lower() not in COUNTERS:
            other.append(title)
    joints = [name for name, places in columns.items() if set(places) == {"x", "y", "z"}]
    other += [name for name in columns if name not in joints]
    if not joints:
        raise no_clip(path, f"no header with names such as LeftFoot_x, LeftFoot_y, LeftFoot_z: {', '.join(header[:6])}")
    cut = len(rows) > 1 and len(rows[-1]) < len(header)
    used = [*(columns[name][axis] for name in joints for axis in "xyz"), *([clock] if clock >= 0 else [])]
    table = np.full((len(rows) - cut, len(used)), np.nan)
    for frame, row in enumerate(rows[: len(table)]):
        for place, column in enumerate(used):
            try:
                table[frame, place] = float(row[column].strip() or "nan") if column < len(row) else np.nan
            except ValueError as error:
                raise no_clip(path, f"line {frame + 2}, column {header[column]!r}: {error}") from error
    clip = of_points(path, table[:, : 3 * len(joints)], joints if names is None else names)
    clip.notes += [f"columns that are no points: {listed(other, 6)}"] if other else []
    clip.notes += ["the file is cut off: its last line is left out"] if cut else []
    clip.unit = unit
    if clock >= 0:
        steps = np.diff(table[:, -1])
        step = float(np.nanmedian(steps)) if np.isfinite(steps).any() else np.nan
        if not step > 0.0 or np.nanmax(np.abs(steps - step)) > 0.5 * step:
            raise no_clip(path, f"times of column {header[clock]!r} do not rise in equal steps")
        clip.rate = 1.0 / step
    return clip


def of_points(path: pathlib.Path, points: Array, names: Names) -> Recorded:
    """A clip of points, with names and parents as far as they are known.

    Args:
        points: [frames, joints, 3], or in columns, or InterMimic's tensor of 591 columns.
        names: of the joints; or of a layout: a key of :data:`~wbc.retarget.sources.layouts.LAYOUTS`.

    Raises:
        ClipFileError: no points of joints. UnknownNameError: no such layout. ShapeError: another number of names.
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
    clip = Recorded([], [], np.where(np.isfinite(given), given, np.nan).astype(np.float64), 0.0)
    if names is None:
        names = best_layout(clip.points)
        if not names:
            counts = ", ".join(map(str, sorted({len(joints) for joints in LAYOUTS.values()})))
            raise no_clip(path, f"{count} joints without names; give names= (known are layouts of {counts} joints)")
        clip.notes.append(f"names and parents are those of the layout {names!r}")
    if isinstance(names, str):
        layout = LAYOUTS[validation.one_of("names", names, LAYOUTS)]
        if len(layout) != count:
            raise ShapeError("names", names, f"this layout has {len(layout)} joints, the file {count}")
        clip.names, clip.parents = [name for name, _ in layout], parents_of(layout)
    else:
        clip.names = unlike(list(validation.strings("names", names)), clip.notes)
        if len(clip.names) != count:
            raise ShapeError("names", names, f"expected {count} names, one a joint, not {len(clip.names)}")
        clip.parents = parents_by_name(clip.names)
    return clip
