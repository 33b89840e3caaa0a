"""Over 8 x 8 patches: as few re-grasps as an exact search finds, from anywhere to anywhere, with holds gone."""

from __future__ import annotations

from math import pi, radians

import numpy as np
import pytest

from wbc.robots import Walker
from wbc.walking import Structure
from wbc.walking.body_path import BodyPath, grid_path
from wbc.walking.planner import plan_walk
from wbc.walking.reference import Rules, fewest_along

INCH = 0.0254
#: What the planner keeps of limits and reach
ROOM = Rules(angle_room=radians(2.0), reach_room=0.3 * INCH)
#: Ways by their seed, and the fewest re-grasps of each
FEWEST = {0: 1, 1: 0, 2: 0, 3: 1, 4: 1, 5: 0, 6: 3, 7: 2, 8: 0, 9: 1}


def way_of(seed: int, structure: Structure) -> tuple[BodyPath, Structure]:
    """A way of 2 to 4.5 grid units at any heading, over 64 holds of which up to 30 % are gone."""
    generator = np.random.default_rng(seed)
    while True:
        first, last = generator.uniform([10.5, 9.5], [14.5, 13.5], (2, 2))
        if 2.0 <= np.hypot(*(first - last)) <= 4.5:
            break
    heading = generator.uniform(-pi, pi)
    patch = [f"{t},{a}" for t in range(9, 17) for a in range(8, 16)]
    gone = generator.permutation(64)[: round(64 * generator.uniform(0.0, 0.3))]
    kept = set(patch) - {patch[k] for k in gone}
    way = grid_path([(*first, heading), (*last, heading)], 2 * INCH)
    return way, structure.without([hold for hold in structure.ids if hold not in kept])


@pytest.mark.parametrize("seed", sorted(FEWEST))
def test_as_few_regrasps_as_an_exact_search(machine: Walker, structure: Structure, seed: int) -> None:
    way, holds = way_of(seed, structure)
    plan = plan_walk(machine, holds, way, objective="destination", time_budget=None)
    assert len(plan.regrasps) == fewest_along(machine, holds, way.poses[::10], ROOM) == FEWEST[seed]
