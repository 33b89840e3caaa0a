"""Runs the courses with and without caps, in turns, and shows what came of it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from pathlib import Path
from time import perf_counter_ns
from typing import Any

import numpy as np
import pinocchio as pin

from bench.deadlines.course import DT, HOLD, TICKS, Course
from bench.harness import statistics
from bench.problems import load
from bench.sheet import Sheet, us
from wbc.controller import core_of

TURNS = 10

#: As the note tells them: a tick [ms], between jumps [s]
TICK, JUMP = 1e3 * DT, HOLD * DT

NOTE = f"""\
Deadlines: {TICKS} ticks of {TICK:g} ms in closed loop. The target of the hand (of both hands of Talos, whose feet \
and centre of mass have targets, too) jumps every {JUMP:g} s, spheres swing through the workspace with their \
velocities given, joint accelerations are limited, and the solver starts from the active set of the last tick. \
Durations are of the native call, all turns together; the loop is the same in every turn, so that the least of the \
turns is a tick's own time, without what the machine did besides. The error is the distance of hands from their \
targets, over all ticks. A cap bounds the time of a tick; a capped tick misses rows by no more than braking would."""


def measure(problem: Path, rounds: int | None, say: Callable[[str], None]) -> dict[str, Any]:
    """All caps on the course of the problem in a folder."""
    name, turns = problem.name, rounds or TURNS
    say(f"{name}: deadlines, compiling")
    course = Course(load(problem))
    caps = course.kind.caps
    walks, spent = [walk(course, cap) for cap in caps], dict[int | None, list[list[int]]]()
    for turn in range(turns):
        say(f"{name}: deadlines, turn {turn + 1} of {turns}")
        for cap in caps:
            spent.setdefault(cap, []).append(durations(course, cap))
    rows = []
    for cap, walked in zip(caps, walks, strict=True):
        times = np.array(spent[cap])
        shares = {status: count / TICKS for status, count in walked["statuses"].items()}
        rows.append({
            "cap": cap, "times": statistics(times.ravel()), "least": statistics(times.min(axis=0)), "shares": shares,
            "error": walked["error"], "margin": walked["margin"],
        })  # fmt: skip
    return {"rows": rows, "ticks": TICKS * turns}


def walk(course: Course, cap: int | None) -> dict[str, Any]:
    """One closed loop: statuses, iterations, distances of the hands from their targets, least margin [m]."""
    c, q = begin(course, cap)
    statuses: Counter[str] = Counter()
    iterations, errors, least = [], np.zeros(TICKS), np.inf
    for k in range(TICKS):
        core_of(c).tick.p[:] = course.inputs[k]
        step = c.step(q)
        statuses[str(step.status)] += 1
        iterations.append(int(step.iterations))
        least = min(least, *(min(step.margins[name]) for name in course.balls))
        q = pin.integrate(course.model, q, step.v * DT)
        places = [course.place(q, hand).translation for hand in course.kind.hands]
        errors[k] = np.linalg.norm(np.array(places) - course.wanted[k], axis=1).mean()
    return {"statuses": statuses, "iterations": iterations, "error": float(errors.mean()), "margin": float(least)}


def durations(course: Course, cap: int | None) -> list[int]:
    """Durations of the native call in the same closed loop [ns]."""
    c, q = begin(course, cap)
    tick, out = core_of(c).tick, []
    for k in range(TICKS):
        tick.p[:] = course.inputs[k]
        tick.q[:] = q
        start = perf_counter_ns()
        tick.step_function(tick.pointer)
        out.append(perf_counter_ns() - start)
        q = pin.integrate(course.model, q, c.last_command * DT)
    return out


def begin(course: Course, cap: int | None) -> tuple[Any, np.ndarray]:
    """The controller at the start."""
    c = course.controller
    c.iteration_cap = cap
    c.reset(course.q0)
    return c, np.array(course.q0)


def sheet(courses: dict[str, Any]) -> Sheet:
    """Tails of the tick with each cap, and what it costs."""
    columns = ("robot", "cap", "us, p99", "p99.9", "longest, least of turns", "capped, %", "error, mm")
    rows = [
        (name, "none" if row["cap"] is None else str(row["cap"]),
         *(us(row["times"][tail]) for tail in ("p99", "p99.9")), us(row["least"]["max"]),
         f"{100.0 * row['shares'].get('capped', 0.0):.2f}", f"{1e3 * row['error']:.1f}")
        for name, course in courses.items() for row in course["rows"]
    ]  # fmt: skip
    return Sheet("A cap on iterations", columns, rows)
