"""Whether arms are near each other, by the quick look and by all distances."""

from __future__ import annotations

import numpy as np

import wbc
from wbc.walking.planner.grips.conflicts import LimbShapes


def test_the_quick_look_finds_what_all_distances_find() -> None:
    machine = wbc.robots.walker()
    shapes = LimbShapes(machine)
    limits, generator = machine.robot.limits, np.random.default_rng(0)
    low, high = (np.array(x[6:12]) for x in (limits.position_lower, limits.position_upper))
    one, other = (shapes.points(arm, generator.uniform(low, high, (500, 6))) for arm in (0, 1))
    near = shapes.near(one, other)
    assert 20 < near.sum() < 480
    assert (near == (shapes.between(one, other) < 0.0)).all()
