"""Plans in slices: when the first command is there, how long ticks take while the rest is planned, and real time."""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np

from bench.walk.courses import COURSES, INCH, RAMPS, Machine, Record
from wbc.walking import Structure, cylinder
from wbc.walking.body_path import BodyPath, grid_path
from wbc.walking.plan import NoPlanError
from wbc.walking.planner import plan_walk
from wbc.walking.replanning import plan_from_stance
from wbc.walking.run.recording import WalkRecorder
from wbc.walking.walk import Walk

#: For the whole plan, from which the first holds are taken and to which the re-grasps are compared [s]
BUDGET = 10.0
#: First commands that are timed on each course, and the longest time from command to command [s]
REPEATS, STALL = 10, 0.05


def planning(it: Machine, speeds: tuple[float, ...] = (3.0, 4.0, 6.0)) -> Iterator[Record]:
    """All courses at some speeds [in/s], by a body that stands on the first holds of the whole plan."""
    structure = cylinder(rigid=True)
    for speed in speeds:
        for name, (begin, end) in COURSES.items():
            path = grid_path([begin, end], speed * INCH)
            whole = plan_walk(it.walker, structure, path, partial=True, time_budget=BUDGET)
            record = {"course": name, "speed": speed, "whole": len(whole.regrasps) if whole.complete else None}
            start = dict(zip([arm.name for arm in it.walker.arms], whole.start, strict=True))
            firsts = [_first(it, structure, path, start) for _ in range(REPEATS)]
            yield {**record, "first_ms": [1e3 * first for first in firsts], **_walked(it, structure, path, start)}


def _first(it: Machine, structure: Structure, path: BodyPath, start: dict[str, str]) -> float:
    """From being told to the first command of the controller [s]."""
    begin = time.perf_counter()
    walk = Walk(it.walker, structure, plan_from_stance(it.walker, structure, path, start), stack=it.stack)
    walk.tick()
    return time.perf_counter() - begin


def _walked(it: Machine, structure: Structure, path: BodyPath, start: dict[str, str]) -> Record:
    """A walk with planner, controller, simulation and log; times of whole ticks, planning included."""
    cpu, costs, arrived, reason = time.process_time(), list[float](), True, ""
    walk = Walk(it.walker, structure, plan_from_stance(it.walker, structure, path, start), stack=it.stack)
    recorder = WalkRecorder(walk)
    planned, longest = 0, 4.0 * path.duration + 20.0
    while not walk.done and arrived:
        planned += not walk.plan.complete
        begin = time.perf_counter()
        try:
            recorder.tick(walk.tick())
        except NoPlanError as error:
            arrived, reason = False, str(error)
        costs.append(time.perf_counter() - begin)
        if walk.time > longest:
            arrived, reason = False, "late"
    spent = time.process_time() - cpu
    ticks = np.array(costs)
    return {
        "arrived": arrived,
        "reason": reason,
        "regrasps": len(walk.plan.regrasps),
        "kept": path.duration / max(walk.time - RAMPS, 1e-9),
        "planned_s": planned * walk.dt,
        "longest_ms": 1e3 * float(ticks.max()),
        "stalls": int((ticks > STALL).sum()),
        "planning_p99_ms": 1e3 * float(np.percentile(ticks[: max(planned, 1)], 99)),
        "tick_p99_ms": 1e3 * float(np.percentile(ticks[planned:], 99)),
        "real_time": walk.time / spent,
    }
