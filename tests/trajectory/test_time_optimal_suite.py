"""The 21 instances of toppra's robustness suite: ours take no longer than the published durations.

Numbers from tests/retime/robustness of github.com/hungpham2511/toppra: problems, and durations with hotqpOASES by
number of grid points; a duration that was asked for is published as reached within 1e-5.
"""

from __future__ import annotations

import numpy as np
import pytest

from wbc.trajectory import time_optimal

SMALL = [-38593, 13093, 64752, 116383, 167987, 219563, 271112, 322633, 374127, 425594]
ISSUE_26 = [-3.85929168, -2.13610365, -0.413223272, 1.30934967, 3.03161539, 4.75357412, 6.47522605, 8.19657141]
ISSUE_26 += [9.91761041, 11.6383433]

PROBLEMS = {
    "small_joint_1": (np.outer(SMALL, np.full(3, 1e-8)), (100, 100, 100), (100, 100, 100)),
    "small_joint_2": ([[0, 0, 0], [0, 1e-5, 0], [0, 0, 0]], (100, 10000, 100), (100, 10000, 100)),
    "small_joint_3": ([[0, 0, 0], [0, 1e-7, 0], [0, 0, 0]], (100, 1000, 100), (100, 1000, 100)),
    "issue26": (np.outer(ISSUE_26, np.full(3, 1e-4)), (1000, 1000, 1000), (1000, 2000, 10000)),
    "two_points_1": ([[0, 0, 0], [0, 1, 0]], (100, 100, 100), (100, 100, 100)),
    "two_points_2": ([[0, 0, 0], [0, 1e-4, 0]], (100, 100, 100), (100, 100, 100)),
}

INSTANCES = [
    ("small_joint_1", 51, None, 0.016612985457027357),
    ("small_joint_1", 101, None, 0.015290573525169774),
    ("small_joint_1", 51, 1.0, 1.0),
    ("small_joint_1", 101, 1.0, 1.0),
    ("two_points_1", 51, None, 0.21795131053541544),
    ("two_points_1", 101, None, 0.2092776508389017),
    ("two_points_1", 501, None, 0.20191161759805468),
    ("two_points_1", 51, 1.0, 1.0),
    ("two_points_1", 101, 1.0, 1.0),
    ("two_points_1", 501, 1.0, 1.0),
    ("small_joint_3", 51, None, 4.350270185541421e-05),
    ("small_joint_3", 101, None, 4.18480279617463e-05),
    ("small_joint_2", 51, None, 0.00013756762223433963),
    ("small_joint_2", 101, None, 0.00013233508394553208),
    ("issue26", 51, None, 0.0030355222658642843),
    ("issue26", 101, None, 0.0027938926520855688),
    ("issue26", 51, 1.0, 1.0),
    ("issue26", 101, 1.0, 1.0),
    ("two_points_2", 51, None, 0.002179513104002523),
    ("two_points_2", 101, None, 0.0020927765062652374),
    ("two_points_2", 1001, None, 0.002009597765345841),
]

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


@pytest.mark.parametrize("name", sorted(EXACT))
def test_closed_forms_with_the_usual_grid(name):
    assert time_optimal(*PROBLEMS[name]).duration == pytest.approx(EXACT[name], rel=1e-3)
