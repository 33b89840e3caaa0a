"""The tables of docs/walking_bench.md: of every part of the walker's bench what a reader compares."""

from __future__ import annotations

from bench.sheet import Sheet
from bench.walk import tables
from bench.walk.layout_tables import layout_sheet
from bench.walk.machine import Record
from bench.walk.planning_tables import patch_sheet, planning_sheet


def page_sheets(parts: dict[str, list[Record]]) -> tuple[Sheet, ...]:
    """Courses, trenches, plans in slices, layouts and patches."""
    layouts = layout_sheet(parts["layouts"])
    return (
        kept_sheet(parts),
        trench_sheet(parts["trenches"]),
        planning_sheet(parts["planning"]),
        Sheet(layouts.title, layouts.columns, [row for row in layouts.rows if "% removed" not in row[0]]),
        patch_sheet(parts["patches"]),
    )


def kept_sheet(parts: dict[str, list[Record]]) -> Sheet:
    """Courses at the usual speed beside the highest speed that each keeps."""
    fastest = {r["course"]: f"{r['highest']:.2f}" for r in parts["highest"]}
    rows = [(*row[:1], *row[2:-1], fastest.get(row[0], "-")) for row in tables.course_sheet(parts["courses"]).rows]
    columns = ("", "mean, in/s", "of it", *tables.WALK, "highest speed kept, in/s")
    return Sheet(f"Courses at {tables.SPEED:g} in/s", columns, rows)


def trench_sheet(records: list[Record]) -> Sheet:
    """What came out, and the checker's verdict or the reason of a refusal."""
    full = tables.trench_sheet(records)
    rows = [(*row[:7], row[-1] or row[-2]) for row in full.rows]
    return Sheet(full.title, (*full.columns[:7], "checker, or why not"), rows)
