"""The parts of a run: what is measured, how it is shown, what is asked of it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

from bench.goals import Goal
from bench.kept import Kept
from bench.records import Parts
from bench.sheet import Sheet
from bench.walk import tables
from bench.walk.courses import course_jobs, highest_jobs, spin_jobs
from bench.walk.layout_tables import layout_goals, layout_sheet
from bench.walk.layouts import layout_jobs
from bench.walk.machine import Job, Machine, Record
from bench.walk.patches import patch_jobs
from bench.walk.planning import planning_jobs
from bench.walk.planning_tables import patch_goals, patch_sheet, planning_goals, planning_sheet
from bench.walk.trenches import trench_jobs


@dataclass(frozen=True)
class Part:
    """One part: its jobs, and of their records the table and the goals."""

    jobs: Callable[[Machine], list[Job]]
    sheet: Callable[[list[Record]], Sheet]
    goals: Callable[[list[Record]], list[Goal]]


@dataclass(frozen=True)
class Sizes:
    """How many layouts and patches, and how many of the layouts are carried out."""

    layouts: int = 1000
    walked: int = 10
    patches: int = 100


QUICK = Sizes(30, 3, 10)


def parts_of(sizes: Sizes) -> dict[str, Part]:
    """All parts, in the order in which they are measured."""
    layouts = partial(layout_jobs, count=sizes.layouts, walked=sizes.walked)
    patches = partial(patch_jobs, count=sizes.patches)
    return {
        "courses": Part(course_jobs, tables.course_sheet, tables.course_goals),
        "spins": Part(spin_jobs, tables.spin_sheet, tables.spin_goals),
        "planning": Part(planning_jobs, planning_sheet, planning_goals),
        "trenches": Part(trench_jobs, tables.trench_sheet, tables.trench_goals),
        "patches": Part(patches, patch_sheet, patch_goals),
        "layouts": Part(layouts, layout_sheet, layout_goals),
        "highest": Part(highest_jobs, tables.highest_sheet, lambda records: []),
    }


def records(name: str, jobs: list[Job], kept: Kept) -> Iterator[Record]:
    """Of a part: those that are kept, then the others as they are measured."""
    left = []
    for job in jobs:
        found = kept.get(f"{name}: {job.name}")
        if found is None:
            left.append(job)
        else:
            yield found
    for job in left:
        record = job.run()
        kept.put(f"{name}: {job.name}", record)
        yield record


def others(names: list[str], kept: Kept) -> Parts:
    """Records of parts that are not among these, as an earlier run left them."""
    out: Parts = {}
    for key, record in kept:
        name = key.split(": ")[0]
        if name not in names:
            out.setdefault(name, []).append(record)
    return out


def sheets(parts: Parts, sizes: Sizes) -> list[Sheet]:
    """A table a part that has records."""
    return [part.sheet(parts[name]) for name, part in parts_of(sizes).items() if parts.get(name)]


def goals(parts: Parts, sizes: Sizes) -> list[Goal]:
    """What is asked of the parts that have records."""
    return [goal for name, part in parts_of(sizes).items() if parts.get(name) for goal in part.goals(parts[name])]
