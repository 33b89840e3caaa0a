"""The results of inverse kinematics as tables and as a page."""

from __future__ import annotations

from typing import Any

from bench.ik.run import OURS, PEERS
from bench.sheet import Sheet

Results = dict[str, Any]

NOTES = """\
Protocol of TRAC-IK: poses of joint vectors that are uniform within the limits (seed {seed}; joints without limits: \
all angles), every search from the middle of the limits, solved where every component of the position's error (m) and \
of the rotation's (the logarithm in the axes of the base, rad) is at most {tolerance:g} within {budget:g} ms and the \
limits of the URDF are kept, as Pinocchio judges. Times are those of the whole Python call, wall-clock, of all calls, \
failures too; "+-" is one binomial standard error.

pink and mink: their own convergence loop, gain 1, Levenberg-Marquardt damping 1e-3, position limits, DAQP, no \
restarts, the same budget, on the first poses of the same draw, in turns with wbc.

Published: the rates that TRAC-IK's authors give, of another machine. Goal: that rate less two \
binomial standard errors of it at so many poses."""


def main_sheet(results: Results) -> Sheet:
    """Rates and times."""
    columns = (
        "chain", "joints", "solver", "poses", "solved [%]", "+- [%]", "TRAC-IK published [%]", "goal [%]", "met",
        "mean [us]", "median [us]", "95 % [us]", "99.9 % [us]",
    )  # fmt: skip
    out = []
    for row in results["rows"]:
        goal = row.get("goal")
        told = ("-", "-", "-") if goal is None else (f"{row['published']:.2f}", f"{goal:.2f}", met(row))
        times = (f"{row[key]:.0f}" for key in ("mean", "median", "p95", "p99.9"))
        first = (row["chain"], str(row["joints"]), row["solver"], str(row["poses"]))
        out.append((*first, f"{row['rate']:.2f}", f"{row['error']:.2f}", *told, *times))
    return Sheet("Inverse kinematics, protocol of TRAC-IK", columns, out)


def met(row: dict[str, Any]) -> str:
    """Whether a rate reaches its goal."""
    return "yes" if row["rate"] >= row["goal"] else "no"


def batch_sheet(results: Results) -> Sheet:
    """Many targets in one call."""
    columns = ("chain", "poses", "threads", "solved [%]", "whole call [s]", "us a pose", "of it searches [us]")
    out = []
    for row in results["batches"]:
        whole, search = (1e6 * spent / row["poses"] for spent in (row["seconds"], row["search"] / row["threads"]))
        first = (row["chain"], str(row["poses"]), str(row["threads"]), f"{row['rate']:.2f}")
        out.append((*first, f"{row['seconds']:.3f}", f"{whole:.1f}", f"{search:.1f}"))
    return Sheet("Many targets: one call of solve_batch", columns, out)


def chain_sheet(results: Results) -> Sheet:
    """What the chains are."""
    rows = [(c["chain"], c["urdf"], c["tip"], "; ".join(c["limits"])) for c in results["chains"]]
    return Sheet("Chains, of the example-robot-data wheel", ("chain", "URDF", "tip", "limits [rad]"), rows)


def sheets(results: Results) -> list[Sheet]:
    """All tables that have rows."""
    every = [main_sheet(results), batch_sheet(results), chain_sheet(results)]
    return [sheet for sheet in every if sheet.rows]


def notes(results: Results) -> list[str]:
    """What the reader must know."""
    host, asked = results["machine"], results["protocol"]
    text = NOTES.format(seed=asked["seed"], tolerance=asked["tolerance"], budget=1e3 * asked["budget"])
    out = [
        f"{host['processor']}, Python {host['python']}; {host['cores']}; one thread a process; load {host['load']}.",
        f"Garbage collector {host['garbage collector']}; {host['threads']}.",
        ", ".join(f"{name} {version}" for name, version in results["versions"].items()) + ".",
        *text.split("\n\n"),
    ]
    return [f"Ended by Ctrl-C in {results['interrupted']}.", *out] if results["interrupted"] else out


def summary(results: Results) -> str:
    """The table of docs/ik.md: a row a chain, the peers beside."""
    names = [peer for peer in PEERS if any(row["solver"] == peer for row in results["rows"])]
    peers = [f"{peer}: solved [%], mean [us]" for peer in names]
    head = ("chain", "joints", "solved [%]", "TRAC-IK published [%]", "mean [us]", "95 % [us]", *peers)
    rows = []
    other = {(row["chain"], row["solver"]): f"{row['rate']:.0f}, {row['mean']:.0f}" for row in results["rows"]}
    for row, cells in zip(results["rows"], main_sheet(results).rows, strict=True):
        if row["solver"] == OURS:
            beside = (other.get((row["chain"], peer), "-") for peer in names)
            rows.append((*cells[:2], *(cells[k] for k in (4, 6, 9, 11)), *beside))
    count = {row["solver"]: row["poses"] for row in results["rows"]}
    told = ", ".join(f"{n} for {name}" for name, n in count.items())
    after = f"Poses a chain: {told} (seed {results['protocol']['seed']})."
    batches = [
        f"{b['chain']}, `solve_batch` of {b['poses']} poses, {b['threads']} threads: {b['seconds']:.2f} s."
        for b in results["batches"][:1]
    ]
    return Sheet("", head, rows).markdown().split("\n\n", 1)[1] + "\n\n" + " ".join([after, *batches])
