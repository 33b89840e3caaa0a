"""Measures the contenders on a chain in alternating blocks of poses, so that a drift of the machine hits all alike."""

from __future__ import annotations

import contextlib
import itertools
import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from bench.ik.chains import Judge, Problem, configuration
from bench.pool import Worker, WorkerError, cores

OURS, PEERS = "wbc", ("pink", "mink")
MODULE = "bench.ik.contenders"
#: Turns that the contenders take
BLOCKS = 20


@dataclass(frozen=True)
class Protocol:
    """What is asked: ``budget`` of a search [s], ``tolerance`` of every component of the error [m, rad]."""

    seed: int
    budget: float
    tolerance: float


@dataclass
class Answers:
    """Of one contender on one chain: configurations, and the durations of the calls [s]."""

    contender: str
    q: list[list[float]] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)


def write(problem: Problem, folder: Path, protocol: Protocol) -> None:
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
        "budget": protocol.budget,
        "tolerance": protocol.tolerance,
    }
    (folder / "given.json").write_text(json.dumps(given))
    np.save(folder / "poses.npy", problem.poses)


def blocks(count: int) -> list[tuple[int, int]]:
    """First and end of the poses of each turn."""
    edges = np.linspace(0, count, BLOCKS + 1).astype(int)
    return [(int(a), int(b)) for a, b in itertools.pairwise(edges)]


def measure(
    folder: Path, pythons: Mapping[str, str], counts: Mapping[str, int], say: Callable[[str], None]
) -> Iterator[dict[str, Answers]]:
    """Everything that was answered so far, after each turn; contenders that fail are said and left out."""
    core, _ = cores()
    found = {name: Answers(name) for name in pythons}
    with contextlib.ExitStack() as stack:
        workers = {}
        for name, python in pythons.items():
            try:
                workers[name] = stack.enter_context(Worker(python, name, folder, core, module=MODULE))
            except WorkerError as error:
                say(f"left out: {error}")
                del found[name]
        for k in range(BLOCKS):
            names = list(workers)
            turn = k % max(1, len(names))
            for name in names[turn:] + names[:turn]:
                first, end = blocks(counts[name])[k]
                if end > first:
                    answer = workers[name].ask("solve", first=first, end=end)
                    found[name].q += answer["q"]
                    found[name].seconds += answer["seconds"]
            yield found


def many(problem: Problem, folder: Path, python: str, tolerance: float) -> dict[str, Any]:
    """All poses in one call, on all cores."""
    with Worker(python, OURS, folder, None, module=MODULE) as worker:
        answer = worker.ask("batch")
    good = judged(problem, answer["q"], tolerance)
    return {"chain": problem.chain.name, "poses": len(good), "rate": 100.0 * float(good.mean()),
            "seconds": answer["seconds"], "threads": answer["threads"]}  # fmt: skip


def judged(problem: Problem, q: list[list[float]], tolerance: float) -> np.ndarray:
    """Which answers count."""
    judge = Judge(problem)
    return np.array([judge.accepts(np.array(a), pose, tolerance) for a, pose in zip(q, problem.poses, strict=False)])


def rows(problem: Problem, found: Mapping[str, Answers], tolerance: float) -> list[dict[str, Any]]:
    """A row for each contender that has answered: rate [%], times [us]."""
    out = []
    for name, answers in found.items():
        if not answers.seconds:
            continue
        good, micro = judged(problem, answers.q, tolerance), 1e6 * np.array(answers.seconds)
        median, p95, p999 = (float(np.percentile(micro, p)) for p in (50.0, 95.0, 99.9))
        out.append({
            "chain": problem.chain.name, "joints": len(problem.joints), "solver": name, "poses": len(good),
            "rate": 100.0 * float(good.mean()), "published": problem.chain.published,
            "mean": float(micro.mean()), "median": median, "p95": p95, "p99.9": p999,
        })  # fmt: skip
    return out
