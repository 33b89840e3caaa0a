"""Measures the growing problems: one process a contender, which opens one problem after the other."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from bench.curves import Point, points, prepare_curves
from bench.harness import PEERS, pythons
from bench.pool import Worker, contest, turns
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
    found, out = points(), []
    with contest(pythons(peers_python, (*PEERS, DEFAULTS)), folder / found[0].folder) as workers:
        for point in found:
            say(f"curves: {point.curve}, {point.label}")
            some = {name: worker for name, worker in workers.items() if name != DEFAULTS or point.curve == "g1"}
            out.append(measure_point(point, folder / point.folder, some, rounds or ROUNDS))
    return out


def measure_point(point: Point, folder: Path, workers: Mapping[str, Worker], rounds: int) -> dict[str, Any]:
    """All contenders on one problem, in alternating rounds."""
    case = load(folder)
    for worker in workers.values():
        worker.ask("open", folder=str(folder))
    calls: dict[str, list[float]] = {name: [] for name in workers}
    states: dict[str, Any] = {}
    for _, name in turns(list(workers), rounds):
        answer = workers[name].ask("sample", budget=BUDGET)
        calls[name] += answer["call"]
        states[name] = answer["states"]
    return {
        "curve": point.curve, "x": point.x, "label": point.label,
        "contenders": {
            name: {"median": float(np.median(calls[name])) / 1e3, **tracking(case, states[name])} for name in workers
        },
    }  # fmt: skip


def tracking(case: Case, states: Sequence[Sequence[float]]) -> dict[str, float | None]:
    """What became of a path, by Pinocchio and Coal: the error of positions at its end (None if a contender did not get
    there) and the least clearance [m].
    """
    problem, referee = case.problem, Referee(case)
    whole, clearances = len(states) == case.ticks, []
    for state in states[::STRIDE] if problem.pairs else ():
        pin.framesForwardKinematics(referee.model, referee.data, np.array(state))
        clearances.append(float(distances(referee.model, referee.data, problem.solids, problem.pairs).min()))
    position = referee.errors(np.array(states[-1]), case.ticks - 1)[0] if whole else None
    return {"position": position, "clearance": min(clearances, default=None)}
