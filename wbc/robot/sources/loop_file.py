"""Closed loops in a file beside a description that has none: a URDF is a tree."""

from __future__ import annotations

import csv
import pathlib

from wbc.errors import RobotFileError
from wbc.robot.loops import Loop

COLUMNS = ("first", "second", "kind", "name")


def read_loops(path: pathlib.Path) -> tuple[Loop, ...]:
    """Loops of a file of comma-separated values: a row a loop, with the names of two frames and, if it is another one
    than ``connect``, the kind of :class:`~wbc.robot.Loop`; then its name, else ``first-second``. Lines that begin with
    # say nothing; a row ``first,second,kind,name`` is a heading.

    Raises:
        RobotFileError: it cannot be read, has no row, or one of not two to four fields. UnknownNameError: no such kind.
    """
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise RobotFileError("loops", str(path), f"cannot be read: {error}") from error
    loops = []
    for number, line in enumerate(lines, start=1):
        fields = [field.strip() for field in next(csv.reader([line]), [])]
        if not any(fields) or fields[0].startswith("#") or fields == list(COLUMNS[: len(fields)]):
            continue
        if not 2 <= len(fields) <= len(COLUMNS) or not all(fields[:2]):
            raise RobotFileError("loops", str(path), f"line {number} is {line!r}, expected {', '.join(COLUMNS)}")
        first, second, kind, name = (*fields, *[""] * (len(COLUMNS) - len(fields)))
        loops.append(Loop(name or f"{first}-{second}", first, second, kind or "connect"))  # type: ignore[arg-type]
    if not loops:
        raise RobotFileError("loops", str(path), f"it has no row, expected {', '.join(COLUMNS)}")
    return tuple(loops)
