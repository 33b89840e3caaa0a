"""``python -m bench.walk``: plan and walk, print, write walk.md and walk.json, and of trials from seeds trials.md and
trials.json.

Ctrl-C ends the measuring; what was measured until then is printed and written, and the same command with --resume goes
on from there.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

import wbc
from bench.figures.store import stamp
from bench.harness import machine as host
from bench.kept import Kept, sources
from bench.pool import ROOT
from bench.records import Parts, measure
from bench.report import goal_sheet
from bench.walk.machine import Machine
from bench.walk.parts import QUICK, Sizes, goals, others, parts_of, records, sheets
from bench.walk.trials import PARTS
from wbc.errors import RangeError
from wbc.interrupts import obey_kill
from wbc.robots import WalkerData
from wbc.robots.walker_data import WALKER_DIGEST

#: Records of the walker's parts, and of trials from seeds: each is resumed, measured anew and written by itself
FILES = ("walk", "trials")
#: What decides what a run measures
SOURCES = ("wbc", "tasks", "robots", "bench/walk")

NOTES = """\
A walk is planned whole (velocity mode; destination mode with ways round for trenches and layouts) and carried out at \
100 Hz by the whole-body controller, whose joint rates are the simulator's only inputs. Speeds are means of the body's \
origin, from 0.5 s after the start to 0.5 s before the end. "Real time" is simulated time over processor time of \
controller, simulator and log, then of the planner too; no rendering, one core, compilation left out. Ticks are the \
controller's alone, by the clock; the loop has hands, controller, simulator and log, by processor time. The checker \
recomputes the walk from its log, URDF and structure."""
LOADED = """\
Before the first walk, once in a process: {:.2f} s of processor time for the structure, the controller and the \
compiled expressions of the loop, which belong to the robot and are in no figure."""


def arguments(given: list[str] | None = None) -> argparse.Namespace:
    """What is asked for."""
    names, whole = [*parts_of(Sizes())], Sizes()
    parser = argparse.ArgumentParser(prog="wbc bench walk", description=__doc__)
    parser.add_argument("--quick", action="store_true", help=f"{QUICK.layouts} layouts, {QUICK.patches} patches")
    parser.add_argument("--parts", nargs="+", choices=names, default=names, help="only these; default: all")
    parser.add_argument("--layouts", type=int, help=f"how many; default: {whole.layouts}")
    parser.add_argument("--walked", type=int, help=f"of these carried out; default: {whole.walked}")
    parser.add_argument("--patches", type=int, help=f"how many; default: {whole.patches}")
    parser.add_argument("--trials", type=int, help=f"random structures, more of other trials; default: {whole.trials}")
    parser.add_argument("--parallel", type=int, default=1, help="trials at a time, each a process; default: 1")
    parser.add_argument("--resume", action="store_true", help="keep what an earlier run measured with these sources")
    parser.add_argument("--collisions", action="store_true", help="with self-collision rows in the controller")
    parser.add_argument("--output", type=Path, default=ROOT / "build" / "bench", help="folder; default: build/bench")
    chosen = parser.parse_args(given)
    usual = QUICK if chosen.quick else whole
    counts = [getattr(chosen, name) for name in ("layouts", "walked", "patches", "trials")]
    if any(count is not None and count < 0 for count in counts):
        parser.error("--layouts, --walked, --patches and --trials are at least 0")
    known = (usual.layouts, usual.walked, usual.patches, usual.trials)
    if chosen.parallel < 1:
        parser.error("--parallel is at least 1")
    given_sizes = (size if count is None else count for count, size in zip(counts, known, strict=True))
    chosen.sizes = Sizes(*given_sizes, chosen.output / "trials")
    return chosen


def main(given: list[str] | None = None) -> None:
    """Parse the arguments and run.

    Raises:
        RangeError: the robot's data are not those that figures are reported for.
    """
    chosen = arguments(given)
    data = WalkerData.read()
    if data.digest != WALKER_DIGEST:
        raise RangeError("walker.toml", data.digest, f"figures are reported for the data {WALKER_DIGEST} only")
    version = {"sources": sources(SOURCES), "data": data.digest, "collisions": chosen.collisions}
    kept, about, begun = dict[str, Kept](), host(), stamp()
    for file in FILES:
        path = chosen.output / f"{file}.jsonl"
        asked = any(file_of(name) == file for name in chosen.parts)
        if asked and not chosen.resume:
            path.unlink(missing_ok=True)
        if asked or path.exists():
            kept[file] = _kept(path, version, asked)
    it = Machine(wbc.robots.walker(), collisions=chosen.collisions)
    console, errors = Console(), Console(stderr=True)
    if not console.is_terminal:
        console = Console(width=230)
    bars = (TextColumn("{task.description:10}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*bars, TimeRemainingColumn(), console=errors) as progress:
        jobs = {name: part.jobs(it) for name, part in parts_of(chosen.sizes).items() if name in chosen.parts}
        work = {
            name: (len(mine), records(name, mine, kept[file_of(name)], chosen.parallel))
            for name, mine in jobs.items()
            if mine
        }
        parts, interrupted = measure(work, progress)
    parts = {name: found for one in kept.values() for name, found in others([*work], one).items()} | parts
    lines = [
        f"{about['processor']}, Python {about['python']}; load {about['load']}.",
        f"Robot data {data.digest}; self-collision rows {'on' if chosen.collisions else 'off'}.",
        NOTES,
    ]
    if it.loading is not None:
        lines.append(LOADED.format(it.loading))
    if interrupted:
        lines.insert(0, f"Ended by Ctrl-C in: {interrupted}.")
    for sheet in (*sheets(parts, chosen.sizes), goal_sheet(goals(parts, chosen.sizes))):
        console.print(sheet.rich())
        console.print()
    for text in lines:
        console.print(text, markup=False, highlight=False)
    for file in FILES:
        mine = {name: found for name, found in parts.items() if file_of(name) == file}
        if any(file_of(name) == file for name in chosen.parts) and mine:
            write(chosen.output / file, mine, chosen.sizes, lines, begun)
            console.print(f"Written to {chosen.output / file}.md", markup=False, highlight=False)


def file_of(part: str) -> str:
    """Which of :data:`FILES` a part is in."""
    return FILES[part in PARTS]


def _kept(path: Path, version: dict[str, Any], asked: bool) -> Kept:
    """What is kept in a file; nothing of a file of other sources that is not asked for."""
    try:
        return Kept(path, version)
    except ValueError:
        if asked:
            raise
        return Kept(None, version)


def write(file: Path, parts: Parts, sizes: Sizes, lines: list[str], begun: dict[str, str]) -> None:
    """A file with the tables and one with the records: ``.md`` and ``.json``."""
    file.parent.mkdir(parents=True, exist_ok=True)
    tables = [sheet.markdown() for sheet in (*sheets(parts, sizes), goal_sheet(goals(parts, sizes)))]
    file.with_suffix(".md").write_text("\n\n".join([*tables, *lines]) + "\n")
    file.with_suffix(".json").write_text(json.dumps({"stamp": begun, "about": lines, "parts": parts}, indent=1) + "\n")


if __name__ == "__main__":
    obey_kill()
    main()
