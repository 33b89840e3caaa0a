"""Trenches before a body at 1 in/s that may turn, go lower and go round: what the reference says, and a walk."""

from __future__ import annotations

from collections.abc import Iterator
from math import sqrt

from bench.walk.courses import INCH, Machine, Record
from wbc.walking import Structure, cylinder, remove_columns, remove_rows
from wbc.walking.body_path import grid_path
from wbc.walking.reference import GridPose, Reference

Place = tuple[int, int]

ROWS, COLUMNS, DIAGONALS = range(3, 9), range(3, 6), range(3, 6)
#: How many there are
COUNT = len(ROWS) + len(COLUMNS) + len(DIAGONALS)
#: Speed [in/s], and height at both ends [m]
SPEED, HEIGHT = 1.0, 52 * INCH


def trenches(it: Machine) -> Iterator[Record]:
    """Rows, columns and diagonals that are removed."""
    reference, whole = Reference(it.walker), cylinder(rigid=True)
    for name, structure, start, goal in places(whole):
        verdict = reference.judge(structure, *(GridPose(*place, 0.0, HEIGHT) for place in (start, goal)))
        path = grid_path([start, goal], SPEED * INCH, height=HEIGHT)
        found = it.walk(structure, path, objective="destination", detour=True)
        yield {"trench": name, "verdict": verdict.kind, **found}


def places(whole: Structure) -> Iterator[tuple[str, Structure, Place, Place]]:
    """(name, what is left, from, to)."""
    for rows in ROWS:
        yield f"{rows} rows", remove_rows(whole, f"12-{11 + rows}"), (13, 6), (13, min(14 + rows, 21))
    for columns in COLUMNS:
        yield f"{columns} columns", remove_columns(whole, f"12-{11 + columns}"), (6, 12), (14 + columns, 12)
    for width in DIAGONALS:
        gone = [f"{t},{a}" for t in range(1, 26) for a in range(1, 25) if abs(t + a - 25.5) < width / sqrt(2.0)]
        yield f"diagonal, {width} units", whole.without(gone), (7, 6), (19, 19)
