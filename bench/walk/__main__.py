"""``python -m bench.walk``: plan and walk, print, write walk.md and .json.

Ctrl-C ends the measuring; what was measured until then is printed and written.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

import wbc
from bench.harness import machine as host
from bench.pool import ROOT
from bench.records import measure
from bench.report import goal_sheet
from bench.walk.courses import COURSES, Machine, courses, highest, machine, spins
from bench.walk.layouts import layouts
from bench.walk.planning import planning
from bench.walk.tables import Parts, Record, goals, sheets
from bench.walk.trenches import COUNT, trenches
from wbc.errors import RangeError
from wbc.robots import WalkerData
from wbc.robots.walker_data import WALKER_DIGEST

#: Parts of a run, and how many records each has
PARTS = {
    "courses": 3 * len(COURSES),
    "spins": 2,
    "trenches": COUNT,
    "highest": len(COURSES),
    "planning": 3 * len(COURSES),
    "layouts": 1000,
}
#: Layouts of a run that is not full, and those that are carried out
FEW, WALKED = 30, 3
QUICK = ("courses", "spins", "planning")

NOTES = """\
A walk is planned (velocity mode; destination mode with detours for trenches) and carried out at 100 Hz by the \
whole-body controller, whose joint rates are the simulator's only inputs. "Part of the speed" is the path's duration \
over that of the walk less half a second for the ramps. "Real time" is simulated over processor time: planner, \
controller, simulator; no rendering, one core, compilation left out. Ticks are the controller's alone."""


def main(given: list[str] | None = None) -> None:
    """Parse the arguments and run."""
    parser = argparse.ArgumentParser(prog="wbc bench walk", description=__doc__)
    parser.add_argument("--full", action="store_true", help="every part")
    parser.add_argument("--parts", nargs="+", choices=[*PARTS], help="only these")
    parser.add_argument("--layouts", type=int, help=f"how many, {PARTS['layouts']} in full runs, else {FEW}")
    parser.add_argument("--walked", type=int, default=WALKED, help="layouts of these that are carried out")
    parser.add_argument("--resume", action="store_true", help="keep the layouts that an interrupted run measured")
    parser.add_argument("--collisions", action="store_true", help="with self-collision rows in the controller")
    parser.add_argument("--output", type=Path, help="folder; by default bench for full runs, else build/bench")
    chosen = parser.parse_args(given)
    folder = chosen.output or (ROOT / "bench" if chosen.full else ROOT / "build" / "bench")
    names = chosen.parts or (list(PARTS) if chosen.full else list(QUICK))
    data = WalkerData.read()
    if data.digest != WALKER_DIGEST:
        raise RangeError("walker.toml", data.digest, f"figures are reported for the data {WALKER_DIGEST} only")
    count = chosen.layouts or (PARTS["layouts"] if chosen.full else FEW)
    kept = folder / "walk_layouts.jsonl"
    if not chosen.resume:
        kept.unlink(missing_ok=True)
    it = machine(wbc.robots.walker(), chosen.collisions)
    console, errors = Console(), Console(stderr=True)
    if not console.is_terminal:
        console = Console(width=170)
    about = host()
    bars = (TextColumn("{task.description:10}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*bars, console=errors) as progress:
        sizes = {**PARTS, "layouts": count}
        work = {name: (sizes[name], of(name, it)) for name in names if name != "layouts"}
        if "layouts" in names:
            work["layouts"] = count, layouts(it, count, chosen.walked, kept)
        parts, interrupted = measure(work, progress)
    lines = [
        f"{about['processor']}, Python {about['python']}; load {about['load']}.",
        f"Robot data {data.digest}; self-collision rows {'on' if chosen.collisions else 'off'}.",
        *NOTES.split("\n\n"),
    ]
    if interrupted:
        lines.insert(0, f"Ended by Ctrl-C in: {interrupted}.")
    for sheet in (*sheets(parts), goal_sheet(goals(parts))):
        console.print(sheet.rich())
        console.print()
    for text in lines:
        console.print(text, markup=False, highlight=False)
    write(folder, parts, lines)
    console.print(f"Written to {folder / 'walk.md'}", markup=False, highlight=False)


def of(name: str, it: Machine) -> Iterator[Record]:
    """The records of a part, as they are measured."""
    parts = {"courses": courses, "spins": spins, "trenches": trenches, "highest": highest, "planning": planning}
    return parts[name](it)


def write(folder: Path, parts: Parts, lines: list[str]) -> None:
    """walk.md and walk.json."""
    folder.mkdir(parents=True, exist_ok=True)
    tables = [sheet.markdown() for sheet in (*sheets(parts), goal_sheet(goals(parts)))]
    (folder / "walk.md").write_text("\n\n".join([*tables, *lines]) + "\n")
    (folder / "walk.json").write_text(json.dumps({"about": lines, "parts": parts}, indent=1) + "\n")


if __name__ == "__main__":
    main()
