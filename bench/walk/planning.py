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
from wbc.walking.holds.built_in import grid_pose
from wbc.walking.loop.walk import Walk
from wbc.walking.modes.drive import Drive, standing_plan
from wbc.walking.planner.plan import NoPlanError
from wbc.walking.planner.planner import plan_walk
from wbc.walking.planner.replanning import plan_from_stance
from wbc.walking.run.recording import WalkRecorder

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
    """One course at a speed [in/s], by a body that stands on the first holds of the whole plan, to whose re-grasps
    those of the plan in slices are compared.
    """
    it.load()
    begin, end = COURSES[name]
    structure, path = it.structure, grid_path([begin, end], speed * INCH)
    whole = plan_walk(it.walker, structure, path, partial=True)
    start = dict(zip([arm.name for arm in it.walker.arms], whole.start, strict=True))
    firsts = [_first(it, structure, path, start) for _ in range(REPEATS)]
    return {
        "course": name,
        "asked": speed,
        "whole": len(whole.regrasps) if whole.complete else None,
        "first_ms": [1e3 * clock for clock, _ in firsts],
        "first_cpu_ms": [1e3 * spent for _, spent in firsts],
        "slices_ms": _slices(it, structure, path, start),
        **_walked(it, structure, path, start),
    }


def driven(it: Machine) -> Record:
    """A body under way that is told other rates: until the first command of the new way, and ticks from then on."""
    it.load()
    walk = Walk(
        it.walker, it.structure, standing_plan(it.walker, it.structure, grid_pose(13, 12, RADIUS)), stack=it.stack
    )
    drive, firsts, firsts_cpu = Drive(walk), list[float](), list[float]()
    costs, spends = list[float](), list[float]()
    for rates in COMMANDS:
        drive.steer(*rates)
        before, waited, cpu, there, begin = walk.plan.path, 0.0, time.process_time(), False, walk.time
        while walk.time < begin + EACH:
            with _timed(costs, spends):
                drive.tick()
            if not there and walk.plan.path is not before:
                firsts.append(1e3 * (waited + costs[-1]))
                firsts_cpu.append(1e3 * (time.process_time() - cpu))
                there = True
            waited += max(walk.dt, costs[-1])
    return {
        "course": "driven",
        "asked": len(COMMANDS),
        "arrived": len(firsts) == len(COMMANDS),
        "reason": "" if len(firsts) == len(COMMANDS) else drive.reason,
        "first_ms": firsts,
        "first_cpu_ms": firsts_cpu,
        **_ticks(costs, spends),
        "planning_p99_ms": 1e3 * float(np.percentile(spends, 99)),
    }


def planning_jobs(it: Machine) -> list[Job]:
    """The eight courses at 6 in/s, and a body that is driven."""
    return [*(Job(name, partial(planned, it, name, SPEED)) for name in COURSES), Job("driven", partial(driven, it))]


@contextmanager
def _timed(costs: list[float], spends: list[float]) -> Iterator[None]:
    begin, cpu = time.perf_counter(), time.process_time()
    try:
        yield
    finally:
        costs.append(time.perf_counter() - begin)
        spends.append(time.process_time() - cpu)


def _ticks(costs: list[float], spends: list[float]) -> Record:
    """The longest ticks by the clock and of processor time, and how many stall."""
    return {
        "longest_ms": 1e3 * max(costs),
        "longest_cpu_ms": 1e3 * max(spends),
        "stalls": sum(cost > STALL for cost in costs),
        "stalls_cpu": sum(spent > STALL for spent in spends),
    }


def _first(it: Machine, structure: Structure, path: BodyPath, start: dict[str, str]) -> tuple[float, float]:
    """From being told to the first command of the controller, by the clock and of processor time [s]."""
    begin, cpu = time.perf_counter(), time.process_time()
    walk = Walk(it.walker, structure, plan_from_stance(it.walker, structure, path, start), stack=it.stack)
    walk.tick()
    return time.perf_counter() - begin, time.process_time() - cpu


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
    cpu, costs, spends, reason = time.process_time(), list[float](), list[float](), ""
    walk = Walk(it.walker, structure, plan_from_stance(it.walker, structure, path, start), stack=it.stack)
    recorder = WalkRecorder(walk)
    planning, longest = 0, 4.0 * path.duration + 20.0
    while not walk.done and not reason:
        planning += not walk.plan.complete
        try:
            with _timed(costs, spends):
                recorder.tick(walk.tick())
        except NoPlanError as error:
            reason = str(error)
        if walk.time > longest:
            reason = "late"
    spent = time.process_time() - cpu
    found = speeds(recorder.log()[0], walk.plan)
    return {
        "arrived": not reason,
        "reason": reason,
        "regrasps": len(walk.plan.regrasps),
        "kept": found["speed"] / found["asked_speed"],
        "planned_s": planning * walk.dt,
        **_ticks(costs, spends),
        "planning_p99_ms": 1e3 * float(np.percentile(spends[: max(planning, 1)], 99)),
        "tick_p99_ms": 1e3 * float(np.percentile(spends[planning:], 99)) if len(spends) > planning else None,
        "real_time": walk.time / spent,
    }
