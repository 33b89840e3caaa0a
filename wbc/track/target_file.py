"""Poses and positions that a frame is to reach, from a CSV or npz file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wbc import validation
from wbc.archives import open_npz
from wbc.errors import RotationError, ShapeError, UnknownNameError
from wbc.multibody import pin
from wbc.track.path_file import csv_rows, rows_of

POSITION = ("x", "y", "z")
QUATERNION = ("qx", "qy", "qz", "qw")
#: Arrays of a file, and the shapes that an element may have
ARRAYS: dict[str, tuple[tuple[int, ...], ...]] = {"poses": ((7,), (4, 4)), "positions": ((3,),)}

#: Files are written with few digits: what is a unit quaternion to this becomes one
ROUNDED = 1e-3


@dataclass(frozen=True, eq=False)
class Target:
    """A pose for the frame; its orientation counts where ``oriented``."""

    pose: pin.SE3
    oriented: bool


def read_targets(file: Path) -> list[Target]:
    """Targets from a file.

    CSV: a header with x, y, z and, for orientations, qx, qy, qz, qw (a column t is skipped), one target a line. npz: an
    array ``poses`` [n, 7] or [n, 4, 4], or ``positions`` [n, 3]. Metres, unit quaternions.

    Raises:
        PathFileError: missing, unreadable, or without a target. UnknownNameError: a suffix or name that does not belong
            there. ShapeError, NotFiniteError, RotationError: a value; its line or row is named.
    """
    rows = rows_of("targets", file, lambda text: csv_rows(file, text, POSITION, QUATERNION, ("t",)), _from_npz)
    return [as_target(f"{file.name} {label}", given) for label, given in rows]


def as_target(label: str, given: Any) -> Target:
    """From 3, 7 or 4 x 4 numbers.

    Raises:
        ShapeError, NotFiniteError, RotationError: others.
    """
    values = validation.real_array(label, given)
    if values.shape == (3,):
        return Target(pin.SE3(np.eye(3), values), False)
    if values.shape == (7,):
        size = float(np.linalg.norm(values[3:]))
        if abs(size - 1.0) > ROUNDED:
            raise RotationError(label, values[3:], f"quaternion of norm {size:.6g}, expected 1")
        values[3:] /= size
    return Target(validation.pose(label, values), True)


def _from_npz(file: Path) -> list[tuple[str, Any]]:
    with open_npz(file) as arrays:
        names = list(arrays.files)
        for name in names:
            if name not in ARRAYS:
                raise UnknownNameError(f"{file.name} array", name, ARRAYS)
        if len(names) != 1:
            raise ShapeError(f"{file.name} arrays", names, "expected one of them", ARRAYS)
        values = validation.real_array(f"{file.name} {names[0]}", arrays[names[0]], finite=False)
    if values.shape[1:] not in ARRAYS[names[0]]:
        wanted = " or ".join(" x ".join(("n", *map(str, shape))) for shape in ARRAYS[names[0]])
        raise ShapeError(f"{file.name} {names[0]}", values.shape, f"expected the shape {wanted}")
    return [(f"row {k}", value) for k, value in enumerate(values)]
