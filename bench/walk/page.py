"""The tables of docs/walking_bench.md: of every part of the walker's bench what a reader compares."""

from __future__ import annotations

from bench.sheet import Sheet
from bench.walk import tables
from bench.walk.courses import SPEED
from bench.walk.machine import Record
from bench.walk.planning_tables import planning_sheet


def page_sheets(parts: dict[str, list[Record]]) -> tuple[Sheet, ...]:
    """Courses, and plans in slices."""
    return kept_sheet(parts), planning_sheet(parts["planning"])


def kept_sheet(parts: dict[str, list[Record]]) -> Sheet:
    """Courses at the usual speed beside the highest speed that each keeps."""
    fastest = {r["course"]: f"{r['highest']:.2f}" for r in parts["highest"]}
    rows = [(*row[:1], *row[2:-1], fastest.get(row[0], "-")) for row in tables.course_sheet(parts["courses"]).rows]
    columns = ("", "mean, in/s", "of it", *tables.WALK, "highest speed kept, in/s")
    return Sheet(f"Courses at {SPEED:g} in/s", columns, rows)
