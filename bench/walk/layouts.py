"""Layouts of the published cylinder, holds removed at random: what the reference says, and what our planner does."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from bench.walk.machine import INCH, Job, Machine, Record
from bench.walk.reference import GridPose
from wbc.walking import Structure, remove_fraction
from wbc.walking.body_path import grid_path

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


def judged(it: Machine, asked: Layout, walked: bool) -> Record:
    """Verdict, plan or refusal, and the walk."""
    verdict = it.reference.judge(
        asked.structure, *(GridPose(*place, 0.0, HEIGHT) for place in (asked.start, asked.goal))
    )
    out: Record = {
        "seed": asked.seed,
        "fraction": asked.fraction,
        "from": list(asked.start),
        "to": list(asked.goal),
        "verdict": verdict.kind,
        "reference_s": verdict.time,
        "reference_separating": list(verdict.separating),
    }
    path = grid_path([asked.start, asked.goal], SPEED * INCH, height=HEIGHT)
    plan, found = it.planned(asked.structure, path, objective="destination", detour=True)
    if plan is None or not walked:
        return out | found
    return out | found | it.carry_out(asked.structure, plan, found["plan_s"], asked.seed)


def layout_jobs(it: Machine, count: int, walked: int) -> list[Job]:
    """Layouts of the seeds 0, 1, ...; the first ``walked`` are carried out too, where there is a plan."""

    def one(seed: int) -> Record:
        return judged(it, layout(seed, it.structure), seed < walked)

    return [Job(f"seed {seed}{' walked' if seed < walked else ''}", partial(one, seed)) for seed in range(count)]
