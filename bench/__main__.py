"""``python -m bench``: prepare the problems, measure, print, write results.json and results.md: into bench where all
parts are measured with the peers, else into build/bench.
"""

from __future__ import annotations

import argparse
import sys
from typing import Any

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
from bench.harness import interpreter, machine, versions
from bench.pool import ROOT
from bench.prepare import prepare
from bench.program import publish
from wbc.interrupts import obey_interrupts
from wbc.native import toolchain

OWN = ("wbc", "casadi", "pin", "numpy", "daqp")
THEIRS = ("pin-pink", "mink", "mujoco", "placo", "qpsolvers", "daqp", "quadprog", "pin", "numpy")
PROBLEMS = ("panda", "ur5", "talos")
#: Whole cycles on the three problems, and problems of growing size, beside the peers; the exported tick on the three;
#: caps on iterations
PARTS = (CYCLES, CURVES, CODE, DEADLINES) = ("problems", "curves", "code", "deadlines")


def main() -> None:
    """Parse the arguments and run."""
    parser = argparse.ArgumentParser(prog="bench", description=__doc__)
    parser.add_argument(
        "--peers-python", type=interpreter, help="interpreter with the peers; without it they are left out"
    )
    parser.add_argument("--rounds", type=int, help="rounds a problem")
    parser.add_argument("--parts", nargs="+", default=PARTS, choices=PARTS)
    chosen = parser.parse_args()
    peers, work = chosen.peers_python, ROOT / "build" / "bench"
    whole = peers is not None and chosen.rounds is None and set(chosen.parts) == {*PARTS}
    results: dict[str, Any] = {"stamp": stamp(), "machine": machine(), "versions": versions(sys.executable, OWN)}
    if peers:
        results["versions"] |= {f"peers' {name}": text for name, text in versions(peers, THEIRS).items()}
    with Console(stderr=True).status("") as status:
        folders = dict(zip(PROBLEMS, prepare(work), strict=True))
        given = chosen.rounds, status.update
        if CYCLES in chosen.parts:
            results[CYCLES] = {name: measure_cycles(folder, peers, *given) for name, folder in folders.items()}
        if CURVES in chosen.parts:
            results[CURVES] = measure_curves(peers, work / "curves", *given)
        if CODE in chosen.parts and toolchain.available():
            results[CODE] = {name: measure_code(folder, *given) for name, folder in folders.items()}
        if DEADLINES in chosen.parts and toolchain.available():
            results[DEADLINES] = {name: measure_deadlines(folders[name], *given) for name in KINDS}
    output = ROOT / "bench" if whole else work
    publish(output / "results", report.sheets(results), report.notes(results), results)
    if CURVES in results and peers is not None:
        draw(results[CURVES], (ROOT / "docs" / "images" if whole else output) / "bench_curves.png")
    if whole:
        write_blocks()


if __name__ == "__main__":
    obey_interrupts()
    main()
