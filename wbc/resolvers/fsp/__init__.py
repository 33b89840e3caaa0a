"""Full Space Parameterization: every solution of a task, and the best one in closed form. See docs/fsp.md."""

from __future__ import annotations

from wbc.resolvers.fsp.blocking import blocked, pattern_counts
from wbc.resolvers.fsp.closed_form import Optimum, RateRow, best, joint_row, lost_rows, one_shot, parametric, point_row
from wbc.resolvers.fsp.criteria import Criterion, least_acceleration, least_power, least_torque
from wbc.resolvers.fsp.space import SolutionSpace, SpaceStatus, orthogonal

__all__ = [
    "Criterion",
    "Optimum",
    "RateRow",
    "SolutionSpace",
    "SpaceStatus",
    "best",
    "blocked",
    "joint_row",
    "least_acceleration",
    "least_power",
    "least_torque",
    "lost_rows",
    "one_shot",
    "orthogonal",
    "parametric",
    "pattern_counts",
    "point_row",
]
