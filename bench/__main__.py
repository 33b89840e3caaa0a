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
from bench.cycle_run import measure as measure_cycles
from bench.deadlines.course import KINDS
from bench.deadlines.run import measure as measure_deadlines
from bench.figures.index import write_blocks
from bench.figures.store import stamp
from bench.harness import machine
from bench.pool import ROOT
from bench.prepare import prepare
from bench.program import publish
from bench.versions import versions
from wbc.interrupts import obey_interrupts
from wbc.native import toolchain

OWN = ("wbc", "casadi", "pin", "numpy", "daqp")
PEERS = ("pin-pink", "mink", "mujoco", "placo", "qpsolvers", "daqp", "quadprog", "pin", "numpy")
PROBLEMS = ("panda", "ur5", "talos")
#: Whole cycles on the three problems, and problems of growing size, beside the peers; the exported tick on the three;
#: caps on iterations
PARTS = (CYCLES, CURVES, CODE, DEADLINES) = ("problems", "curves", "code", "deadlines")


def main() -> None:
    """Parse the arguments and run."""
    parser = argparse.ArgumentParser(prog="bench", description=__doc__)
    parser.add_argument("--peers-python", help="interpreter with the peers; without it they are left out")
    parser.add_argument("--rounds", type=int, help="rounds a problem")
    parser.add_argument("--parts", nargs="+", default=PARTS, choices=PARTS)
    parser.add_argument("--work", type=Path, default=ROOT / "build" / "bench", help="folder for the problems")
    parser.add_argument(
        "--output", type=Path, help="folder for results.json and results.md; default: bench for whole runs, else build"
    )
    chosen = parser.parse_args()
    whole = chosen.output is None and chosen.peers_python and chosen.rounds is None and set(chosen.parts) == {*PARTS}
    chosen.output = chosen.output or ROOT / ("bench" if whole else "build/bench")
    # Not resolved: a virtual environment's interpreter is a link
    peers = str(Path(chosen.peers_python).absolute()) if chosen.peers_python else None
    about, begun = machine(), stamp()
    with Console(stderr=True).status("") as status:
        results = {"stamp": begun, "machine": about, "versions": versions(sys.executable, OWN, peers, PEERS)}
        folders = dict(zip(PROBLEMS, prepare(chosen.work), strict=True))
        given = chosen.rounds, status.update
        if CYCLES in chosen.parts:
            results[CYCLES] = {name: measure_cycles(folder, peers, *given) for name, folder in folders.items()}
        if CURVES in chosen.parts:
            results[CURVES] = measure_curves(peers, chosen.work / "curves", *given)
        if CODE in chosen.parts and toolchain.available():
            results[CODE] = {name: measure_code(folder, *given) for name, folder in folders.items()}
        if DEADLINES in chosen.parts and toolchain.available():
            results[DEADLINES] = {name: measure_deadlines(folders[name], *given) for name in KINDS}
    publish(chosen.output / "results", report.sheets(results), report.notes(results), results)
    if CURVES in results and peers is not None:
        draw(results[CURVES], (ROOT / "docs" / "images" if whole else chosen.output) / "bench_curves.png")
    if whole:
        write_blocks()


if __name__ == "__main__":
    obey_interrupts()
    main()
