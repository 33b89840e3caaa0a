"""Measures the growing problems: one process a contender, which opens one problem after the other."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from bench.curves import Point, points, prepare_curves
from bench.harness import OURS, PEERS
from bench.pool import Worker, cores, turns
from bench.problems import Case, load
from bench.reference import Referee
from bench.scenery import distances

#: On the humanoid only: mink with its own default for which pairs have rows
DEFAULTS = "mink + daqp, rows within 1 cm"
#: Rounds of a problem, and seconds that a contender has in each
ROUNDS, BUDGET = 3, 0.25
#: Every how many ticks clearances are measured
STRIDE = 5
Say = Callable[[str], None]


def measure_curves(peers_python: str | None, folder: Path, rounds: int | None, say: Say) -> list[dict[str, Any]]:
    """All points of all curves."""
    say("curves: preparing")
    prepare_curves(folder)
    found = points()
    core, _ = cores()
    with contextlib.ExitStack() as stack:
        first = folder / found[0].folder
        pythons = {OURS: sys.executable} | ({} if peers_python is None else dict.fromkeys(PEERS, peers_python))
        workers = {n: stack.enter_context(Worker(python, n, first, core)) for n, python in pythons.items()}
        out = []
        for point in found:
            say(f"curves: {point.curve}, {point.label}")
            some = dict(workers)
            if point.curve == "g1" and peers_python is not None:
                some[DEFAULTS] = stack.enter_context(Worker(peers_python, DEFAULTS, folder / point.folder, core))
            out.append(measure_point(point, folder / point.folder, some, rounds or ROUNDS))
    return out


def measure_point(point: Point, folder: Path, workers: Mapping[str, Worker], rounds: int) -> dict[str, Any]:
    """All contenders on one problem, in alternating rounds."""
    case = load(folder)
    facts = {name: worker.ask("open", folder=str(folder))["facts"] for name, worker in workers.items()}
    calls: dict[str, list[float]] = {name: [] for name in workers}
    states: dict[str, Any] = {}
    for _, name in turns(list(workers), rounds):
        answer = workers[name].ask("sample", budget=BUDGET)
        calls[name] += answer["call"]
        states[name] = answer["states"]
    judge = Judge(case)
    return {
        "curve": point.curve, "x": point.x, "label": point.label, "title": case.problem.title,
        "contenders": {
            name: {
                "median": float(np.median(calls[name])) / 1e3, "p99": float(np.percentile(calls[name], 99)) / 1e3,
                "ticks": len(calls[name]), "pairs": facts[name].get("pairs"), **judge.tracking(states[name]),
            }
            for name in workers
        },
    }  # fmt: skip


class Judge:
    """What became of a path, by Pinocchio and Coal."""

    def __init__(self, case: Case) -> None:
        """Load the shared description."""
        self.case, self.referee = case, Referee(case)

    def tracking(self, states: Sequence[Sequence[float]]) -> dict[str, float | None]:
        """Errors at the end of the path (None if a contender did not get there) and the least clearance [m, rad]."""
        problem, model, data = self.case.problem, self.referee.model, self.referee.data
        position: float | None = None
        rotation: float | None = None
        if len(states) == self.case.ticks:
            position, rotation = self.referee.errors(np.array(states[-1]), self.case.ticks - 1)
        least = None
        for state in states[::STRIDE] if problem.pairs else ():
            pin.framesForwardKinematics(model, data, np.array(state))
            found = float(distances(model, data, problem.solids, problem.pairs).min())
            least = found if least is None else min(least, found)
        return {"position": position, "rotation": rotation, "clearance": least}
