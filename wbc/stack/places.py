"""Tables that tie rows to the buffers: gains, rates, margins and the limits of accelerations."""

from __future__ import annotations

import numpy as np

from wbc.stack.declaration import Declaration
from wbc.stack.layout import Layout
from wbc.stack.program import Program
from wbc.tasks.base import Constraint

#: What a direction that a level leaves to later ones may cost its rows at full joint speed, in their unit per second
DISTURBANCE = 1e-6
#: Full speed of joints without a limit [rad/s, or characteristic lengths per second]
UNLIMITED = 10.0


def left_free(stack: Declaration) -> float:
    """Singular values below this are left to later levels: DISTURBANCE / (max(1, length) |full joint speeds|)."""
    scales = np.array([stack.length if u == "m" else 1.0 for u in stack.robot.dof_units])
    fastest = stack.robot.limits.velocity / scales
    fastest = np.where(np.isfinite(fastest), fastest, UNLIMITED)
    return DISTURBANCE / (max(1.0, stack.length) * max(float(np.linalg.norm(fastest)), 1e-3))


def gain_places(layout: Layout) -> list[int]:
    """Where the gain of each task row is in the parameters."""
    return [b.slots["gain"].start for b in layout.of_form("task") for _ in b.rows]


def pull_scales(stack: Declaration, layout: Layout, program: Program) -> list[float]:
    """How much curvature a task row of unit weighted error may have: its lever for metres, else 1; 0 for rows that
    do not bend.
    """
    rows = [r for b in layout.of_form("task") for r in b.rows]
    if program.bend is None:
        return [0.0] * len(rows)
    bending = np.diff(program.bend.jac_sparsity(0, 4).colind()) > 0
    scales = [2.0 * stack.length if r.unit.split("/")[0] == "m" else 1.0 for r in rows]
    return [scale * float(bends) for scale, bends in zip(scales, bending, strict=True)]


def brakes(stack: Declaration, layout: Layout) -> tuple[list[int], np.ndarray]:
    """(entry of ``bound_enabled``, -1 for none; limit) of what limits each degree of freedom's acceleration most."""
    places, limits = [-1] * layout.nv, np.full(layout.nv, np.inf)
    for k, block in enumerate(layout.of_form("bounds")):
        item = block.entry.item
        assert isinstance(item, Constraint)
        for i, limit in enumerate(item.acceleration_limits(stack.robot)):
            if limit < limits[i]:
                places[i], limits[i] = k * layout.nv + i, limit
    return places, limits


def margin_places(layout: Layout) -> list[int]:
    """Margin row of each general row, -1 for rows that are none."""
    out: list[int] = []
    for block in layout.of_form("margins", "rows"):
        out += [block.margin_start + k if block.form == "margins" else -1 for k in range(len(block.rows))]
    return out


def rate_places(layout: Layout) -> list[int]:
    """Where the rate of each general row is in the parameters, 0 for rows without."""
    blocks = layout.of_form("margins", "rows")
    return [b.slots["rate"].start if b.form == "margins" else 0 for b in blocks for _ in b.rows]


def stops(stack: Declaration, layout: Layout) -> tuple[list[int], np.ndarray, np.ndarray]:
    """(entry of ``bound_enabled``, -1 for none; lower; upper) of the position limits of each degree of freedom."""
    places = [-1] * layout.nv
    lower, upper = np.full(layout.nv, -np.inf), np.full(layout.nv, np.inf)
    for k, block in enumerate(layout.of_form("bounds")):
        item = block.entry.item
        assert isinstance(item, Constraint)
        below, above = item.position_limits(stack.robot)
        for i in np.flatnonzero(np.isfinite(below) | np.isfinite(above)):
            places[i] = k * layout.nv + int(i)
        lower, upper = np.maximum(lower, below), np.minimum(upper, above)
    return places, lower, upper
