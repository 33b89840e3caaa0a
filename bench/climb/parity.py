"""``python -m bench.climb.parity``: the published walker by ``wbc.walking`` and by ``wbc.climb``, side by side.

    python -m bench.climb.parity                          # the demo, courses, rows and columns
    python -m bench.climb.parity --parts courses --only=+A,-A
    python -m bench.climb.parity --parts layouts --count 20
    python -m bench.climb.parity --parts structures families --count 35 --arms 6

Of each: re-grasps, mean speed of the body between the ramps as a part of what was asked, processor time of the plan [s]
and of a tick [us], times real time with planning, and what both checkers find. A way that has no footholds along it
goes as the planner of stances finds one, at most as fast; its speed is that from start to goal. Random structures
(``structures`` of the walker's trials, ``families`` of ``tests.climb.structures``) are planned over stances.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

import wbc.robots
from bench.climb.structures import structure_rows
from bench.walk.courses import COURSES
from bench.walk.machine import Machine
from wbc.climb import BodyPlace, ClimbLoop, ClimbOptions, ContactPlan, MotionOptions, first_stance, machines, plan_climb
from wbc.climb.along import BodyTrack, plan_along
from wbc.climb.checker import check
from wbc.climb.scene import of_structure
from wbc.climb.time_law import MotionSpeeds
from wbc.errors import WbcError
from wbc.multibody import pin
from wbc.walking import Structure, remove_columns, remove_fraction, remove_rows
from wbc.walking.body_path import grid_path
from wbc.walking.holds.built_in import grid_pose

#: An inch [m]
INCH = 0.0254
#: The body over the cylinder's axis [m]
RADIUS = 152 * INCH
#: Time without the ramps at both ends [s]
RAMP = 0.5
#: Largest turn rate of the body where it goes its own way [rad/s]
TURNING = 0.2
#: Heads of the table
HEADS = ("case", "by", "moves", "of the speed", "plan s", "tick us", "real time", "checkers")


@dataclass(frozen=True, eq=False)
class Case:
    """A walk.

    Attributes:
        name: short. structure: what is walked on. begin, end: (T, A). speed: [in/s].
    """

    name: str
    structure: Structure
    begin: tuple[float, float]
    end: tuple[float, float]
    speed: float


def cases(part: str, structure: Structure, count: int) -> Iterator[Case]:
    """Those of a part."""
    if part == "demo":
        yield Case("demo", structure, (13, 6), (13, 18), 4.0)
    elif part == "courses":
        yield from (Case(name, structure, begin, end, 6.0) for name, (begin, end) in COURSES.items())
    elif part == "rows":
        for many in range(1, 8):
            less = remove_rows(structure, f"12-{11 + many}")
            yield Case(f"{many} rows", less, (13, 7), (13, min(17 + many, 23)), 2.0)
    elif part == "columns":
        for many in range(1, 7):
            less = remove_columns(structure, f"12-{11 + many}")
            yield Case(f"{many} columns", less, (7, 12), (min(17 + many, 22), 12), 2.0)
    else:
        for seed in range(count):
            share = 0.1 + 0.5 * (seed % 10) / 10
            yield Case(f"layout {seed}", remove_fraction(structure, share, seed), (13, 6), (13, 18), 3.0)


def old(it: Machine, case: Case) -> tuple[Any, ...]:
    """By the old room."""
    record = it.walk(case.structure, grid_path([case.begin, case.end], case.speed * INCH), detour=True)
    if not record["planned"]:
        return "-", "-", f"{record['plan_s']:.2f}", "-", "-", f"refused: {record['reason'][:60]}"
    found = "; ".join(record["violations"]) or "clean"
    kept = record["speed"] / (case.speed * INCH)
    times = f"{1e6 * record['walk_s'] / record['real_time'] / (100 * record['walk_s']):.0f}"
    return (record["regrasps"], f"{kept:.3f}", f"{record['plan_s']:.2f}", times, f"{record['real_time_planned']:.1f}",
            found if record["arrived"] else f"{record['end']}: {record['reason'][:60]}")  # fmt: skip


def new(climber: Any, case: Case) -> tuple[Any, ...]:
    """By ``wbc.climb``."""
    scene, begun = of_structure(case.structure), time.process_time()
    try:
        plan = planned(climber, scene, case)
    except WbcError as error:
        return "-", "-", f"{time.process_time() - begun:.2f}", "-", "-", f"refused: {str(error)[:60]}"
    spent = time.process_time() - begun
    loop = ClimbLoop(plan)
    begun = time.process_time()
    run = loop.run(most=2.0 * float(plan.times[-1]) + 10.0)
    ticking = time.process_time() - begun
    t, q = run.log["t"], run.log.array("q")
    speed = np.linalg.norm(np.diff(q[:, :3], axis=0), axis=1) / np.diff(t)
    kept = float(speed[(t[1:] > RAMP) & (t[1:] < t[-1] - RAMP)].mean()) / (case.speed * INCH)
    report = check(run.log, climber, scene)
    found = "clean" if report.clean else "; ".join(map(str, report.violations))
    return (len(plan.moves), f"{kept:.3f}", f"{spent:.2f}", f"{1e6 * ticking / len(t):.0f}",
            f"{t[-1] / (spent + ticking):.1f}",
            found if run.outcome == "arrived" else f"{run.outcome}: {run.reason}")  # fmt: skip


def planned(climber: Any, scene: Any, case: Case) -> ContactPlan:
    """Along the way, or else as stances lead to its end."""
    begin, middle, end = (
        grid_pose(t, a, RADIUS) for t, a in (case.begin, tuple(0.5 * (np.array(case.begin) + case.end)), case.end)
    )
    try:
        return plan_along(climber, scene, BodyTrack((begin, middle, end), case.speed * INCH))
    except WbcError:
        speeds = MotionSpeeds(speed=case.speed * INCH, turn_rate=TURNING)
        pose = begin * pin.SE3.Identity()
        start = first_stance(climber, scene, climber.with_body(climber.rest, pose))
        options = ClimbOptions(motion=MotionOptions(speeds=speeds))
        return plan_climb(climber, scene, start, BodyPlace(end.translation), options)


def main() -> None:
    """Print the table, case by case."""
    parser = argparse.ArgumentParser(prog="python -m bench.climb.parity", description=__doc__)
    parts = ("demo", "courses", "rows", "columns", "layouts", "structures", "families")
    parser.add_argument("--parts", nargs="+", choices=parts, default=list(parts[:4]))
    parser.add_argument("--only", default="", help="names of cases, with commas")
    parser.add_argument("--count", type=int, default=20, help="layouts or structures")
    parser.add_argument("--arms", type=int, help="of walkers on structures; as drawn")
    parser.add_argument("--by", nargs="+", choices=("old", "new"), default=["old", "new"])
    given = parser.parse_args()
    it, climber = Machine(wbc.robots.walker()), machines.climber("walker")
    print(f"| {' | '.join(HEADS)} |\n|{' --- |' * len(HEADS)}")
    only = given.only.split(",") if given.only else []
    for part in given.parts:
        if part in ("structures", "families"):
            for row in structure_rows(part, given.count, given.arms, only, given.by):
                print(f"| {' | '.join(map(str, row))} |", flush=True)
            continue
        for case in cases(part, it.structure, given.count):
            if only and case.name not in only:
                continue
            for by in given.by:
                row = (case.name, by, *(old(it, case) if by == "old" else new(climber, case)))
                print(f"| {' | '.join(map(str, row))} |", flush=True)


if __name__ == "__main__":
    main()
