"""The two-ended arm, whose limbs have fewer joints than a grip fixes: the body goes where they take it."""

from __future__ import annotations

from itertools import pairwise, permutations, product

import numpy as np
import pytest

from tests.climb.arriving import arrives
from tests.repeats import repeats
from wbc.climb import (
    FREE_LIMB,
    ClimbLoop,
    ClimbOptions,
    ClimbScene,
    ContactPlan,
    Foothold,
    LimbAt,
    Route,
    StanceOptions,
    first_stance,
    plan_climb,
)
from wbc.climb.machines import climber
from wbc.climb.scene import SceneBody, size_of
from wbc.climb.scenes import draw, placed
from wbc.errors import RangeError
from wbc.multibody import pin
from wbc.shapes import HalfSpace


def row_of_holds(seed: int) -> ClimbScene:
    """Holds along a way that bends on a plane, of any rolls."""
    rng = np.random.default_rng(seed)
    pitch, bend, heading = rng.uniform(3.0, 5.5), rng.uniform(-0.25, 0.25), 0.0
    frames = [pin.SE3.Identity()]
    for _ in range(int(rng.integers(3, 8))):
        heading += bend * rng.uniform()
        ahead = pitch * rng.uniform(0.85, 1.15) * np.array([np.cos(heading), np.sin(heading), 0.0])
        turn = pin.utils.rotate("z", heading + rng.uniform(-0.3, 0.3))
        frames.append(pin.SE3(turn, frames[-1].translation + ahead))
    holds = [Foothold(str(k), f, "plane", rolls=int(rng.choice([0, 1, 4]))) for k, f in enumerate(frames)]
    return ClimbScene(holds, {"plane": SceneBody(HalfSpace())}, np.zeros(3))


@pytest.mark.parametrize("seed", range(repeats(2)))
def test_it_goes_end_over_end_along_rows(seed: int) -> None:
    arm, scene = climber("two_ended"), row_of_holds(seed)
    start = first_stance(arm, scene, placed(arm, pin.SE3(np.eye(3), scene.positions[:2].mean(axis=0))))
    plan = plan_climb(arm, scene, start, LimbAt("arm2", scene.footholds[-1].id))
    run = ClimbLoop(plan).run()
    arrives(run, arm, run.scene)
    assert run.log["contact.arm2"][-1] == len(scene.footholds) - 1


def test_a_route_says_which_hand_goes_where() -> None:
    arm, course = climber("two_ended"), draw("row", size_of(climber("two_ended")))
    start = first_stance(arm, course.scene, placed(arm, course.start))
    plan = plan_climb(arm, course.scene, start, Route([LimbAt("arm1", "3"), LimbAt("arm2", "4")]))
    stances = stances_of(plan)
    came = next(k for k, contacts in enumerate(stances) if contacts[0] == 2)
    assert any(contacts[1] == 3 for contacts in stances[came:])
    assert stances[-1][1] == 3


@pytest.mark.parametrize("turns", [False, True])
def test_gaits_are_moves_that_are_forbidden(turns: bool) -> None:
    """Inchworm: the hands keep their order; turnaround: each swing changes it."""
    arm, course = climber("two_ended"), draw("row", size_of(climber("two_ended")))
    start = first_stance(arm, course.scene, placed(arm, course.start))
    pairs = list(permutations(range(6), 2))
    others = {(a, b) for a, b in product(pairs, pairs) if a != b and ((a[0] < a[1]) != (b[0] < b[1])) != turns}
    frees = {(a, b) for a in pairs for b in ((FREE_LIMB, a[1]), (a[0], FREE_LIMB))}
    options = ClimbOptions(StanceOptions(forbidden=frozenset(others | frees)))
    plan = plan_climb(arm, course.scene, start, Route([LimbAt("arm2", "6"), LimbAt("arm1", "5")]), options)
    orders = [near < far for near, far in stances_of(plan) if FREE_LIMB not in (near, far)]
    assert len(orders) > 2
    assert all((before != after) == turns for before, after in pairwise(orders))
    assert stances_of(plan)[-1][0] == 4


def stances_of(plan: ContactPlan) -> list[tuple[int, int]]:
    """Rows of the footholds of both hands, at first and after each move."""
    near, far = plan.start
    out = [(near, far)]
    for move in plan.moves:
        near, far = (move.lands, far) if move.limb == 0 else (near, move.lands)
        out.append((near, far))
    return out


def test_where_something_weighs_it_needs_masses() -> None:
    arm, scene = climber("two_ended"), row_of_holds(0)
    heavy = ClimbScene(scene.footholds, scene.bodies)
    with pytest.raises(RangeError, match=r"scene\.gravity.*two_ended has no masses"):
        first_stance(arm, heavy, arm.rest)
