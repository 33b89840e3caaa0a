"""Reading a timed path from a CSV, JSON or TOML file of waypoints.

CSV: a header ``t,x,y,z,qx,qy,qz,qw`` (any order; lines that start with # are skipped), one waypoint a line.
JSON and TOML: a table with ``waypoints``, a list of tables ``{t, position = [x, y, z], quaternion = [x, y, z, w]}``
(JSON may also be that list alone). t in s, position in m in the world, unit quaternions.
"""

from __future__ import annotations

import csv
import json
import os
import pathlib
import tomllib
import zipfile
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import NotFiniteError, RotationError, ShapeError, UnknownNameError, WbcError, nearest
from wbc.track.path import SplinePath

COLUMNS = ("t", "x", "y", "z", "qx", "qy", "qz", "qw")
KEYS = {"t": 1, "position": 3, "quaternion": 4}
SUFFIXES = (".csv", ".json", ".toml")


class PathFileError(WbcError):
    """A path file that is missing, unreadable or badly formed."""


def read_path(file: str | os.PathLike[str]) -> SplinePath:
    """The path through the waypoints of a file; its first waypoint is at time 0, whatever ``t`` it has.

    Raises:
        PathFileError: missing, a directory, not text, not CSV, JSON or TOML, or fewer than two waypoints.
        UnknownNameError: a column or key that does not belong there.
        ShapeError, NotFiniteError, RotationError: a value that is no number, is not finite, or is no unit quaternion;
            the waypoint is named.
        RangeError: times that do not increase, or orientations too far apart (see :class:`SplinePath`).
    """
    path = validation.file_path("path", file)
    if path.suffix.lower() not in SUFFIXES:
        raise PathFileError("path", str(path), "unknown kind of file", SUFFIXES)
    text = validation.text_of("path", path, PathFileError)
    table = csv_rows(path, text, COLUMNS) if path.suffix.lower() == ".csv" else _from_tables(path, text)
    if not text.strip():
        raise PathFileError("path", str(path), "the file is empty")
    if len(table) < 2:
        raise PathFileError("path", str(path), f"expected at least two waypoints, found {len(table)}")
    for label, numbers in table:
        if not np.isfinite(numbers).all():
            raise NotFiniteError(f"{path.name} {label}", numbers, "expected finite numbers")
        size = float(np.linalg.norm(numbers[4:]))
        if abs(size - 1.0) > 1e-3:
            raise RotationError(f"{path.name} {label}", numbers[4:], f"quaternion of norm {size:.6g}, expected 1")
    values = np.array([numbers for _, numbers in table])
    # Files are written with few digits: what is a unit quaternion to 1e-3 becomes one
    values[:, 4:] /= np.linalg.norm(values[:, 4:], axis=1, keepdims=True)
    return SplinePath(values[:, 0], list(values[:, 1:]))


def rows_of(
    field: str,
    file: pathlib.Path,
    from_csv: Callable[[str], list[tuple[str, Any]]],
    from_npz: Callable[[pathlib.Path], list[tuple[str, Any]]],
) -> list[tuple[str, Any]]:
    """(label, numbers) of each row of a CSV or npz file.

    Args:
        field: what it is called. from_csv: reads a text, as :func:`csv_rows`. from_npz: reads a file of arrays.

    Raises:
        PathFileError: missing, unreadable, or without a row. UnknownNameError: another suffix. What the readers raise.
    """
    suffix = validation.one_of(field, file.suffix.lower(), (".csv", ".npz"))
    try:
        rows = from_csv(file.read_text(encoding="utf-8")) if suffix == ".csv" else from_npz(file)
    except FileNotFoundError as error:
        raise PathFileError(field, str(file), validation.no_such(file)) from error
    except (OSError, EOFError, ValueError, zipfile.BadZipFile) as error:
        raise PathFileError(field, str(file), f"cannot be read: {error}") from error
    if not rows:
        raise PathFileError(field, str(file), f"has no {field}")
    return rows


def csv_rows(
    path: pathlib.Path, text: str, columns: Sequence[str], together: Sequence[str] = (), ignored: Sequence[str] = ()
) -> list[tuple[str, np.ndarray]]:
    """(label, numbers in the order of the columns) of each line; empty lines and comments with # do not count.

    Args:
        columns: these have to be there. together: all of these, or none; their numbers follow. ignored: may be there.

    Raises:
        UnknownNameError: another column. ShapeError: one that is missing or there twice, or cells that are no numbers.
    """
    lines = [(n, line) for n, line in enumerate(text.splitlines(), 1) if line.strip() and not line.startswith("#")]
    rows = [(n, [cell.strip() for cell in next(csv.reader([line]))]) for n, line in lines]
    if not rows:
        return []
    header, known = rows[0][1], (*columns, *together, *ignored)
    for name in header:
        if name not in known:
            raise UnknownNameError(f"{path.name} column", name, known)
    wanted = (*columns, *(together if set(together) & set(header) else ()))
    missing = [name for name in wanted if name not in header]
    if missing:
        raise ShapeError(f"{path.name} columns", header, f"missing {', '.join(missing)}", nearest(missing[0], known))
    if len(set(header)) != len(header):
        raise ShapeError(f"{path.name} columns", header, "a column is there twice")
    order = [header.index(name) for name in wanted]
    out = []
    for number, cells in rows[1:]:
        if len(cells) != len(header):
            raise ShapeError(f"{path.name} line {number}", cells, f"expected {len(header)} values")
        out.append((f"line {number}", _numbers(f"{path.name} line {number}", [cells[k] for k in order])))
    return out


def _from_tables(path: pathlib.Path, text: str) -> list[tuple[str, np.ndarray]]:
    """(label, eight numbers) of each table in a JSON or TOML file."""
    try:
        data: Any = json.loads(text) if path.suffix.lower() == ".json" else tomllib.loads(text)
    except ValueError as error:
        raise PathFileError("path", str(path), f"not well formed: {error}") from error
    if isinstance(data, Mapping):
        for key in data:
            if key != "waypoints":
                raise UnknownNameError(f"{path.name} key", key, ("waypoints",))
        data = data.get("waypoints", [])
    if not isinstance(data, list):
        raise ShapeError(f"{path.name} waypoints", data, "expected a list of tables")
    out = []
    for k, waypoint in enumerate(data):
        label = f"waypoint {k}"
        if not isinstance(waypoint, Mapping):
            raise ShapeError(f"{path.name} {label}", waypoint, f"expected a table of {', '.join(KEYS)}")
        for key in waypoint:
            validation.one_of(f"{path.name} {label} key", key, KEYS)
        parts = []
        for key, count in KEYS.items():
            if key not in waypoint:
                raise ShapeError(f"{path.name} {label}", waypoint, f"missing {key}", nearest(key, KEYS))
            value = waypoint[key] if count > 1 else [waypoint[key]]
            parts.append(validation.real_array(f"{path.name} {label}.{key}", value, (count,), finite=False))
        out.append((label, np.concatenate(parts)))
    return out


def _numbers(label: str, cells: list[str]) -> np.ndarray:
    try:
        return np.array([float(cell) for cell in cells])
    except ValueError as error:
        raise ShapeError(label, cells, f"expected numbers: {error}") from error
