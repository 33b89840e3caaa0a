"""Asks the contenders on a chain in alternating blocks of poses, so that a drift of the machine hits all alike."""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from bench.harness import OURS
from bench.ik.chains import Judge, Problem, configuration
from bench.pool import contest, turns
from bench.program import Record
from bench.sheet import Sheet
from wbc.robots import load

PEERS = ("pink", "mink")
MODULE = "bench.ik.contenders"
#: Turns that the contenders take
BLOCKS = 20
#: Seed of the poses, and what every component of an error may be [m, rad]
SEED, TOLERANCE = 1, 1e-5


def write(problem: Problem, folder: Path, budget: float) -> None:
    """What the contenders read; ``budget`` of a search [s]."""
    model = pin.buildModelFromUrdf(str(problem.urdf))
    given = {
        "urdf": str(problem.urdf),
        "tip": problem.chain.tip,
        "joints": problem.joints,
        "start": problem.start.tolist(),
        "q0": configuration(model, problem.start).tolist(),
        "unbounded": [int(j.nq) == 2 for j in list(model.joints)[1:]],
        "length": load(problem.urdf, shapes="none").characteristic_length,
        "budget": budget,
        "tolerance": TOLERANCE,
    }
    (folder / "given.json").write_text(json.dumps(given))
    np.save(folder / "poses.npy", problem.poses)


def answers(folder: Path, pythons: Mapping[str, str], counts: Mapping[str, int]) -> Iterator[Record]:
    """Configurations and durations [s] of each contender's next block of poses; at last all poses in one call of ours,
    on all cores.
    """
    edges = {name: np.linspace(0, counts[name], BLOCKS + 1).astype(int).tolist() for name in pythons}
    with contest(pythons, folder, MODULE) as workers:
        for k, name in turns(list(workers), BLOCKS):
            first, end = edges[name][k : k + 2]
            yield {"solver": name, **workers[name].ask("solve", first=first, end=end)}
    with contest({OURS: pythons[OURS]}, folder, MODULE) as workers:
        yield {"solver": "batch", **workers[OURS].ask("batch")}


def rows(problem: Problem, records: list[Record]) -> list[Record]:
    """A row for each contender that has answered: rate [%], times [us]; of the batch its time [s]."""
    out, judge = [], Judge(problem)
    for name in dict.fromkeys(record["solver"] for record in records):
        some = [record for record in records if record["solver"] == name]
        q = list(itertools.chain(*(record["q"] for record in some)))
        good = [judge.accepts(np.array(a), pose, TOLERANCE) for a, pose in zip(q, problem.poses, strict=False)]
        row = {"chain": problem.chain.name, "solver": name, "poses": len(good), "rate": 100.0 * float(np.mean(good))}
        if name == "batch":
            out.append({**row, "seconds": some[0]["seconds"], "threads": some[0]["threads"]})
            continue
        micro = 1e6 * np.concatenate([record["seconds"] for record in some])
        times = {"mean": float(micro.mean()), "p95": float(np.percentile(micro, 95.0))}
        out.append({**row, "joints": len(problem.joints), "published": problem.chain.published, **times})
    return out


def summary(results: dict[str, Any]) -> str:
    """The table of docs/ik.md: a row a chain, the peers beside."""
    names = [peer for peer in PEERS if any(row["solver"] == peer for row in results["rows"])]
    peers = [f"{peer}: solved [%], mean [us]" for peer in names]
    head = ("chain", "joints", "solved [%]", "TRAC-IK published [%]", "mean [us]", "95 % [us]", *peers)
    shown = []
    other = {(row["chain"], row["solver"]): f"{row['rate']:.0f}, {row['mean']:.0f}" for row in results["rows"]}
    for row in results["rows"]:
        if row["solver"] == OURS:
            published = "-" if row["published"] is None else f"{row['published']:.2f}"
            cells = (f"{row['rate']:.2f}", published, f"{row['mean']:.0f}", f"{row['p95']:.0f}")
            beside = (other.get((row["chain"], peer), "-") for peer in names)
            shown.append((row["chain"], str(row["joints"]), *cells, *beside))
    count = {row["solver"]: row["poses"] for row in results["rows"]}
    told = ", ".join(f"{n} for {name}" for name, n in count.items())
    after = [f"Poses a chain: {told} (seed {results['protocol']['seed']})."]
    after += [
        f"{b['chain']}, `solve_batch` of {b['poses']} poses, {b['threads']} threads: {b['seconds']:.2f} s."
        for b in results["batches"][:1]
    ]
    return Sheet("", head, shown).markdown().split("\n\n", 1)[1] + "\n\n" + " ".join(after)
