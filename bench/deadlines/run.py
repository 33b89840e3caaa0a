"""Runs the courses with and without caps, in turns, and shows what came of it."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from bench.deadlines.course import DT, HOLD, TICKS
from bench.harness import statistics
from bench.pool import Worker, cores
from bench.sheet import Sheet, us

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
    name, (core, _) = problem.name, cores()
    turns, spent = rounds or TURNS, dict[str, list[list[float]]]()
    say(f"{name}: deadlines, compiling")
    with Worker(sys.executable, name, problem, core, module="bench.deadlines.worker") as worker:
        caps = worker.ready["caps"]
        walks = [worker.ask("walk", cap=cap) for cap in caps]
        for turn in range(turns):
            say(f"{name}: deadlines, turn {turn + 1} of {turns}")
            for cap in caps:
                spent.setdefault(str(cap), []).append(worker.ask("time", cap=cap)["native"])
    rows = []
    for cap, walked in zip(caps, walks, strict=True):
        times = np.array(spent[str(cap)])
        shares = {status: count / TICKS for status, count in walked["statuses"].items()}
        rows.append({
            "cap": cap, "times": statistics(times.ravel()), "least": statistics(times.min(axis=0)), "shares": shares,
            "error": walked["error"], "margin": walked["margin"],
        })  # fmt: skip
    return {"rows": rows, "ticks": TICKS * turns}


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
