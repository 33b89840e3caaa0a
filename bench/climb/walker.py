"""``python -m bench.climb.walker``: the published walker on its cylinder, trenches, layouts and random structures.

    python -m bench.climb.walker                                    # what docs/climbing_bench.md shows
    python -m bench.climb.walker --parts courses --only=+A,-A
    python -m bench.climb.walker --parts rows columns layouts structures families --count 35 --arms 6

Writes walker.md and walker.json in ``--output``; Ctrl-C ends the measuring, and what was measured is written.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from math import pi
from pathlib import Path

import numpy as np
import pinocchio as pin

from bench.climb.structures import OBSTRUCTED, SCARCE, structure
from bench.figures.store import stamp
from bench.harness import machine as host
from bench.pool import ROOT
from bench.program import Record, bars, measure, publish
from bench.sheet import Sheet
from tests.climb.walkers import walker_with
from wbc.climb import (
    BodyPlace,
    ClimbLoop,
    ClimbOptions,
    ClimbScene,
    ContactPlan,
    MotionOptions,
    first_stance,
    plan_climb,
)
from wbc.climb.along import BodyTrack, plan_along
from wbc.climb.checker import check
from wbc.climb.climber import Climber
from wbc.climb.drive import ClimbDrive, standing_plan
from wbc.climb.grids import INCH, cylinder_grid, grid_pose, remove_columns, remove_fraction, remove_rows
from wbc.climb.places import body_over
from wbc.climb.time_law import MotionSpeeds
from wbc.errors import WbcError
from wbc.interrupts import obey_interrupts
from wbc.log import Log

#: The body over the cylinder's axis [m]
RADIUS = 152 * INCH
#: Courses of the source with their reverses, and the other diagonal: from and to in (T, A)
COURSES = {
    "+A": ((13, 6), (13, 18)), "-A": ((13, 18), (13, 6)), "+T": ((6, 12), (19, 12)), "-T": ((19, 12), (6, 12)),
    "+T +A": ((6, 6), (14.37, 18)), "-T -A": ((14.37, 18), (6, 6)), "+T -A": ((6, 18), (14.37, 6)),
    "-T +A": ((14.37, 6), (6, 18)),
}  # fmt: skip
#: Speed of the courses [m/s]
SPEED = 6 * INCH
#: Turn rate of the body where it goes its own way [rad/s]
TURNING = 0.2
#: Without the ramps at both ends [s]
RAMP = 0.5
#: A walk keeps its speed if its mean is this part of what was asked [1]
KEPT = 0.98
#: Speeds between which the highest one is sought [m/s], and how closely
HIGHEST = (SPEED, 12 * INCH, 0.1 * INCH)
#: Twists of the body about the cylinder's axis that it is told one after the other [m/s, rad/s], and how long each [s]
TWISTS = ((0.1, 0.0), (-0.1, 0.0), (0.0, 0.025), (0.0, -0.025), (0.07, 0.018), (-0.07, -0.018))
EACH = 4.0
#: Arms of the walkers on random structures, seed by seed in turn
ARMS = (3, 3, 3, 4, 3, 3, 6, 3, 5, 3)
#: Speed of the body there [m/s]
AMONG = 0.1
#: Columns of the table of walks
COLUMNS = ("", "of the speed", "re-grasps", "plan, s", "real time with planning", "tick, us", "99 %",
           "hands, mm", "checker")  # fmt: skip


@dataclass(frozen=True, eq=False)
class Case:
    """A walk: its name, scene, poses of the body, largest speed [m/s] and turn rate [rad/s], and what walks."""

    name: str
    scene: ClimbScene
    poses: Sequence[pin.SE3]
    speed: float
    turn_rate: float = 0.1
    arms: int = 3


def cases(part: str, count: int, arms: int | None, first: int = 0) -> Iterator[Case]:
    """Those of a part; of one that is drawn from seeds ``count`` from the ``first`` one on."""
    whole = cylinder_grid()
    if part == "demo":
        yield Case("demo", whole, _over((13, 6), (13, 18)), 4 * INCH)
    elif part == "courses":
        yield from (Case(name, whole, _over(*ends), SPEED) for name, ends in COURSES.items())
    elif part == "spins":
        turns = [grid_pose(13, 12, RADIUS, k * pi / 2) for k in range(13)]
        yield Case("3 turns at 0.15 rad/s", whole, turns, 1.0, 0.15)
    elif part == "rows":
        for many in range(1, 8):
            less = remove_rows(whole, f"12-{11 + many}")
            yield Case(f"{many} rows", less, _over((13, 7), (13, min(17 + many, 23))), 2 * INCH)
    elif part == "columns":
        for many in range(1, 7):
            less = remove_columns(whole, f"12-{11 + many}")
            yield Case(f"{many} columns", less, _over((7, 12), (min(17 + many, 22), 12)), 2 * INCH)
    elif part == "layouts":
        for seed in range(first, first + count):
            less = remove_fraction(whole, 0.1 + 0.5 * (seed % 10) / 10, seed)
            yield Case(f"layout {seed}", less, _over((13, 6), (13, 18)), 3 * INCH)
    else:
        families = list(OBSTRUCTED if part == "structures" else SCARCE)
        for k in range(first, first + count):
            family, seed = families[k % len(families)], k // len(families)
            many = arms or (ARMS[seed % len(ARMS)] if part == "structures" else 3)
            course = structure(family, seed)
            poses = [body_over(walker_with(many), frame) for frame in (course.start, course.goal)]
            yield Case(f"{family} {seed}, {many} arms", course.scene, poses, AMONG, TURNING, many)


def _over(begin: tuple[float, float], end: tuple[float, float]) -> list[pin.SE3]:
    middle = 0.5 * (begin[0] + end[0]), 0.5 * (begin[1] + end[1])
    return [grid_pose(*place, RADIUS) for place in (begin, middle, end)]


def planned(climber: Climber, case: Case) -> ContactPlan:
    """Along the way at the speed, or else as stances lead to its end, at most as fast."""
    track = BodyTrack(case.poses, case.speed, case.turn_rate)
    try:
        return plan_along(climber, case.scene, track)
    except WbcError:
        speeds, goal = MotionSpeeds(case.speed, max(case.turn_rate, TURNING)), case.poses[-1]
        start = first_stance(climber, case.scene, climber.with_body(climber.rest, case.poses[0]))
        place = BodyPlace(goal.translation, goal.rotation)
        return plan_climb(climber, case.scene, start, place, ClimbOptions(motion=MotionOptions(speeds=speeds)))


def walked(case: Case) -> Record:
    """Planned, carried out and checked; why not, if it is not. Times are of the processor."""
    climber, begun = walker_with(case.arms), time.process_time()
    record: Record = {"course": case.name, "asked": case.speed, "planned": False}
    try:
        plan = planned(climber, case)
    except WbcError as error:
        return record | {"reason": str(error), "plan_s": time.process_time() - begun}
    spent, loop, costs = time.process_time() - begun, ClimbLoop(plan), list[float]()
    most = 2.0 * float(plan.times[-1]) + 10.0
    while not loop.ended and loop.time < most:
        begun = time.process_time()
        loop.tick()
        costs.append(time.process_time() - begun)
    run = loop.result()
    report, t = check(run.log, climber, run.scene), run.log["t"]
    slip = max((finding.worst for finding in report.findings if finding.rule.endswith("slips")), default=0.0)
    return record | {
        "planned": True, "reason": run.reason, "plan_s": spent, "regrasps": len(plan.moves), "walk_s": float(t[-1]),
        "arrived": str(run.outcome) == "arrived", "kept": kept(run.log, case), "slip_mm": 1e3 * slip,
        "tick_us": 1e6 * float(np.median(costs)), "tick_p99_us": 1e6 * float(np.percentile(costs, 99)),
        "real_time_planned": float(t[-1]) / (spent + sum(costs)), "violations": list(map(str, report.violations)),
    }  # fmt: skip


def kept(log: Log, case: Case) -> float:
    """Mean of the body's speed or turn rate, whichever is the larger part of what was asked, between the ramps."""
    t, poses = log["t"], [pin.XYZQUATToSE3(q) for q in log.array("q")[:, :7]]
    steps = np.array([pin.log6(a.actInv(b)).vector for a, b in pairwise(poses)]) / np.diff(t)[:, None]
    parts = np.linalg.norm(steps[:, :3], axis=1) / case.speed, np.linalg.norm(steps[:, 3:], axis=1) / case.turn_rate
    full = (t[1:] > RAMP) & (t[1:] < t[-1] - RAMP)
    return float(np.maximum(*parts)[full].mean()) if full.any() else 0.0


def keeps(record: Record) -> bool:
    """It arrived as fast as it was asked to, and the checker finds nothing."""
    return bool(record["planned"] and record["arrived"] and record["kept"] >= KEPT and not record["violations"])


def highest(case: Case, walk: Callable[[Case], Record] = walked) -> Record:
    """By bisection the highest speed [m/s] that is kept, and what a faster walk lacks."""
    low, high, close = HIGHEST
    low, why = (low, "") if keeps(walk(replace(case, speed=low))) else (0.0, "its usual speed is not kept")
    while low and high - low > close:
        middle = 0.5 * (low + high)
        record = walk(replace(case, speed=middle))
        if keeps(record):
            low = middle
        else:
            high, why = middle, ended(record)
    return {"course": case.name, "highest": low, "above": high, "limit": why}


def ended(record: Record) -> str:
    """How a walk ended, in words: clean where nothing is to be said."""
    if not record["planned"]:
        return f"refused: {record['reason'][:100]}"
    return "; ".join(record["violations"]) or ("clean" if record["arrived"] else record["reason"])


def driven() -> Record:
    """A body that is told other rates: until it goes so [s of the walk], and the longest ticks, which plan [ms]."""
    climber, scene = walker_with(3), cylinder_grid()
    start = first_stance(climber, scene, climber.with_body(climber.rest, grid_pose(13, 12, RADIUS)))
    drive = ClimbDrive(climber)
    loop = ClimbLoop(standing_plan(climber, scene, start), replan=drive.following, onward=drive.onward)
    answers, costs = list[float](), list[float]()
    for along, round_ in TWISTS:
        twist = np.array([0.0, 0.0, along, 0.0, 0.0, round_])
        drive.steer(climber.body_pose(loop.stance.q).toActionMatrixInverse() @ twist, loop)
        begun, answer = loop.time, None
        while loop.time < begun + EACH and not loop.ended:
            cpu, before = time.process_time(), loop.stance.q[:3]
            loop.tick()
            costs.append(1e3 * (time.process_time() - cpu))
            wanted = twist[:3] + np.cross(twist[3:], before)
            if answer is None and (loop.stance.q[:3] - before) @ wanted > 0.5 * loop.dt * (wanted @ wanted):
                answer = loop.time - begun
        answers += [] if answer is None else [answer]
    while not loop.ended:
        drive.finish(loop)
        loop.tick()
    run = loop.result()
    report = check(run.log, climber, scene)
    return {
        "asked": len(TWISTS), "answers": answers, "costs": costs, "planned": True,
        "arrived": str(run.outcome) == "arrived", "reason": f"{run.outcome}: {run.reason}",
        "violations": list(map(str, report.violations)),
    }  # fmt: skip


def walk_sheet(name: str, records: list[Record]) -> Sheet:
    """Walks, a row each."""
    rows = []
    for r in records:
        cells = ["-"] * 7
        if r["planned"]:
            cells = [f"{r['kept']:.3f}", str(r["regrasps"]), f"{r['plan_s']:.2f}", f"{r['real_time_planned']:.1f}",
                     f"{r['tick_us']:.0f}", f"{r['tick_p99_us']:.0f}", f"{r['slip_mm']:.3f}"]  # fmt: skip
        rows.append((r["course"], *cells, ended(r)))
    title = f"Courses at {SPEED / INCH:g} in/s" if name == "courses" else name.capitalize()
    return Sheet(title, COLUMNS, rows)


def highest_sheet(_: str, records: list[Record]) -> Sheet:
    """Bisected speeds."""
    rows = [(r["course"], *(f"{r[key] / INCH:.2f}" for key in ("highest", "above")), r["limit"]) for r in records]
    return Sheet("Highest speeds that are kept", ("", "in/s", "not kept", "what limits it there"), rows)


def drive_sheet(_: str, records: list[Record]) -> Sheet:
    """Answers to commands, and ticks."""
    rows = []
    for r in records:
        some = np.array(r["answers"])
        rows.append((f"{len(some)} of {r['asked']} other rates", f"{np.median(some):.2f}", f"{some.max():.2f}",
                     f"{max(r['costs']):.0f}", f"{np.percentile(r['costs'], 99):.2f}",
                     ended(r)))  # fmt: skip
    columns = ("", "until it goes so, s", "longest", "longest tick, ms", "99 %, ms", "checker")
    return Sheet("A body under way that is told other rates", columns, rows)


#: Parts -> how their records are shown; those of walks by default
SHEETS = {"highest": highest_sheet, "driven": drive_sheet}
#: Parts that docs/climbing_bench.md shows
SHOWN = ("courses", "spins", "driven", "highest")
PARTS = (*SHOWN, "demo", "rows", "columns", "layouts", "structures", "families")


def page(data: Record) -> str:
    """The tables of docs/climbing_bench.md."""
    return "\n\n".join(SHEETS.get(k, walk_sheet)(k, data["parts"][k]).markdown() for k in SHOWN if k in data["parts"])


def jobs(part: str, given: argparse.Namespace) -> list[Callable[[], Record]]:
    """What is measured for a part."""
    if part == "driven":
        return [driven]
    only = given.only.split(",") if given.only else []
    some = cases("courses" if part == "highest" else part, given.count, given.arms)
    of = highest if part == "highest" else walked
    return [partial(of, case) for case in some if not only or case.name in only]


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(prog="python -m bench.climb.walker", description=__doc__.splitlines()[0])
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=list(SHOWN))
    parser.add_argument("--only", default="", help="names of cases, with commas")
    parser.add_argument("--count", type=int, default=20, help="layouts or structures")
    parser.add_argument("--arms", type=int, help="of walkers on structures; as drawn")
    parser.add_argument("--output", type=Path, default=ROOT / "build" / "bench", help="folder; default: build/bench")
    given = parser.parse_args(arguments)
    about, begun = host(), stamp()
    work = {part: jobs(part, given) for part in given.parts}
    with bars() as progress:
        parts, interrupted = measure({k: (len(v), (job() for job in v)) for k, v in work.items()}, progress)
    notes = [f"{about['processor']}, Python {about['python']}; load {about['load']}."]
    if interrupted:
        notes.insert(0, f"Ended by Ctrl-C in: {interrupted}.")
    parts = {name: some for name, some in parts.items() if some}
    sheets = [SHEETS.get(name, walk_sheet)(name, some) for name, some in parts.items()]
    publish(given.output / "walker", sheets, notes, {"stamp": begun, "about": notes, "parts": parts}, width=200)


if __name__ == "__main__":
    obey_interrupts()
    main()
