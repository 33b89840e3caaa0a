"""``python -m bench.ik``: solve rates and times of inverse kinematics; writes inverse_kinematics.md and .json."""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from rich.console import Console
from rich.table import Table

from bench.harness import machine
from bench.ik.chains import CHAINS, Chain, Judge, Problem, configuration, prepare
from bench.pool import ROOT

#: Poses of a quick run and of a full one; those of the peers
QUICK, FULL, PEERS = 1000, 10_000, 300

HEAD = (
    "chain", "joints", "solver", "poses", "solved [%]", "+- [%]", "TRAC-IK published [%]", "median [us]",
    "95 % [us]", "99.9 % [us]", "mean [us]",
)  # fmt: skip

NOTES = """\
Protocol of TRAC-IK: poses of joint vectors that are uniform within the limits (seed {seed}; joints without limits: \
all angles), every search from the middle of the limits, solved where every component of the position's error (m) and \
of the rotation's (the logarithm in the axes of the base, rad) is at most {tolerance:g} within {budget:g} ms and the \
limits of the URDF are kept, as Pinocchio judges. One thread; wall-clock time of the whole Python call, on a machine \
with a load of {load:.1f} at the start. "+-" is one binomial standard error. Times are of all calls, failures too. \
pink and mink: their own convergence loop, gain 1, Levenberg-Marquardt damping 1e-3, position limits, DAQP, no \
restarts, the same budget. Published rates: those of TRAC-IK's authors, of another machine."""


def main() -> None:
    """Parse the arguments and run."""
    parser = argparse.ArgumentParser(prog="bench.ik", description=__doc__)
    parser.add_argument("--full", action="store_true", help=f"{FULL} poses a chain instead of {QUICK}")
    parser.add_argument("--count", type=int, help="poses a chain")
    parser.add_argument("--peers-count", type=int, default=PEERS, help="poses a chain for pink and mink")
    parser.add_argument("--chains", nargs="+", default=[c.name for c in CHAINS], choices=[c.name for c in CHAINS])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--budget", type=float, default=0.005, help="time of a search [s]")
    parser.add_argument("--tolerance", type=float, default=1e-5)
    parser.add_argument("--peers-python", help="interpreter with pink and mink; without it they are left out")
    parser.add_argument("--work", type=Path, default=ROOT / "build" / "bench" / "ik")
    parser.add_argument("--output", type=Path, help="folder for inverse_kinematics.md and .json; none are written else")
    chosen = parser.parse_args()
    console = Console() if sys.stdout.isatty() else Console(width=140)
    chosen.count = chosen.count or (FULL if chosen.full else QUICK)
    load, rows = os.getloadavg()[0], []
    if not chosen.peers_python:
        console.print("pink and mink are left out: no --peers-python was given")
    for chain in (c for c in CHAINS if c.name in chosen.chains):
        rows += measure(chain, chosen, console)
    notes = NOTES.format(seed=chosen.seed, tolerance=chosen.tolerance, budget=1e3 * chosen.budget, load=load)
    table = Table(*HEAD)
    for row in rows:
        table.add_row(*texts(row))
    console.print(table)
    console.print(notes, markup=False)
    if chosen.output:
        chosen.output.mkdir(parents=True, exist_ok=True)
        lines = ["# Inverse kinematics", "", "| " + " | ".join(HEAD) + " |", "|" + "---|" * len(HEAD)]
        lines += ["| " + " | ".join(texts(row)) + " |" for row in rows]
        (chosen.output / "inverse_kinematics.md").write_text("\n".join([*lines, "", notes, ""]))
        result = {"machine": machine(), "notes": notes, "rows": rows}
        (chosen.output / "inverse_kinematics.json").write_text(json.dumps(result, indent=1) + "\n")


def measure(chain: Chain, chosen: argparse.Namespace, console: Console) -> list[dict[str, Any]]:
    """Rows of all contenders on one chain."""
    folder = (chosen.work / chain.name.replace(" ", "_")).absolute()
    folder.mkdir(parents=True, exist_ok=True)
    problem = prepare(chain, folder, chosen.count, chosen.seed)
    counts = {"wbc": chosen.count, "pink": chosen.peers_count, "mink": chosen.peers_count}
    write(problem, folder, counts, chosen)
    pythons = {"wbc": sys.executable}
    if chosen.peers_python:
        peers = str(Path(chosen.peers_python).absolute())
        pythons |= {"pink": peers, "mink": peers}
    rows = []
    for name, python in pythons.items():
        done = subprocess.run(
            [python, "-m", "bench.ik.contenders", name, str(folder)],
            cwd=ROOT,
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode != 0:
            console.print(f"{chain.name}: {name} failed: {(done.stderr.splitlines() or ['no message'])[-1]}")
            continue
        rows.append(judged(problem, name, folder, chosen))
    return rows


def write(problem: Problem, folder: Path, counts: dict[str, int], chosen: argparse.Namespace) -> None:
    """What the contenders read."""
    from wbc.robots import load

    model = pin.buildModelFromUrdf(str(problem.urdf))
    given = {
        "urdf": str(problem.urdf),
        "tip": problem.chain.tip,
        "joints": problem.joints,
        "start": problem.start.tolist(),
        "q0": configuration(model, problem.start).tolist(),
        "unbounded": [int(j.nq) == 2 for j in list(model.joints)[1:]],
        "length": load(problem.urdf, shapes="none").characteristic_length,
        "budget": chosen.budget,
        "tolerance": chosen.tolerance,
        "counts": counts,
    }
    (folder / "given.json").write_text(json.dumps(given))
    np.save(folder / "poses.npy", problem.poses)


def judged(problem: Problem, name: str, folder: Path, chosen: argparse.Namespace) -> dict[str, Any]:
    """Rate and times of one contender."""
    answers, judge = np.load(folder / f"{name}.npz"), Judge(problem)
    pairs = zip(answers["q"], problem.poses, strict=False)
    good = np.array([judge.accepts(q, pose, chosen.tolerance) for q, pose in pairs])
    rate, micro = float(good.mean()), 1e6 * answers["seconds"]
    return {
        "chain": problem.chain.name,
        "joints": len(problem.joints),
        "solver": name,
        "poses": len(good),
        "rate": 100 * rate,
        "error": 100 * float(np.sqrt(rate * (1 - rate) / len(good))),
        "published": problem.chain.published,
        "times": [float(np.percentile(micro, p)) for p in (50, 95, 99.9)] + [float(micro.mean())],
    }


def texts(row: dict[str, Any]) -> list[str]:
    """A row of the table."""
    published = f"{row['published']:.2f}" if row["published"] is not None and row["solver"] == "wbc" else "-"
    times = [f"{t:.0f}" for t in row["times"]]
    first = [row["chain"], str(row["joints"]), row["solver"], str(row["poses"])]
    return [*first, f"{row['rate']:.2f}", f"{row['error']:.2f}", published, *times]


if __name__ == "__main__":
    main()
