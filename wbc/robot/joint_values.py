"""Numbers of joints out of configurations, many at once: the one reader of joints without end and of ball joints."""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray

from wbc.multibody import pin
from wbc.robot.robot import Robot
from wbc.rotations import exponential, matrices, quaternion
from wbc.validation import Array

#: How far beyond a limit counts as within it, as files round their numbers [m, rad]
LIMIT_SLACK = 1e-6


def joint_values(robot: Robot, q: Array) -> Array:
    """Numbers of all joints but the base ``(n, nv - base_nv)`` [m, rad] in configurations ``(n, nq)`` that follow each
    other: angles of joints without end do not jump; a ball joint has its rotation vector.
    """
    rows, endless, balls = _rows(robot)
    out = q[:, rows]
    if len(endless):
        out[:, endless] = np.unwrap(np.arctan2(q[:, rows[endless] + 1], q[:, rows[endless]]), axis=0)
    for ball in balls:
        out[:, ball : ball + 3] = [pin.log3(turn) for turn in matrices(q[:, rows[ball] : rows[ball] + 4])]
    return out


def with_joint_values(robot: Robot, q: Array, values: Array) -> Array:
    """Configurations ``(n, nq)`` with other numbers of joints ``(n, nv - base_nv)``."""
    rows, endless, balls = _rows(robot)
    out = np.array(q, dtype=np.float64)
    out[:, rows] = values
    if len(endless):
        out[:, rows[endless]], out[:, rows[endless] + 1] = np.cos(values[:, endless]), np.sin(values[:, endless])
    for ball in balls:
        turns = exponential(values[:, ball : ball + 3])
        out[:, rows[ball] : rows[ball] + 4] = [quaternion(turn) for turn in turns]
    return out


def beyond_limits(robot: Robot, q: Array) -> tuple[str, float] | None:
    """The joint that is furthest beyond its limits in some configurations ``(n, nq)``, and by how much [m, rad]; None:
    all are within them.
    """
    first, index, limits = robot.base_nv, robot.position_index, robot.limits
    ends = np.flatnonzero(index[first:] >= 0) + first
    values = q[:, index[ends]]
    beyond = np.maximum(
        limits.position_lower[ends] - values.min(axis=0), values.max(axis=0) - limits.position_upper[ends]
    )
    worst = int(np.argmax(beyond))
    return (robot.dof_names[ends[worst]], float(beyond[worst])) if beyond[worst] > LIMIT_SLACK else None


@functools.lru_cache(maxsize=16)
def _rows(robot: Robot) -> tuple[NDArray[np.intp], NDArray[np.intp], list[int]]:
    """First row in q of each degree of freedom after the base's; which are of joints without end; the first ones of
    turns, of ball joints and of bodies that float.
    """
    model, base, rows = robot.model, robot.base_nv, robot.position_index.copy()
    endless, balls = list[int](), list[int]()
    for q, v, nq, nv in zip(model.idx_qs, model.idx_vs, model.nqs, model.nvs, strict=True):
        if v >= base and nq == 2 > nv:
            rows[v] = q
            endless.append(v - base)
        elif v >= base and nq > nv:
            shifts = nq - 4
            rows[v : v + nv] = [*range(q, q + shifts), *[q + shifts] * 3]
            balls.append(v - base + shifts)
    return np.array(rows[base:], dtype=np.intp), np.array(endless, dtype=np.intp), balls
