"""The other tests compile without optimisation; optimised as for users, a tick gives the same bits."""

from __future__ import annotations

import numpy as np

from tests.controller.stacks import controller, near_limits, quarrel, robot
from tests.optimised import ticks
from wbc.api import Controller
from wbc.controller import core_of


def optimised(rows: str, tick: str) -> Controller:
    """A stack whose rows contradict each other, compiled with these flags."""
    with ticks(tick, rows):
        return controller("conflicts", backend="native")


def test_answers_are_the_same_bits() -> None:
    plain, quick = optimised("-O0", "-O0"), optimised("-O1", "-O3")
    statuses = set()
    for k in range(30):
        q = near_limits(robot("panda"), np.random.default_rng(k))
        steps = []
        for one in (plain, quick):
            one.reset(q)
            quarrel(one, np.random.default_rng(1000 + k))
            steps.append(one.step(q))
        assert steps[0]._data == steps[1]._data
        statuses.add(str(steps[0].status))
    assert {"solved", "relaxed"} <= statuses
    assert core_of(plain).tick._library._name != core_of(quick).tick._library._name
