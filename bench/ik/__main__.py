"""``python -m bench.ik``: solve rates and times of inverse kinematics, printed and written to ik.json.

Ctrl-C ends the measuring; what was measured until then is printed and written.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from rich.progress import Progress

from bench.figures.index import write_blocks
from bench.figures.store import stamp
from bench.harness import machine
from bench.ik import tables
from bench.ik.chains import CHAINS, Chain, prepare
from bench.ik.run import BLOCKS, OURS, PEERS, Protocol, many, measure, rows, write
from bench.pool import ROOT
from bench.program import bars, terminal
from bench.versions import versions
from wbc.interrupts import obey_interrupts

#: Poses a chain for wbc and for each peer, in a quick run and in a full one
QUICK, FULL = (1000, 100), (10_000, 1000)
OWN, THEIRS = ("wbc", "casadi", "pin", "numpy"), ("pin-pink", "mink", "mujoco", "qpsolvers", "daqp", "pin", "numpy")


def arguments(given: list[str] | None) -> argparse.Namespace:
    """What is asked for."""
    parser = argparse.ArgumentParser(prog="python -m bench.ik", description=__doc__)
    parser.add_argument("--full", action="store_true", help=f"{FULL[0]} poses a chain instead of {QUICK[0]}")
    parser.add_argument("--count", type=int, help="poses a chain")
    parser.add_argument("--peers-count", type=int, help=f"poses a chain for pink and mink: {QUICK[1]}, or {FULL[1]}")
    parser.add_argument("--chains", nargs="+", default=[c.name for c in CHAINS], choices=[c.name for c in CHAINS])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--budget", type=float, default=0.005, help="time of a search [s]")
    parser.add_argument("--tolerance", type=float, default=1e-5)
    parser.add_argument("--peers-python", help="interpreter with pink and mink; without it they are left out")
    parser.add_argument("--work", type=Path, default=ROOT / "build" / "bench" / "ik")
    parser.add_argument(
        "--output", type=Path, help="folder for ik.json; by default bench for full runs, else build/bench"
    )
    chosen = parser.parse_args(given)
    own, peers = FULL if chosen.full else QUICK
    chosen.count = max(1, chosen.count or own)
    chosen.peers_count = min(chosen.count, max(1, chosen.peers_count or peers))
    chosen.output = chosen.output or (ROOT / "bench" if chosen.full else ROOT / "build" / "bench")
    # Not resolved: a virtual environment's interpreter is a link
    chosen.peers_python = str(Path(chosen.peers_python).absolute()) if chosen.peers_python else None
    return chosen


def run(chosen: argparse.Namespace, progress: Progress) -> dict[str, Any]:
    """Measure all chains, or those until Ctrl-C."""
    protocol = Protocol(chosen.seed, chosen.budget, chosen.tolerance)
    pythons = {OURS: sys.executable} | dict.fromkeys(PEERS if chosen.peers_python else (), chosen.peers_python)
    results: dict[str, Any] = {
        "stamp": stamp(), "machine": machine(), "versions": versions(sys.executable, OWN, chosen.peers_python, THEIRS),
        "protocol": vars(protocol), "interrupted": None, "rows": [], "batches": [],
    }  # fmt: skip
    chains = [chain for chain in CHAINS if chain.name in chosen.chains]
    bar = progress.add_task("", total=BLOCKS * len(chains))
    for number, chain in enumerate(chains):
        progress.update(bar, description=chain.name)
        try:
            for _ in one(chain, chosen, protocol, pythons, results, progress):
                progress.advance(bar)
        except KeyboardInterrupt:
            results["interrupted"] = f"{chain.name}, chain {number + 1} of {len(chains)}"
            break
    return results


def one(
    chain: Chain, chosen: argparse.Namespace, protocol: Protocol, pythons: dict[str, str], results: dict[str, Any],
    progress: Progress,
) -> Any:  # fmt: skip
    """Measure a chain; its rows are in the results also where Ctrl-C ends it. Yields after each turn."""
    folder = (chosen.work / chain.name.replace(" ", "_")).absolute()
    folder.mkdir(parents=True, exist_ok=True)
    problem = prepare(chain, folder, chosen.count, chosen.seed)
    write(problem, folder, protocol)
    counts = {name: chosen.count if name == OURS else chosen.peers_count for name in pythons}
    found: dict[str, Any] = {}
    try:
        for answered in measure(folder, pythons, counts, lambda text: progress.console.print(f"{chain.name}: {text}")):
            found = answered
            yield
        results["batches"].append(many(problem, folder, sys.executable, chosen.tolerance))
    finally:
        results["rows"] += rows(problem, found, chosen.tolerance)


def main(given: list[str] | None = None) -> None:
    """Parse the arguments, run, print and write."""
    chosen = arguments(given)
    if chosen.peers_python is None:
        terminal().print("pink and mink are left out: no --peers-python was given")
    with bars() as progress:
        results = run(chosen, progress)
    terminal().print(tables.summary(results), markup=False, highlight=False)
    chosen.output.mkdir(parents=True, exist_ok=True)
    (chosen.output / "ik.json").write_text(json.dumps(results, indent=1) + "\n")
    complete = results["interrupted"] is None and len(results["batches"]) == len(CHAINS) and chosen.peers_python
    if complete and chosen.full and chosen.output == ROOT / "bench":
        write_blocks()


if __name__ == "__main__":
    obey_interrupts()
    main()
