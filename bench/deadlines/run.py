"""Runs the courses with and without caps, in turns, and shows what came of it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from bench.deadlines.course import DT, HOLD, KINDS, MARGIN, TICKS
from bench.harness import OURS, Plan, statistics
from bench.pool import Worker, cores
from bench.sheet import Sheet, us

TURNS = 10

#: As the note tells them: a tick [ms], between jumps [s], what spheres should keep [mm]
TICK, JUMP, KEPT = 1e3 * DT, HOLD * DT, 1e3 * MARGIN

NOTE = f"""\
Deadlines: {TICKS} ticks of {TICK:g} ms in closed loop. The target of the hand (of both hands of Talos, whose feet \
and centre of mass have targets, too) jumps every {JUMP:g} s, spheres swing through the workspace with their \
velocities given, joint accelerations are limited, and the solver starts from the active set of the last tick. \
Durations are of the native call, all turns together; the loop is the same in every turn, so that the least of the \
turns is a tick's own time, without what the machine did besides. The error is the distance of hands from their \
targets, over all ticks and before each jump; the least margin is the least distance to a sphere less the {KEPT:g} mm \
that it should keep. A cap bounds the time of a tick; a capped tick misses rows by no more than braking would."""


def measure(plan: Plan, name: str, say: Callable[[str], None]) -> dict[str, Any]:
    """All caps on one course."""
    core, _ = cores()
    turns, spent = plan.rounds or TURNS, dict[str, list[list[float]]]()
    say(f"{name}: deadlines, compiling")
    with Worker(plan.python, OURS, plan.folder / name, core, module="bench.deadlines.worker") as worker:
        caps = worker.ready["caps"]
        found = []
        for cap in caps:
            say(f"{name}: deadlines, {told(cap)}")
            found.append(worker.ask("walk", cap=cap))
        for turn in range(turns):
            for cap in caps:
                say(f"{name}: deadlines, {told(cap)}, turn {turn + 1} of {turns}")
                spent.setdefault(str(cap), []).append(worker.ask("time", cap=cap)["native"])
    rows = []
    for cap, answer in zip(caps, found, strict=True):
        iterations, times = np.array(answer["iterations"]), np.array(spent[str(cap)])
        shares = {status: count / TICKS for status, count in answer["statuses"].items()}
        rows.append({
            "cap": cap, "times": statistics(times.ravel()), "least": statistics(times.min(axis=0)), "shares": shares,
            "error": answer["error"], "settled": answer["settled"], "margin": answer["margin"],
            "iterations": {"median": float(np.median(iterations)), "p99.9": float(np.percentile(iterations, 99.9)),
                           "max": int(iterations.max())},
        })  # fmt: skip
    return {"rows": rows, "ticks": TICKS * turns, "constraints": found[0]["rows"], "dofs": found[0]["dofs"],
            "balls": KINDS[name].balls}  # fmt: skip


def told(cap: int | None) -> str:
    """A cap in words."""
    return "no cap" if cap is None else f"cap {cap}"


def sheet(name: str, course: dict[str, Any]) -> Sheet:
    """Tails of the tick with each cap, and what it costs."""
    columns = (
        "iterations a tick", "median [us]", "p99 [us]", "p99.9 [us]", "max [us]", "least of turns: p99", "p99.9", "max",
        "iterations p99.9", "max",
        "capped [%]", "relaxed [%]", "error [mm]", "before jumps [mm]", "least margin [mm]",
    )  # fmt: skip
    rows = []
    for row in course["rows"]:
        times = [us(row["times"][part]) for part in ("median", "p99", "p99.9", "max")]
        times += [us(row["least"][part]) for part in ("p99", "p99.9", "max")]
        shares = (f"{100.0 * row['shares'].get(status, 0.0):.2f}" for status in ("capped", "relaxed"))
        counts = (f"{row['iterations']['p99.9']:.0f}", f"{row['iterations']['max']}")
        errors = (f"{1e3 * row[part]:.1f}" for part in ("error", "settled", "margin"))
        rows.append((told(row["cap"]), *times, *counts, *shares, *errors))
    about = f"{course['dofs']} degrees of freedom, {course['constraints']} rows, {course['balls']} moving spheres"
    return Sheet(f"Deadlines: {name}, {about} ({course['ticks']} ticks each)", columns, rows)
