"""Key points without a skeleton: arrays of npy, npz and torch files, and tables with names in their header."""

from __future__ import annotations

import csv
import pathlib
import pickle
import re
import zipfile
import zlib
from collections.abc import Sequence
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import ClipFileError, ShapeError, UnknownNameError
from wbc.retarget.sources.layouts import LAYOUTS, best_layout, parents_by_name, parents_of
from wbc.retarget.sources.recorded import Recorded, no_clip
from wbc.validation import Array

#: Keys of an npz with points, with names of joints, with frames a second, and with parents
POINTS = (
    "points", "positions", "global_joint_positions", "joints", "joint_positions", "keypoints", "keypoints3d", "markers",
)  # fmt: skip
NAMES = ("names", "joint_names", "labels", "joints_names", "marker_names", "bones")
RATES = ("rate", "fps", "mocap_framerate", "mocap_frame_rate", "frequency", "sample_rate")
PARENTS = ("parents", "joint_parents", "parent_indices")
#: The end of a column's name that says which coordinate it is
COLUMN = re.compile(r"^(.*?)[\s_.:\-\[(]*([xyzXYZ])[\])]?\s*(?:[\[(](mm|cm|m)[\])])?$")
#: Columns of time
TIMES = ("t", "time", "time [s]", "time_s", "timestamp", "seconds")
#: Columns that are left out
COUNTERS = ("frame", "frames", "frame#", "index", "")
#: Columns of InterMimic's tensors
INTERMIMIC_COLUMNS = 591
#: The first of them of 52 joints' positions
INTERMIMIC_FIRST = 162
#: What numpy and zipfile raise for files that are cut off or no files of theirs
BROKEN = (OSError, ValueError, EOFError, KeyError, TypeError, zipfile.BadZipFile, zlib.error, pickle.UnpicklingError)


def read_npy(path: pathlib.Path, names: str | Sequence[str] | None) -> Recorded:
    """An array [frames, joints, 3].

    Raises:
        ClipFileError: it is none.
    """
    try:
        points = np.load(path, allow_pickle=False)
    except BROKEN as error:
        raise no_clip(path, f"no array that numpy can read: {error}") from error
    if not isinstance(points, np.ndarray):
        raise no_clip(path, "several arrays; a file of one ends with .npy, of several with .npz")
    return of_points(path, points, names)


def read_npz(path: pathlib.Path, names: str | Sequence[str] | None) -> Recorded:
    """Arrays by name: points and, where they are there, names, parents and frames a second."""
    data = arrays_of(path)
    key = next((name for name in POINTS if name in data), "")
    if not key:
        there = ", ".join(data) or "nothing"
        raise no_clip(path, f"no points: it has {there}, and points are called {', '.join(POINTS)}")
    named = next((data[name] for name in NAMES if name in data), None)
    if names is None and named is not None:
        names = [str(name) for name in np.ravel(named)]
    clip = of_points(path, data[key], names)
    rate = next((data[name] for name in RATES if name in data), None)
    if rate is not None and np.size(rate) == 1:
        clip.rate = float(np.ravel(rate)[0])
    parents = next((data[name] for name in PARENTS if name in data), None)
    if parents is not None and np.size(parents) == len(clip.names):
        given = [int(parent) for parent in np.ravel(parents)]
        if all(parent < joint for joint, parent in enumerate(given)):
            clip.parents = given
        else:
            clip.notes.append("parents that come after their children are left out")
    if "unit" in data:
        clip.notes.append(f"the file's unit is {data['unit']}")
    return clip


def arrays_of(path: pathlib.Path) -> dict[str, Any]:
    """The arrays of an npz, without those that only a pickle holds.

    Raises:
        ClipFileError: it is none, or is cut off.
    """
    try:
        with np.load(path, allow_pickle=False) as data:
            out = {}
            for name in data.files:
                try:
                    out[name] = data[name]
                except ValueError as error:
                    if "pickle" not in str(error):
                        raise
            return out
    except BROKEN as error:
        raise no_clip(path, f"no npz that can be read, or it is cut off: {error}") from error


def read_csv(path: pathlib.Path, names: str | Sequence[str] | None) -> Recorded:
    """A table whose header names the columns, such as ``LeftFoot_x``, ``LeftFoot_y``, ``LeftFoot_z``, and a time."""
    text = validation.text_of("clip", path, ClipFileError)
    title = text.partition("\n")[0]
    try:
        rows = [row for row in csv.reader(text.splitlines(), delimiter=max(",;\t", key=title.count)) if row]
    except csv.Error as error:
        raise no_clip(path, f"no table: {error}") from error
    if not rows:
        raise no_clip(path, "the file is empty")
    header = [cell.strip() for cell in rows[0]]
    columns: dict[str, dict[str, int]] = {}
    notes: list[str] = []
    other: list[str] = []
    unit = 0.0
    for number, title in enumerate(header):
        match = COLUMN.match(title)
        if match and match[1].strip():
            columns.setdefault(match[1].strip(), {})[match[2].lower()] = number
            unit = {"mm": 0.001, "cm": 0.01, "m": 1.0}.get(match[3] or "", unit)
        elif title.lower() not in (*TIMES, *COUNTERS):
            other.append(title)
    joints = [name for name, places in columns.items() if set(places) == {"x", "y", "z"}]
    other += [name for name in columns if name not in joints]
    if not joints:
        raise no_clip(path, f"no header with names such as LeftFoot_x, LeftFoot_y, LeftFoot_z: {', '.join(header[:6])}")
    if other:
        notes.append(f"columns that are no points: {', '.join(other[:6])}{', ...' if len(other) > 6 else ''}")
    table = np.full((len(rows) - 1, len(header)), np.nan)
    for frame, row in enumerate(rows[1:]):
        for column, cell in enumerate(row[: len(header)]):
            try:
                table[frame, column] = float(cell) if cell.strip() else np.nan
            except ValueError as error:
                raise no_clip(path, f"line {frame + 2}, column {header[column]!r}: {error}") from error
    if len(rows) > 2 and len(rows[-1]) < len(header):
        table = table[:-1]
        notes.append("the file is cut off: its last line is left out")
    points = np.stack([table[:, [columns[name][axis] for axis in "xyz"]] for name in joints], axis=1)
    clip = of_points(path, points, joints if names is None else names)
    clip.notes += notes
    clip.unit = unit
    at = next((number for number, title in enumerate(header) if title.lower() in TIMES), -1)
    if at >= 0 and len(table) > 1:
        steps = np.diff(table[:, at])
        step = float(np.nanmedian(steps))
        if not step > 0.0 or np.nanmax(np.abs(steps - step)) > 0.5 * step:
            raise no_clip(path, f"times of column {header[at]!r} do not rise in equal steps")
        clip.rate = 1.0 / step
    return clip


def read_tensor(path: pathlib.Path, names: str | Sequence[str] | None) -> Recorded:
    """A tensor [frames, joints, 3] as torch saves it, or InterMimic's of 591 columns; without torch."""
    points = _tensor(path)
    if points.ndim == 2 and points.shape[1] == INTERMIMIC_COLUMNS:
        points = points[:, INTERMIMIC_FIRST : INTERMIMIC_FIRST + 52 * 3].reshape(-1, 52, 3)
        names = "smplh-mujoco" if names is None else names
    return of_points(path, points, names)


def of_points(path: pathlib.Path, points: Array, names: str | Sequence[str] | None) -> Recorded:
    """A clip of points, with names and parents as far as they are known.

    Args:
        names: of the joints; or of a layout: a key of :data:`~wbc.retarget.sources.layouts.LAYOUTS`.

    Raises:
        ClipFileError: no points of joints. UnknownNameError: no such layout. ShapeError: another number of names.
    """
    kind = np.asarray(points)
    if kind.dtype.kind not in "fiu" or kind.ndim not in (2, 3) or 0 in kind.shape:
        raise no_clip(path, f"expected points [frames, joints, 3], not {kind.dtype} {list(kind.shape)}")
    if kind.ndim == 2 and kind.shape[1] % 3 == 0:
        kind = kind.reshape(len(kind), -1, 3)
    if kind.ndim != 3 or kind.shape[2] != 3:
        raise no_clip(path, f"expected points [frames, joints, 3], not {list(kind.shape)}")
    if len(kind) < 2:
        raise no_clip(path, f"the file has {len(kind)} frames: a clip has at least 2")
    points = np.where(np.isfinite(kind), kind, np.nan).astype(np.float64)
    notes = []
    if names is None:
        layout = best_layout(points)
        if not layout:
            sizes = sorted({len(joints) for joints in LAYOUTS.values()})
            counts = ", ".join(map(str, sizes))
            reason = f"{points.shape[1]} joints without names; give names= (known are layouts of {counts} joints)"
            raise no_clip(path, reason)
        notes.append(f"names and parents are those of the layout {layout!r}")
        names = layout
    if isinstance(names, str):
        if names not in LAYOUTS:
            raise UnknownNameError("names", names, LAYOUTS)
        joints = LAYOUTS[names]
        if len(joints) != points.shape[1]:
            raise ShapeError("names", names, f"this layout has {len(joints)} joints, the file {points.shape[1]}")
        return Recorded([name for name, _ in joints], parents_of(joints), points, 0.0, notes=notes)
    listed = list(validation.strings("names", names))
    if len(listed) != points.shape[1]:
        raise ShapeError("names", listed, f"expected {points.shape[1]} names, one a joint, not {len(listed)}")
    return Recorded(listed, parents_by_name(listed), points, 0.0, notes=notes)


class _OneTensor(pickle.Unpickler):
    """Reads the pickle of a single tensor and nothing else: no class of any package is looked up."""

    def __init__(self, archive: zipfile.ZipFile, folder: str) -> None:
        super().__init__(archive.open(f"{folder}data.pkl"))
        self._archive, self._folder = archive, folder

    def find_class(self, module: str, name: str) -> Any:
        if (module, name) == ("torch._utils", "_rebuild_tensor_v2"):
            return _rebuilt
        if (module, name) == ("collections", "OrderedDict"):
            return dict
        if module == "torch" and name in ("FloatStorage", "DoubleStorage"):
            return np.float32 if name == "FloatStorage" else np.float64
        raise pickle.UnpicklingError(f"{module}.{name}: only a tensor of float32 or float64 is read")

    def persistent_load(self, pid: Any) -> Any:
        _, kind, key, _, _ = pid
        return np.frombuffer(self._archive.read(f"{self._folder}data/{key}"), kind)


def _rebuilt(storage: Any, offset: int, size: Sequence[int], stride: Sequence[int], *_rest: object) -> Any:
    places = offset + sum(step * axis for step, axis in zip(stride, np.indices(size), strict=True))
    return storage[places]


def _tensor(path: pathlib.Path) -> Array:
    try:
        with zipfile.ZipFile(path) as archive:
            folder = next(name for name in archive.namelist() if name.endswith("data.pkl")).removesuffix("data.pkl")
            out = _OneTensor(archive, folder).load()
    except (*BROKEN, StopIteration, AttributeError, IndexError) as error:
        raise no_clip(path, f"no tensor that can be read: {error}") from error
    if not isinstance(out, np.ndarray):
        raise no_clip(path, f"expected one tensor, not {type(out).__name__}")
    return np.asarray(out, dtype=np.float64)
