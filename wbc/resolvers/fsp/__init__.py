"""Full Space Parameterization: every solution of a task, and the best one in closed form. See docs/fsp.md."""

from __future__ import annotations

from wbc.resolvers.fsp.blocking import blocked as blocked, pattern_counts as pattern_counts
from wbc.resolvers.fsp.closed_form import (
    EqualityRow as EqualityRow,
    Optimum as Optimum,
    best as best,
    joint_row as joint_row,
    lost_rows as lost_rows,
    one_shot as one_shot,
    parametric as parametric,
    point_row as point_row,
)
from wbc.resolvers.fsp.criteria import (
    Criterion as Criterion,
    least_acceleration as least_acceleration,
    least_power as least_power,
    least_torque as least_torque,
)
from wbc.resolvers.fsp.space import Consistency as Consistency, SolutionSpace as SolutionSpace, orthogonal as orthogonal
