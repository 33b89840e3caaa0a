"""The results of inverse kinematics as the table of docs/ik.md."""

from __future__ import annotations

from typing import Any

from bench.ik.run import OURS, PEERS
from bench.sheet import Sheet


def summary(results: dict[str, Any]) -> str:
    """A row a chain, the peers beside."""
    names = [peer for peer in PEERS if any(row["solver"] == peer for row in results["rows"])]
    peers = [f"{peer}: solved [%], mean [us]" for peer in names]
    head = ("chain", "joints", "solved [%]", "TRAC-IK published [%]", "mean [us]", "95 % [us]", *peers)
    rows = []
    other = {(row["chain"], row["solver"]): f"{row['rate']:.0f}, {row['mean']:.0f}" for row in results["rows"]}
    for row in results["rows"]:
        if row["solver"] == OURS:
            published = "-" if row["published"] is None else f"{row['published']:.2f}"
            cells = (f"{row['rate']:.2f}", published, f"{row['mean']:.0f}", f"{row['p95']:.0f}")
            beside = (other.get((row["chain"], peer), "-") for peer in names)
            rows.append((row["chain"], str(row["joints"]), *cells, *beside))
    count = {row["solver"]: row["poses"] for row in results["rows"]}
    told = ", ".join(f"{n} for {name}" for name, n in count.items())
    after = [f"Poses a chain: {told} (seed {results['protocol']['seed']})."]
    after += [
        f"{b['chain']}, `solve_batch` of {b['poses']} poses, {b['threads']} threads: {b['seconds']:.2f} s."
        for b in results["batches"][:1]
    ]
    return Sheet("", head, rows).markdown().split("\n\n", 1)[1] + "\n\n" + " ".join(after)
