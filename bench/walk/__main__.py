"""``python -m bench.walk``: plan and walk, print, write walk.md and walk.json.

Ctrl-C ends the measuring; what was measured until then is printed and written.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import wbc
from bench.figures.store import stamp
from bench.harness import machine as host
from bench.pool import ROOT
from bench.program import bars, measure, publish
from bench.sheet import Sheet
from bench.walk import tables
from bench.walk.courses import course_jobs, highest_jobs, spin_jobs
from bench.walk.machine import Job, Machine, Record
from bench.walk.planning import planning_jobs
from bench.walk.planning_tables import planning_sheet
from wbc.errors import RangeError
from wbc.interrupts import obey_interrupts
from wbc.robots import WalkerData
from wbc.robots.walker_data import WALKER_DIGEST

NOTES = """\
A walk is planned whole in velocity mode and carried out at 100 Hz by the whole-body controller, whose joint rates are \
the simulator's only inputs. Speeds are means of the body's origin, from 0.5 s after the start to 0.5 s before the end.\
 "Real time" is simulated time over processor time of controller, simulator and log, then of the planner too; no \
rendering, one core, compilation left out. Ticks are the controller's alone, by the clock; the loop has hands, \
controller, simulator and log, by processor time. The checker recomputes the walk from its log, URDF and structure."""


@dataclass(frozen=True)
class Part:
    """One part of a run: its jobs, and of their records the table."""

    jobs: Callable[[Machine], list[Job]]
    sheet: Callable[[list[Record]], Sheet]


#: In the order in which they are measured
PARTS = {
    "courses": Part(course_jobs, tables.course_sheet),
    "spins": Part(spin_jobs, tables.spin_sheet),
    "planning": Part(planning_jobs, planning_sheet),
    "highest": Part(highest_jobs, tables.highest_sheet),
}


def main(given: list[str] | None = None) -> None:
    """Parse the arguments and run.

    Raises:
        RangeError: the robot's data are not those that figures are reported for.
    """
    parser = argparse.ArgumentParser(prog="python -m bench.walk", description=__doc__)
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=list(PARTS), help="only these; default: all")
    parser.add_argument("--collisions", action="store_true", help="with self-collision rows in the controller")
    parser.add_argument("--output", type=Path, default=ROOT / "build" / "bench", help="folder; default: build/bench")
    chosen = parser.parse_args(given)
    data = WalkerData.read()
    if data.digest != WALKER_DIGEST:
        raise RangeError("walker.toml", data.digest, f"figures are reported for the data {WALKER_DIGEST} only")
    about, begun = host(), stamp()
    it = Machine(wbc.robots.walker(), collisions=chosen.collisions)
    with bars() as progress:
        jobs = {name: PARTS[name].jobs(it) for name in chosen.parts}
        parts, interrupted = measure({k: (len(v), (job.run() for job in v)) for k, v in jobs.items()}, progress)
    lines = [
        f"{about['processor']}, Python {about['python']}; load {about['load']}.",
        f"Robot data {data.digest}; self-collision rows {'on' if chosen.collisions else 'off'}.",
        NOTES,
    ]
    if interrupted:
        lines.insert(0, f"Ended by Ctrl-C in: {interrupted}.")
    found = {name: some for name, some in parts.items() if some}
    sheets = [PARTS[name].sheet(some) for name, some in found.items()]
    publish(chosen.output / "walk", sheets, lines, {"stamp": begun, "about": lines, "parts": found}, width=230)


if __name__ == "__main__":
    obey_interrupts()
    main()
