"""Numbers of joints out of configurations, many at once."""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray

from wbc.robot import Robot
from wbc.validation import Array

#: How far beyond a limit counts as within it, as files round their numbers [m, rad]
LIMIT_SLACK = 1e-6


def joint_values(robot: Robot, q: Array) -> Array:
    """Numbers of all joints but the base ``(n, nv - 6)`` [m, rad] in configurations ``(n, nq)`` that follow each other:
    angles of joints without end do not jump.
    """
    rows, endless = _rows(robot)
    out = q[:, rows]
    if len(endless):
        out[:, endless] = np.unwrap(np.arctan2(q[:, rows[endless] + 1], q[:, rows[endless]]), axis=0)
    return out


def with_joint_values(robot: Robot, q: Array, values: Array) -> Array:
    """Configurations ``(n, nq)`` with other numbers of joints ``(n, nv - 6)``."""
    rows, endless = _rows(robot)
    out = np.array(q, dtype=np.float64)
    out[:, rows] = values
    if len(endless):
        out[:, rows[endless]], out[:, rows[endless] + 1] = np.cos(values[:, endless]), np.sin(values[:, endless])
    return out


def beyond_limits(robot: Robot, q: Array) -> tuple[str, float] | None:
    """The joint that is furthest beyond its limits in some configurations ``(n, nq)``, and by how much [m, rad]; None:
    all are within them.
    """
    ends = np.flatnonzero(robot.position_index[6:] >= 0) + 6
    values = q[:, robot.position_index[ends]]
    lower, upper = robot.limits.position_lower[ends], robot.limits.position_upper[ends]
    beyond = np.maximum(lower - values.min(axis=0), values.max(axis=0) - upper)
    worst = int(np.argmax(beyond))
    return (robot.dof_names[ends[worst]], float(beyond[worst])) if beyond[worst] > LIMIT_SLACK else None


@functools.lru_cache(maxsize=16)
def _rows(robot: Robot) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """First row in q of each degree of freedom after the base's, and which are of joints without end."""
    model = robot.model
    first = {int(model.idx_vs[j]): int(model.idx_qs[j]) for j in range(1, model.njoints)}
    index = robot.position_index[6:]
    rows = [int(row) if row >= 0 else first[dof] for dof, row in enumerate(index, start=6)]
    return np.array(rows, dtype=np.intp), np.flatnonzero(index < 0)
