"""The 21 instances of toppra's robustness suite, with the durations that it publishes.

Numbers from tests/retime/robustness of github.com/hungpham2511/toppra: problems, and durations with hotqpOASES by
number of grid points; a duration that was asked for is published as reached within 1e-5.
"""

from __future__ import annotations

from typing import Any

import numpy as np

SMALL = [-38593, 13093, 64752, 116383, 167987, 219563, 271112, 322633, 374127, 425594]
ISSUE_26 = [-3.85929168, -2.13610365, -0.413223272, 1.30934967, 3.03161539, 4.75357412, 6.47522605, 8.19657141]
ISSUE_26 += [9.91761041, 11.6383433]

#: Name -> waypoints, velocity limits, acceleration limits
PROBLEMS: dict[str, tuple[Any, tuple[int, ...], tuple[int, ...]]] = {
    "small_joint_1": (np.outer(SMALL, np.full(3, 1e-8)), (100, 100, 100), (100, 100, 100)),
    "small_joint_2": ([[0, 0, 0], [0, 1e-5, 0], [0, 0, 0]], (100, 10000, 100), (100, 10000, 100)),
    "small_joint_3": ([[0, 0, 0], [0, 1e-7, 0], [0, 0, 0]], (100, 1000, 100), (100, 1000, 100)),
    "issue26": (np.outer(ISSUE_26, np.full(3, 1e-4)), (1000, 1000, 1000), (1000, 2000, 10000)),
    "two_points_1": ([[0, 0, 0], [0, 1, 0]], (100, 100, 100), (100, 100, 100)),
    "two_points_2": ([[0, 0, 0], [0, 1e-4, 0]], (100, 100, 100), (100, 100, 100)),
}

#: Name, grid points, duration that is asked for, published duration
INSTANCES: list[tuple[str, int, float | None, float]] = [
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
