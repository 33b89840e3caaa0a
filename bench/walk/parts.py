"""The parts of a run: what is measured, how it is shown, what is asked of it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from bench.goals import Goal
from bench.kept import Kept
from bench.pool import ROOT
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
from bench.walk.trial_parts import PARTS, trial_goals, trial_jobs, trial_sheet


@dataclass(frozen=True)
class Part:
    """One part: its jobs, and of their records the table and the goals."""

    jobs: Callable[[Machine], list[Job]]
    sheet: Callable[[list[Record]], Sheet]
    goals: Callable[[list[Record]], list[Goal]]


@dataclass(frozen=True)
class Sizes:
    """How many layouts and patches, how many of the layouts are carried out, and how many trials from seeds.

    Attributes:
        trials: random structures; of the other parts as :data:`bench.walk.trials.SHARES` says. folder: where their runs
            are left.
    """

    layouts: int = 1000
    walked: int = 10
    patches: int = 100
    trials: int = 500
    folder: Path = ROOT / "build" / "bench" / "trials"


QUICK = Sizes(30, 3, 10, 14)


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
        **{name: _trial_part(name, sizes) for name in PARTS},
    }


def _trial_part(name: str, sizes: Sizes) -> Part:
    jobs = partial(trial_jobs, part=name, count=sizes.trials, folder=sizes.folder)
    return Part(jobs, partial(trial_sheet, name), partial(trial_goals, name))


def records(name: str, jobs: list[Job], kept: Kept, parallel: int = 1) -> Iterator[Record]:
    """Of a part: those that are kept, then the others as they are measured.

    Args:
        parallel: trials from seeds that run at a time, each in a process of its own; others are measured one by one.
    """
    left = []
    for job in jobs:
        found = kept.get(f"{name}: {job.name}")
        if found is None:
            left.append(job)
        else:
            yield found
    for job, record in _at_a_time(left, parallel) if name in PARTS and parallel > 1 else ((j, j.run()) for j in left):
        kept.put(f"{name}: {job.name}", record)
        yield record


def _at_a_time(jobs: list[Job], parallel: int) -> Iterator[tuple[Job, Record]]:
    """Jobs with their records as they are done."""
    pool = ThreadPoolExecutor(parallel)
    try:
        running = {pool.submit(job.run): job for job in jobs}
        for done in as_completed(running):
            yield running[done], done.result()
    finally:
        pool.shutdown(cancel_futures=True)


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
