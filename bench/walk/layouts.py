"""Layouts of the published cylinder, holds removed at random: what the reference says, and what our planner does."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from bench.walk.courses import INCH, Machine
from wbc.walking import Structure, cylinder, remove_fraction
from wbc.walking.body_path import grid_path
from wbc.walking.checker import check_walk
from wbc.walking.plan import NoPlanError, Plan
from wbc.walking.planner import plan_walk
from wbc.walking.reference import GridPose, Reference
from wbc.walking.run.recording import WalkRecorder
from wbc.walking.walk import Walk

Record = dict[str, Any]

#: Speed of the body [in/s], and its height at both ends [m]
SPEED, HEIGHT = 2.0, 52 * INCH
#: Part of the holds that is removed; T and A of starts and goals; how far these are apart at least [grid units]
FRACTIONS, PLACES_T, PLACES_A, APART = (0.1, 0.6), (3, 23), (3, 22), 6.0


@dataclass(frozen=True)
class Layout:
    """What is left of the cylinder, and from where to where a body goes over it, (T, A) each, with heading 0."""

    seed: int
    fraction: float
    structure: Structure
    start: tuple[int, int]
    goal: tuple[int, int]


def layout(seed: int, whole: Structure) -> Layout:
    """The layout of a seed."""
    rng = np.random.default_rng(seed)
    low, high = FRACTIONS
    fraction = low + (high - low) * float(rng.random())
    while True:
        t = rng.integers(PLACES_T[0], PLACES_T[1], 2, endpoint=True)
        a = rng.integers(PLACES_A[0], PLACES_A[1], 2, endpoint=True)
        if np.hypot(t[0] - t[1], a[0] - a[1]) >= APART:
            start, goal = (int(t[0]), int(a[0])), (int(t[1]), int(a[1]))
            return Layout(seed, fraction, remove_fraction(whole, fraction, seed), start, goal)


def layouts(it: Machine, count: int, walked: int, kept: Path | None = None) -> Iterator[Record]:
    """Layouts of the seeds 0, 1, ...; the first ``walked`` that are planned are carried out and checked.

    Args:
        kept: file with a record a line: those in it are not measured again, new ones are added.
    """
    known = {r["seed"]: r for r in map(json.loads, kept.read_text().splitlines())} if kept and kept.exists() else {}
    reference, whole = Reference(it.walker), cylinder(rigid=True)
    for seed in range(count):
        done = known.get(seed)
        if done is None or (seed < walked and "arrived" not in done):
            done = judged(it, reference, layout(seed, whole), seed < walked)
            if kept is not None:
                kept.parent.mkdir(parents=True, exist_ok=True)
                with kept.open("a") as file:
                    file.write(json.dumps(done) + "\n")
        yield done


def judged(it: Machine, reference: Reference, asked: Layout, walked: bool) -> Record:
    """Verdict, plan or refusal, and the walk."""
    poses = [GridPose(*place, 0.0, HEIGHT) for place in (asked.start, asked.goal)]
    verdict = reference.judge(asked.structure, *poses)
    out: Record = {
        "seed": asked.seed,
        "fraction": asked.fraction,
        "from": asked.start,
        "to": asked.goal,
        "verdict": verdict.kind,
        "reference_s": verdict.time,
        "reference_separating": verdict.separating,
    }
    begin = time.perf_counter()
    try:
        path = grid_path([asked.start, asked.goal], SPEED * INCH, height=HEIGHT)
        plan = plan_walk(it.walker, asked.structure, path, objective="destination", detour=True)
    except NoPlanError as error:
        out |= {"planned": False, "reason": str(error), "separating": error.separating}
        return out | {"plan_s": time.perf_counter() - begin}
    out |= {"planned": True, "regrasps": len(plan.regrasps), "delay_s": plan.delay, "path_s": plan.path.duration}
    out |= {"detour": len(plan.path) != len(path), "plan_s": time.perf_counter() - begin}
    return out | (checked(it, asked.structure, plan, asked.seed) if walked else {})


def checked(it: Machine, structure: Structure, plan: Plan, seed: int) -> Record:
    """A plan carried out, and what the external checker finds."""
    walk = Walk(it.walker, structure, plan, stack=it.stack)
    recorder = WalkRecorder(walk, seed)
    try:
        end = walk.run(recorder.tick)
    except NoPlanError as error:
        end = str(error)
    with TemporaryDirectory() as folder:
        report = check_walk(recorder.log()[0], it.walker.urdf(Path(folder) / "robot.urdf"), structure)
    found = [finding.kind for finding in report.violations]
    return {"arrived": end == "arrived", "end": end, "walk_s": walk.time, "violations": found}
