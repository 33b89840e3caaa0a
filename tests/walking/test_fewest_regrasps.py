"""Over 8 x 8 patches: as few re-grasps as an exact search finds, from anywhere to anywhere, with holds gone."""

from __future__ import annotations

import pytest

from bench.walk.patches import ROOM, looked_at, patch
from wbc.robots import Walker
from wbc.walking import Structure
from wbc.walking.planner import plan_walk
from wbc.walking.reference import fewest_along

#: Ways by their seed, and the fewest re-grasps of each; at 16 and 74 the last pose counts, at 61 a hand has to wait in
#: the air, and at 76 a hand begins on a hold that it cannot keep for long
FEWEST = {0: 1, 1: 0, 3: 1, 6: 3, 7: 2, 16: 2, 61: 2, 74: 1, 76: 2}


@pytest.mark.parametrize("seed", sorted(FEWEST))
def test_as_few_regrasps_as_an_exact_search(machine: Walker, structure: Structure, seed: int) -> None:
    way, holds = patch(seed, structure)
    plan = plan_walk(machine, holds, way, objective="destination", time_budget=None)
    assert len(plan.regrasps) == fewest_along(machine, holds, looked_at(way), ROOM) == FEWEST[seed]
