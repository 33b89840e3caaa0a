"""What does not change a plan, or changes it in a known way; and the fewest re-grasps by an exact search."""

from __future__ import annotations

from math import pi, radians

import pytest

from tests.judges.fewest_along import fewest_along
from wbc.robots import Walker
from wbc.walking import Structure
from wbc.walking.body_path import BodyPath, grid_path
from wbc.walking.planner.plan import Plan
from wbc.walking.planner.planner import plan_walk

INCH = 0.0254
#: Over a patch of 8 x 8 holds, from and to in (T, A)
WAYS = {"diagonal": ((11, 10), (14, 13)), "+T": ((10.5, 11.5), (14.5, 11.5))}
#: What the planner keeps of limits [rad] and reach [m]
ROOM = radians(2.0), 0.3 * INCH
#: After a third of a turn each arm is where the next one was
BEFORE = {"arm1": "arm3", "arm2": "arm1", "arm3": "arm2"}


@pytest.fixture(scope="module")
def patch(structure: Structure) -> Structure:
    kept = {f"{t},{a}" for t in range(9, 17) for a in range(8, 16)}
    return structure.without([hold for hold in structure.ids if hold not in kept])


def path(name: str, heading: float = 0.0) -> BodyPath:
    first, last = WAYS[name]
    return grid_path([(*first, heading), (*last, heading)], 2 * INCH)


def planned(machine: Walker, holds: Structure, way: BodyPath) -> Plan:
    return plan_walk(machine, holds, way, objective="destination")


@pytest.mark.parametrize("name", sorted(WAYS))
def test_as_few_regrasps_as_an_exact_search(machine: Walker, patch: Structure, name: str) -> None:
    way = path(name)
    fewest = fewest_along(machine, patch, way.poses[::10], *ROOM)
    plan = planned(machine, patch, way)
    assert len(plan.regrasps) == fewest == 3
    # With a hold less the fewest cannot be less: the hold that the first hand went to is gone
    less = patch.without([plan.regrasps[0].target])
    assert len(planned(machine, less, way).regrasps) >= fewest


def test_a_body_turned_by_a_third_of_a_turn_walks_with_other_arms(machine: Walker, patch: Structure) -> None:
    plan, turned = (planned(machine, patch, path("diagonal", heading)) for heading in (0.0, 2.0 * pi / 3.0))
    assert turned.start == (*plan.start[1:], plan.start[0])
    assert [step.arm for step in turned.regrasps] == [BEFORE[step.arm] for step in plan.regrasps]
    for one, other in zip(plan.regrasps, turned.regrasps, strict=True):
        assert (one.source, one.target, one.branch) == (other.source, other.target, other.branch)
        assert (one.lift, one.land, one.until) == pytest.approx((other.lift, other.land, other.until))
