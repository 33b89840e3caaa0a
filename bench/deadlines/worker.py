"""A process that runs a course: reads one JSON command a line, writes one JSON answer a line.

    {"do": "walk", "cap": 10}  ->  {"statuses": {...}, "iterations": [...], ...}    one closed loop, what came of it
    {"do": "time", "cap": 10}  ->  {"native": [ns, ...]}                            the same one, durations

Run as ``python -m bench.deadlines.worker NAME FOLDER [CORE]``, see :class:`bench.pool.Worker`.
"""

from __future__ import annotations

import gc
import sys
from collections import Counter
from pathlib import Path
from time import perf_counter_ns
from typing import Any

import numpy as np
import pinocchio as pin

from bench.deadlines.course import DT, KINDS, TICKS, Course
from bench.problems import load
from bench.worker_process import begin as pinned, serve
from wbc.controller import core_of


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


def main() -> None:
    """Build, say so, then serve."""
    _name, folder, *core = sys.argv[1:]
    pinned(core)
    course = Course(load(Path(folder)))
    gc.collect()

    def answer(asked: dict[str, Any]) -> dict[str, Any]:
        cap = asked["cap"]
        return walk(course, cap) if asked["do"] == "walk" else {"native": durations(course, cap)}

    serve(answer, {"ready": course.name, "caps": KINDS[course.name].caps})


if __name__ == "__main__":
    main()
