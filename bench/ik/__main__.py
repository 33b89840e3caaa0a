"""``python -m bench.ik``: solve rates and times of inverse kinematics, printed and written to ik.json.

Ctrl-C ends the measuring; what was measured until then is printed and written.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from bench.figures.index import write_blocks
from bench.figures.store import stamp
from bench.harness import OURS, interpreter, machine, pythons, versions
from bench.ik.chains import CHAINS, prepare
from bench.ik.run import BLOCKS, PEERS, SEED, TOLERANCE, answers, rows, summary, write
from bench.pool import ROOT
from bench.program import bars, measure, terminal
from wbc.interrupts import obey_interrupts

#: Poses a chain for wbc and for each peer, in a quick run and in a full one
QUICK, FULL = (1000, 100), (10_000, 1000)
OWN, THEIRS = ("wbc", "casadi", "pin", "numpy"), ("pin-pink", "mink", "mujoco", "qpsolvers", "daqp", "pin", "numpy")


def arguments(given: list[str] | None) -> argparse.Namespace:
    """What is asked for."""
    parser = argparse.ArgumentParser(prog="python -m bench.ik", description=__doc__)
    parser.add_argument("--full", action="store_true", help=f"{FULL[0]} poses a chain instead of {QUICK[0]}")
    parser.add_argument("--count", type=int, help="poses a chain")
    parser.add_argument("--chains", nargs="+", default=[c.name for c in CHAINS], choices=[c.name for c in CHAINS])
    parser.add_argument("--budget", type=float, default=0.005, help="time of a search [s]")
    parser.add_argument("--peers-python", type=interpreter, help="with pink and mink; without it they are left out")
    parser.add_argument("--output", type=Path, help="folder; by default bench for full runs, else build/bench")
    chosen = parser.parse_args(given)
    chosen.output = chosen.output or (ROOT / "bench" if chosen.full else ROOT / "build" / "bench")
    return chosen


def main(given: list[str] | None = None) -> None:
    """Measure all chains, or those until Ctrl-C, print and write."""
    chosen = arguments(given)
    own, peers = FULL if chosen.full else QUICK
    count, who = max(1, chosen.count or own), pythons(chosen.peers_python, PEERS)
    if chosen.peers_python is None:
        terminal().print("pink and mink are left out: no --peers-python was given")
    results: dict[str, Any] = {
        "stamp": stamp(), "machine": machine(), "versions": versions(sys.executable, OWN),
        "protocol": {"seed": SEED, "budget": chosen.budget, "tolerance": TOLERANCE},
    }  # fmt: skip
    if chosen.peers_python:
        results["peers' versions"] = versions(chosen.peers_python, THEIRS)
    counts = {name: count if name == OURS else min(count, peers) for name in who}
    problems, work = {}, {}
    for chain in (chain for chain in CHAINS if chain.name in chosen.chains):
        folder = (ROOT / "build" / "bench" / "ik" / chain.name.replace(" ", "_")).absolute()
        folder.mkdir(parents=True, exist_ok=True)
        problems[chain.name] = prepare(chain, folder, count, SEED)
        write(problems[chain.name], folder, chosen.budget)
        work[chain.name] = (BLOCKS * len(who) + 1, answers(folder, who, counts))
    with bars() as progress:
        found, results["interrupted"] = measure(work, progress)
    judged = [row for name, records in found.items() for row in rows(problems[name], records)]
    results["rows"] = [row for row in judged if row["solver"] != "batch"]
    results["batches"] = [row for row in judged if row["solver"] == "batch"]
    terminal().print(summary(results), markup=False, highlight=False)
    chosen.output.mkdir(parents=True, exist_ok=True)
    (chosen.output / "ik.json").write_text(json.dumps(results, indent=1) + "\n")
    complete = results["interrupted"] is None and len(results["batches"]) == len(CHAINS) and chosen.peers_python
    if complete and chosen.full and chosen.output == ROOT / "bench":
        write_blocks()


if __name__ == "__main__":
    obey_interrupts()
    main()
