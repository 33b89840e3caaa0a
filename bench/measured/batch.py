"""Ticks a second of many robots, beside mink and pink."""

from __future__ import annotations

import tempfile
from pathlib import Path
from time import perf_counter

import numpy as np

from bench.harness import PEERS_PYTHON
from bench.ours import Ours
from bench.pool import contest
from bench.prepare import panda, talos
from bench.problems import Case, load
from bench.sheet import Sheet
from wbc.validation import Array

#: Passes of a problem's path that a batch has at once, and how often it is timed
PASSES, TURNS = {"panda": 50, "talos": 10}, 7


def parts() -> dict[str, Sheet | str]:
    """Rates."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for name, make in (("panda", panda), ("talos", talos)):
            place = make(Path(folder) / name)
            case = load(place)
            alone = single(case)
            by_threads = [rate(case, PASSES[name], threads) for threads in (1, 2)]
            peers = [peer(contender, place, case) for contender in ("mink + daqp", "pink + daqp")]
            cells = [f"{x:,.0f}" if x else "" for x in (alone, *by_threads, *peers)]
            rows.append((case.problem.title, *cells))
    columns = (
        "ticks a second",
        "`step` in a loop",
        "batch, 1 thread",
        "batch, 2 threads",
        "mink + daqp",
        "pink + daqp",
    )
    return {"rates": Sheet("", columns, rows)}


def states(case: Case) -> tuple[Ours, Array]:
    """A contender, and the configurations of its path [ticks, nq]."""
    ours = Ours(case)
    found = []
    for k in range(case.ticks):
        ours.aim(k)
        found.append(ours.q.copy())
        ours.call()
        ours.settle()
    return ours, np.stack(found)


def single(case: Case) -> float:
    """Ticks a second of one controller along the path, targets set in every tick."""
    ours, q = states(case)
    least = np.inf
    for _ in range(TURNS):
        began = perf_counter()
        for k in range(case.ticks):
            ours.aim(k)
            _ = ours.controller.step(q[k]).v
        least = min(least, (perf_counter() - began) / case.ticks)
    return 1.0 / least


def rate(case: Case, passes: int, threads: int) -> float:
    """The same of a batch, each robot at another place of the path; targets set in every tick."""
    ours, q = states(case)
    count = passes * case.ticks
    batch = ours.controller.batch(count, threads=threads)
    many = np.tile(q, (passes, 1))
    poses = [np.tile(case.poses[:, k], (passes, 1, 1)) for k in range(len(case.problem.frames))]
    targets = dict(zip(case.problem.frames, poses, strict=True))
    if case.problem.com:
        targets["com"] = np.tile(case.com, (passes, 1))
    least = np.inf
    for _ in range(TURNS):
        began = perf_counter()
        batch.set(**targets)
        step = batch.step(many)
        least = min(least, perf_counter() - began)
    assert step.solved.mean() > 0.99, step
    return count / least


def peer(contender: str, folder: Path, case: Case) -> float:
    """Ticks a second of a peer along the path, targets set in every tick; 0 where it is not installed."""
    if not PEERS_PYTHON.exists():
        return 0.0
    with contest({contender: str(PEERS_PYTHON)}, folder) as workers:
        workers[contender].ask("time", ticks=case.ticks)
        return 1e9 / float(np.median(workers[contender].ask("time", ticks=case.ticks)["cycle"]))
