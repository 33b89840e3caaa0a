"""Ways over patches of 8 x 8 holds: as few re-grasps as an exact search finds?"""

from __future__ import annotations

import time
from functools import partial
from math import pi, radians

import numpy as np

from bench.walk.machine import INCH, Job, Machine, Record
from bench.walk.reference import Rules, fewest_along
from wbc.validation import Array
from wbc.walking import Structure
from wbc.walking.body_path import BodyPath, grid_path
from wbc.walking.planner.plan import NoPlanError
from wbc.walking.planner.planner import plan_walk

#: What the planner keeps of limits and reach
ROOM = Rules(angle_room=radians(2.0), reach_room=0.3 * INCH)
#: Poses of a way that the exact search looks at: one of so many, and the last
EVERY = 10


def patch(seed: int, structure: Structure) -> tuple[BodyPath, Structure]:
    """A way of 2 to 4.5 grid units at any heading, over 64 holds of which up to 30 % are gone."""
    generator = np.random.default_rng(seed)
    while True:
        first, last = generator.uniform([10.5, 9.5], [14.5, 13.5], (2, 2))
        if 2.0 <= np.hypot(*(first - last)) <= 4.5:
            break
    heading = generator.uniform(-pi, pi)
    holds = [f"{t},{a}" for t in range(9, 17) for a in range(8, 16)]
    gone = generator.permutation(64)[: round(64 * generator.uniform(0.0, 0.3))]
    kept = set(holds) - {holds[k] for k in gone}
    way = grid_path([(*first, heading), (*last, heading)], 2 * INCH)
    return way, structure.without([hold for hold in structure.ids if hold not in kept])


def looked_at(way: BodyPath) -> Array:
    """Poses at which the exact search looks ``[n, 4, 4]``."""
    out: Array = way.poses[np.unique(np.append(np.arange(0, len(way), EVERY), len(way) - 1))]
    return out


def compared(it: Machine, seed: int) -> Record:
    """Re-grasps of the plan and of breadth-first search, None where there is no way."""
    way, holds = patch(seed, it.structure)
    begin, reason = time.process_time(), ""
    try:
        plan = plan_walk(it.walker, holds, way, objective="destination", time_budget=None)
        planned: int | None = len(plan.regrasps)
    except NoPlanError as error:
        planned, reason = None, str(error)
    middle = time.process_time()
    fewest = fewest_along(it.walker, holds, looked_at(way), ROOM)
    return {
        "seed": seed,
        "holds": len(holds),
        "planned": planned,
        "fewest": fewest,
        "reason": reason,
        "plan_s": middle - begin,
        "search_s": time.process_time() - middle,
    }


def patch_jobs(it: Machine, count: int) -> list[Job]:
    """Patches of the seeds 0, 1, ..."""
    return [Job(f"seed {seed}", partial(compared, it, seed)) for seed in range(count)]
