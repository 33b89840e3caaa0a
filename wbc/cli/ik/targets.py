"""Targets of ``wbc ik``: from the command line, or from a CSV or npz file."""

from __future__ import annotations

import csv
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from wbc import validation
from wbc.cli.planning import comma_numbers
from wbc.errors import RotationError, ShapeError, UnknownNameError, WbcError, nearest
from wbc.track.path_file import PathFileError

POSITION, QUATERNION = ("x", "y", "z"), ("qx", "qy", "qz", "qw")
ARRAYS = ("poses", "positions")
SUFFIXES = (".csv", ".npz")

#: Files are written with few digits: what is a unit quaternion to this becomes one
ROUNDED = 1e-3


@dataclass(frozen=True, eq=False)
class Target:
    """A pose for the frame; its orientation counts where ``oriented``."""

    pose: pin.SE3
    oriented: bool


def given_targets(texts: list[str] | None, file: Path | None) -> list[Target]:
    """The targets of the options, those of the command line first.

    Raises:
        WbcError: no target at all, or what :func:`parse_target` and :func:`read_targets` raise.
    """
    out = [parse_target(text) for text in texts or ()]
    if file is not None:
        out += read_targets(file)
    if not out:
        raise WbcError("target", None, "give at least one with --target or --targets")
    return out


def parse_target(text: str) -> Target:
    """A target from X,Y,Z or X,Y,Z,QX,QY,QZ,QW.

    Raises:
        ShapeError, NotFiniteError, RotationError: no such numbers.
    """
    given = comma_numbers("target", text)
    if len(given) not in (3, 7):
        raise ShapeError("target", text, "expected X,Y,Z or X,Y,Z,QX,QY,QZ,QW")
    return _target("target", given)


def read_targets(file: Path) -> list[Target]:
    """Targets from a file.

    CSV: a header with x, y, z and, for orientations, qx, qy, qz, qw (a column t is skipped), one target a line. npz: an
    array ``poses`` [n, 7] or [n, 4, 4], or ``positions`` [n, 3]. Metres, unit quaternions.

    Raises:
        PathFileError: missing, unreadable, or without a target. UnknownNameError: a suffix or name that does not belong
            there. ShapeError, NotFiniteError, RotationError: a value; its line or row is named.
    """
    if file.suffix.lower() not in SUFFIXES:
        raise UnknownNameError("targets", file.suffix, SUFFIXES)
    try:
        rows = _from_csv(file) if file.suffix.lower() == ".csv" else _from_npz(file)
    except FileNotFoundError as error:
        raise PathFileError("targets", str(file), validation.no_such(file)) from error
    except (OSError, EOFError, ValueError, zipfile.BadZipFile) as error:
        raise PathFileError("targets", str(file), f"cannot be read: {error}") from error
    if not rows:
        raise PathFileError("targets", str(file), "has no target")
    return [_target(label, given) for label, given in rows]


def _target(label: str, given: Any) -> Target:
    """From 3, 7 or 4 x 4 numbers."""
    values = validation.real_array(label, given)
    if values.shape == (3,):
        return Target(pin.SE3(np.eye(3), values), False)
    if values.shape == (7,):
        size = float(np.linalg.norm(values[3:]))
        if abs(size - 1.0) > ROUNDED:
            raise RotationError(label, values[3:], f"quaternion of norm {size:.6g}, expected 1")
        values[3:] /= size
    return Target(validation.pose(label, values), True)


def _from_csv(file: Path) -> list[tuple[str, Any]]:
    lines = [(n, line) for n, line in enumerate(file.read_text().splitlines(), 1) if line.strip() and line[0] != "#"]
    rows = [(n, [cell.strip() for cell in next(csv.reader([line]))]) for n, line in lines]
    if not rows:
        return []
    header = rows[0][1]
    columns = (*POSITION, *QUATERNION, "t")
    for name in header:
        if name not in columns:
            raise UnknownNameError(f"{file.name} column", name, columns)
    wanted = (*POSITION, *QUATERNION) if any(name in header for name in QUATERNION) else POSITION
    missing = [name for name in wanted if name not in header]
    if missing or len(set(header)) != len(header):
        reason = f"missing {', '.join(missing)}" if missing else "a column is there twice"
        raise ShapeError(f"{file.name} columns", header, reason, nearest((missing or header)[0], columns))
    out = []
    for n, cells in rows[1:]:
        label = f"{file.name} line {n}"
        if len(cells) != len(header):
            raise ShapeError(label, cells, f"expected {len(header)} values")
        out.append((label, comma_numbers(label, ",".join(cells[header.index(name)] for name in wanted))))
    return out


def _from_npz(file: Path) -> list[tuple[str, Any]]:
    with zipfile.ZipFile(file), np.load(file, allow_pickle=False) as arrays:
        names = list(arrays.files)
        for name in names:
            if name not in ARRAYS:
                raise UnknownNameError(f"{file.name} array", name, ARRAYS)
        if len(names) != 1:
            raise ShapeError(f"{file.name} arrays", names, "expected one of them", ARRAYS)
        values = validation.real_array(f"{file.name} {names[0]}", arrays[names[0]], finite=False)
    shapes = [(3,)] if names[0] == "positions" else [(7,), (4, 4)]
    if values.shape[1:] not in shapes:
        wanted = " or ".join(" x ".join(("n", *map(str, shape))) for shape in shapes)
        raise ShapeError(f"{file.name} {names[0]}", values.shape, f"expected the shape {wanted}")
    return [(f"{file.name} row {k}", value) for k, value in enumerate(values)]
