"""Trenches before a body that may turn, go lower and go round: what the reference says, and a walk."""

from __future__ import annotations

from functools import partial
from math import sqrt

from bench.walk.machine import INCH, Job, Machine, Record
from bench.walk.reference import GridPose
from wbc.walking import Structure, remove_columns, remove_rows
from wbc.walking.body_path import grid_path

Place = tuple[int, int]

ROWS, COLUMNS, DIAGONALS = range(3, 9), range(3, 7), range(3, 7)
#: Speed along the path [in/s], from start to end at least, and height at both ends [m]
SPEED, LEAST, HEIGHT = 1.5, 1.0, 52 * INCH


def trench(it: Machine, name: str, structure: Structure, start: Place, goal: Place) -> Record:
    """Verdict, plan or refusal, and the walk."""
    poses = [GridPose(*place, 0.0, HEIGHT) for place in (start, goal)]
    verdict = it.reference.judge(structure, *poses)
    path = grid_path([start, goal], SPEED * INCH, height=HEIGHT)
    found = it.walk(structure, path, objective="destination", detour=True)
    return {
        "trench": name,
        "verdict": verdict.kind,
        "reference_s": verdict.time,
        "reference_separating": list(verdict.separating),
        **found,
    }


def crossed(record: Record) -> bool:
    """Planned and walked, fast enough, and the checker finds nothing."""
    return bool(record.get("arrived") and not record["violations"] and record["progress"] >= LEAST * INCH)


def trench_jobs(it: Machine) -> list[Job]:
    """Rows, columns and diagonals that are removed."""
    return [Job(place[0], partial(trench, it, *place)) for place in places(it.structure)]


def places(whole: Structure) -> list[tuple[str, Structure, Place, Place]]:
    """(name, what is left, from, to)."""
    out: list[tuple[str, Structure, Place, Place]] = []
    for rows in ROWS:
        out.append((f"{rows} rows", remove_rows(whole, f"12-{11 + rows}"), (13, 6), (13, min(14 + rows, 21))))
    for columns in COLUMNS:
        out.append((f"{columns} columns", remove_columns(whole, f"12-{11 + columns}"), (6, 12), (14 + columns, 12)))
    for width in DIAGONALS:
        gone = [f"{t},{a}" for t in range(1, 26) for a in range(1, 25) if abs(t + a - 25.5) < width / sqrt(2.0)]
        out.append((f"diagonal, {width} units", whole.without(gone), (7, 6), (19, 19)))
    return out
