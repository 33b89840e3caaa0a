"""Plans in slices: when the first command is there, how long ticks take while the rest is planned, and real time."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial

import numpy as np

from bench.walk.courses import COURSES, SPEED
from bench.walk.machine import INCH, Job, Machine, Record, speeds
from wbc.walking import Structure
from wbc.walking.body_path import BodyPath, grid_path
from wbc.walking.drive import Drive, standing_plan
from wbc.walking.plan import NoPlanError
from wbc.walking.planner import plan_walk
from wbc.walking.replanning import plan_from_stance
from wbc.walking.run.recording import WalkRecorder
from wbc.walking.structures import grid_pose
from wbc.walking.walk import Walk

#: For the whole plan, from which the first holds are taken and to which the re-grasps are compared [s]
BUDGET = 10.0
#: First commands that are timed on each course, and the longest time from command to command [s]
REPEATS, STALL = 10, 0.05
#: Rates that a driven body is told one after the other (T, A [m/s], spin [rad/s]), and how long each [s]
COMMANDS = (
    (0.0, 0.1, 0.0), (0.0, -0.1, 0.0), (0.1, 0.0, 0.0), (-0.1, 0.0, 0.0), (0.07, 0.07, 0.0), (-0.07, -0.07, 0.0),
    (0.0, 0.0, 0.1), (0.0, 0.0, -0.1), (0.05, 0.05, 0.05), (0.0, 0.1, 0.0),
)  # fmt: skip
EACH = 3.0
#: Where it stands: from the axis, 52 in above the surface [m]
RADIUS = 152 * INCH


def planned(it: Machine, name: str, speed: float) -> Record:
    """One course at a speed [in/s], by a body that stands on the first holds of the whole plan."""
    begin, end = COURSES[name]
    structure, path = it.structure, grid_path([begin, end], speed * INCH)
    whole = plan_walk(it.walker, structure, path, partial=True, time_budget=BUDGET)
    start = dict(zip([arm.name for arm in it.walker.arms], whole.start, strict=True))
    return {
        "course": name,
        "asked": speed,
        "whole": len(whole.regrasps) if whole.complete else None,
        "first_ms": [1e3 * _first(it, structure, path, start) for _ in range(REPEATS)],
        "slices_ms": _slices(it, structure, path, start),
        **_walked(it, structure, path, start),
    }


def driven(it: Machine) -> Record:
    """A body under way that is told other rates: until the first command of the new way, and ticks from then on."""
    walk = Walk(
        it.walker, it.structure, standing_plan(it.walker, it.structure, grid_pose(13, 12, RADIUS)), stack=it.stack
    )
    drive, firsts, spent, costs = Drive(walk), list[float](), list[float](), list[float]()
    for rates in COMMANDS:
        drive.steer(*rates)
        before, waited, cpu, there, begin = walk.plan.path, 0.0, time.process_time(), False, walk.time
        while walk.time < begin + EACH:
            with _timed(costs):
                drive.tick()
            if not there and walk.plan.path is not before:
                firsts.append(1e3 * (waited + costs[-1]))
                spent.append(1e3 * (time.process_time() - cpu))
                there = True
            waited += max(walk.dt, costs[-1])
    ticks = 1e3 * np.array(costs)
    return {
        "course": "driven",
        "asked": len(COMMANDS),
        "arrived": len(firsts) == len(COMMANDS),
        "reason": "" if len(firsts) == len(COMMANDS) else drive.reason,
        "first_ms": firsts,
        "first_cpu_ms": spent,
        "longest_ms": float(ticks.max()),
        "stalls": int((ticks > 1e3 * STALL).sum()),
        "planning_p99_ms": float(np.percentile(ticks, 99)),
    }


def planning_jobs(it: Machine) -> list[Job]:
    """The eight courses at 6 in/s, and a body that is driven."""
    return [*(Job(name, partial(planned, it, name, SPEED)) for name in COURSES), Job("driven", partial(driven, it))]


@contextmanager
def _timed(costs: list[float]) -> Iterator[None]:
    begin = time.perf_counter()
    try:
        yield
    finally:
        costs.append(time.perf_counter() - begin)


def _first(it: Machine, structure: Structure, path: BodyPath, start: dict[str, str]) -> float:
    """From being told to the first command of the controller [s]."""
    begin = time.perf_counter()
    walk = Walk(it.walker, structure, plan_from_stance(it.walker, structure, path, start), stack=it.stack)
    walk.tick()
    return time.perf_counter() - begin


def _slices(it: Machine, structure: Structure, path: BodyPath, start: dict[str, str]) -> list[float]:
    """Processor time of each slice of a plan [ms], also of one that leads nowhere."""
    slices, out = plan_from_stance(it.walker, structure, path, start), list[float]()
    while True:
        cpu = time.process_time()
        try:
            next(slices)
        except (StopIteration, NoPlanError):
            return out
        finally:
            out.append(round(1e3 * (time.process_time() - cpu), 3))


def _walked(it: Machine, structure: Structure, path: BodyPath, start: dict[str, str]) -> Record:
    """A walk with planner, controller, simulation and log; times of whole ticks, planning included."""
    cpu, costs, reason = time.process_time(), list[float](), ""
    walk = Walk(it.walker, structure, plan_from_stance(it.walker, structure, path, start), stack=it.stack)
    recorder = WalkRecorder(walk)
    planning, longest = 0, 4.0 * path.duration + 20.0
    while not walk.done and not reason:
        planning += not walk.plan.complete
        try:
            with _timed(costs):
                recorder.tick(walk.tick())
        except NoPlanError as error:
            reason = str(error)
        if walk.time > longest:
            reason = "late"
    spent = time.process_time() - cpu
    ticks = 1e3 * np.array(costs)
    found = speeds(recorder.log()[0], walk.plan)
    return {
        "arrived": not reason,
        "reason": reason,
        "regrasps": len(walk.plan.regrasps),
        "kept": found["speed"] / found["asked_speed"],
        "planned_s": planning * walk.dt,
        "longest_ms": float(ticks.max()),
        "stalls": int((ticks > 1e3 * STALL).sum()),
        "planning_p99_ms": float(np.percentile(ticks[: max(planning, 1)], 99)),
        "tick_p99_ms": float(np.percentile(ticks[planning:], 99)) if len(ticks) > planning else None,
        "real_time": walk.time / spent,
    }
