"""The 21 instances of toppra's robustness suite: ours take no longer than the published durations."""

from __future__ import annotations

import numpy as np
import pytest

from tests.trajectory.suite import INSTANCES, PROBLEMS
from wbc.trajectory import time_optimal

#: Of the straight moves, twice the square root of distance over acceleration
EXACT = {
    "small_joint_1": 2.0 * np.sqrt(0.00464187 / 100.0),
    "issue26": 2.0 * np.sqrt(0.001549763598 / 1000.0),
    "two_points_1": 0.2,
    "two_points_2": 0.002,
}


@pytest.mark.parametrize(("name", "points", "asked", "published"), INSTANCES)
def test_instance(name, points, asked, published):
    waypoints, velocity, acceleration = PROBLEMS[name]
    law = time_optimal(waypoints, velocity, acceleration, duration=asked, intervals=points - 1)
    assert law.duration <= published * (1.0 + 1e-9)
    for quantity in ("velocity", "acceleration"):
        worst = law.certificate.worst[quantity]
        assert worst.kind == "exact"
        assert worst.ratio <= 1.0 + 1e-6
    if asked is not None:
        assert law.duration == pytest.approx(asked, rel=1e-12)
    elif name in EXACT:
        assert law.duration == pytest.approx(EXACT[name], rel=5e-3)
        assert law.duration >= EXACT[name] * (1.0 - 1e-9)


def test_the_suite_has_its_21_instances():
    assert len(INSTANCES) == 21
    assert {name for name, *_ in INSTANCES} == set(PROBLEMS)
