"""``python -m bench``: prepare the problems, measure, print, write results.json and results.md."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from rich.console import Console

from bench import report
from bench.code.run import measure as measure_code
from bench.curve_report import draw
from bench.curve_run import measure_curves
from bench.deadlines.course import KINDS
from bench.deadlines.run import measure as measure_deadlines
from bench.figures.index import write_blocks
from bench.figures.store import stamp
from bench.harness import Plan, machine, measure, measure_startup
from bench.pool import ROOT
from bench.prepare import prepare
from bench.program import publish
from bench.versions import versions
from wbc.interrupts import obey_interrupts
from wbc.native import toolchain

OWN = ("wbc", "casadi", "pin", "numpy", "daqp")
PEERS = ("pin-pink", "mink", "mujoco", "placo", "qpsolvers", "daqp", "quadprog", "pin", "numpy")
PROBLEMS = ("panda", "ur5", "talos")
#: The problems of growing size, all of them; the exported tick on the problems; caps on iterations
CURVES, CODE, DEADLINES = "curves", "code", "deadlines"
PARTS = (*PROBLEMS, CURVES, CODE, DEADLINES)


def main() -> None:
    """Parse the arguments and run."""
    parser = argparse.ArgumentParser(prog="bench", description=__doc__)
    parser.add_argument("--peers-python", help="interpreter with the peers; without it they are left out")
    parser.add_argument("--rounds", type=int, help="rounds a problem")
    parser.add_argument("--problems", nargs="+", default=PARTS, choices=PARTS)
    parser.add_argument("--work", type=Path, default=ROOT / "build" / "bench", help="folder for the problems")
    parser.add_argument(
        "--output", type=Path, help="folder for results.json and results.md; default: bench for whole runs, else build"
    )
    chosen = parser.parse_args()
    whole = chosen.output is None and chosen.peers_python and chosen.rounds is None and set(chosen.problems) == {*PARTS}
    chosen.output = chosen.output or ROOT / ("bench" if whole else "build/bench")
    # Not resolved: a virtual environment's interpreter is a link
    peers = str(Path(chosen.peers_python).absolute()) if chosen.peers_python else None
    plan = Plan(sys.executable, peers, chosen.work, chosen.rounds, [n for n in PROBLEMS if n in chosen.problems])
    about, begun = machine(), stamp()
    prepare(plan.folder)
    with Console(stderr=True).status("") as status:
        results = {
            "stamp": begun,
            "machine": about,
            "versions": versions(plan.python, OWN, plan.peers_python, PEERS),
            "startup": measure_startup(plan, status.update),
            "problems": {name: measure(plan, name, status.update) for name in plan.names},
        }
        if CURVES in chosen.problems:
            results[CURVES] = measure_curves(peers, plan.folder / "curves", chosen.rounds, status.update)
        if CODE in chosen.problems and toolchain.available():
            results[CODE] = {name: measure_code(plan, name, status.update) for name in PROBLEMS}
        if DEADLINES in chosen.problems and toolchain.available():
            results[DEADLINES] = {name: measure_deadlines(plan, name, status.update) for name in KINDS}
    publish(chosen.output / "results", report.sheets(results), report.notes(results), results)
    if CURVES in results and peers is not None:
        draw(results[CURVES], (ROOT / "docs" / "images" if whole else chosen.output) / "bench_curves.png")
    if whole:
        write_blocks()


if __name__ == "__main__":
    obey_interrupts()
    main()
