"""Over 8 x 8 patches: as few re-grasps as an exact search finds, from anywhere to anywhere, with holds gone."""

from __future__ import annotations

from math import pi, radians

import numpy as np
import pytest

from tests.judges.fewest_along import fewest_along
from wbc.robots import Walker
from wbc.walking import Structure
from wbc.walking.body_path import BodyPath, grid_path
from wbc.walking.planner.fewest import least_regrasps
from wbc.walking.planner.grips.table import Grips
from wbc.walking.planner.planner import plan_walk

INCH = 0.0254
#: What the planner keeps of limits [rad] and reach [m]
ROOM = radians(2.0), 0.3 * INCH
#: Poses of a way that the exact search looks at: one of so many, and the last
EVERY = 10
#: Ways by their seed, and the fewest re-grasps of each; at 16 and 74 the last pose counts, at 61 a hand has to wait in
#: the air, at 76 a hand begins on a hold that it cannot keep for long, and at 144 on one that is no promising start
FEWEST = {0: 1, 1: 0, 3: 1, 6: 3, 7: 2, 16: 2, 61: 2, 74: 1, 76: 2, 144: 2}


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


@pytest.mark.parametrize("seed", sorted(FEWEST))
def test_as_few_regrasps_as_an_exact_search(machine: Walker, structure: Structure, seed: int) -> None:
    way, holds = patch(seed, structure)
    plan = plan_walk(machine, holds, way, objective="destination", time_budget=None)
    looked_at = way.poses[np.unique(np.append(np.arange(0, len(way), EVERY), len(way) - 1))]
    assert len(plan.regrasps) == fewest_along(machine, holds, looked_at, *ROOM) == FEWEST[seed]
    # What each arm needs at least for itself is never more than what the plan has for it
    grips = plan.grips
    assert grips is not None
    least = least_regrasps(grips, len(way) - 1)
    for chain in plan.chain:
        assert (least[list(chain)] <= np.arange(len(chain))[::-1]).all()
        assert least[chain[-1]] == 0


def test_how_many_regrasps_an_arm_needs_at_least() -> None:
    first, last = np.array([0, 0, 2, 4, 0, 3, 9]), np.array([3, 2, 5, 9, 2, 1, 9])
    arm, hold = np.array([0, 0, 0, 0, 1, 1, 1]), np.array([0, 1, 2, 3, 0, 1, -1])
    none = np.zeros(7, dtype=np.int64)
    grips = Grips(arm, hold, none, first, last, none, np.zeros((1, 6)), none, none)
    # A hand may wait in the air; a hold that is gone helps nobody, but the hand that has it keeps it to the end
    assert least_regrasps(grips, 9).tolist() == [1, 1, 1, 0, 8, 8, 0]
