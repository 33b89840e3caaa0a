"""Tables that tie rows to the buffers: gains, rates, margins and the limits of accelerations."""

from __future__ import annotations

from collections import Counter
from typing import NamedTuple

import casadi as ca
import numpy as np

from wbc.stack.declaration import Declaration
from wbc.stack.layout import Layout
from wbc.stack.program import TickProgram
from wbc.tasks._contact import Unactuated
from wbc.tasks._direction import Direction
from wbc.tasks.base import Constraint, Row
from wbc.tasks.mechanism import Mechanism

#: What a direction that a level leaves to later ones may cost its rows at full joint speed, in their unit per second
DISTURBANCE = 1e-6
#: Full speed of joints without a limit [rad/s, or characteristic lengths per second]
UNLIMITED = 10.0
#: Violations of soft rows up to this are not reported [rad/s, lengths per second]
SOFT_REPORTED = 2e-9
#: Violations of rows that keep a direction up to this are not reported [rad/s, lengths per second]
DIRECTION_REPORTED = 1e-5


def left_free(stack: Declaration) -> float:
    """Singular values below this are left to later levels: DISTURBANCE / (max(1, length) |full joint speeds|)."""
    scales = np.array([stack.length if u == "m" else 1.0 for u in stack.robot.dof_units])
    fastest = stack.robot.limits.velocity / scales
    fastest = np.where(np.isfinite(fastest), fastest, UNLIMITED)
    return DISTURBANCE / (max(1.0, stack.length) * max(float(np.linalg.norm(fastest)), 1e-3))


def gain_table(layout: Layout) -> list[int]:
    """Where the gain of each task row is in the parameters."""
    slots = [layout.nothing] * layout.task_rows
    for block in layout.of_form("task"):
        gain = block.slots.get("stiffness") or block.slots["gain"]
        slots[block.span] = [gain.start] * len(block.rows)
    return slots


def kept_rows(layout: Layout) -> list[int]:
    """The task row of the first level whose direction each general row keeps, -1 for rows that keep none."""
    rows = [-1] * layout.general_rows
    for block in layout.of_form("rows"):
        if isinstance(block.entry.item, Direction):
            task = layout.blocks[block.entry.item.of].span
            for k, row in enumerate(range(task.start, task.stop)):
                rows[block.start + k] = row if row < layout.leading else -1
    return rows


def reported_slacks(stack: Declaration, layout: Layout) -> list[float]:
    """Violation of each soft row from which on it is reported, per second: beyond rounding, and for kept directions
    beyond what their finite price leaves.
    """
    out = [0.0] * layout.general_rows
    for block in layout.of_form("margins", "rows"):
        least = DIRECTION_REPORTED if isinstance(block.entry.item, Direction) else SOFT_REPORTED
        for k, row in enumerate(block.rows):
            out[block.start + k] = least * row.scale(stack.length)
    return out


def _lever(stack: Declaration, row: Row) -> float:
    """Twice the scale of rows of lengths, that of others as it is."""
    return row.scale(2.0 * stack.length)


def force_scales(stack: Declaration, layout: Layout, program: TickProgram) -> list[float]:
    """How much curvature a task row of unit weighted error may have: its lever for metres, else 1; 0 for rows without
    any: they have none of their own, and move a single joint or meet no equality row that bends.
    """
    scales = np.zeros(layout.task_rows)
    if program.curvature is not None:
        for block in layout.of_form("task"):
            scales[block.span] = [_lever(stack, row) for row in block.rows]
        curved = np.diff(program.curvature.jac_sparsity(0, 4).colind())[: layout.task_rows] > 0
        moves = np.diff(program.rows.sparsity_out("jt").colind()) > 1
        scales *= curved | moves if any(bent_rows(layout, program)) else curved
    return scales.tolist()


def bent_rows(layout: Layout, program: TickProgram) -> list[int]:
    """1 for general rows whose residual bends within a tick, see :meth:`Constraint.residual`, 2 for those of them that
    are exact; else 0.
    """
    out = np.zeros(layout.general_rows, dtype=np.int_)
    if program.lost is not None:
        out[program.lost.jac_sparsity(0, 1).row()] = 1
        for block in layout.of_form("rows"):
            out[block.span] *= 1 + int(getattr(block.entry.item, "exact", False))
    return [int(x) for x in out]


def taken_out(stack: Declaration, layout: Layout) -> int:
    """Independent equality rows that every tick of a robot with loops has: they are taken out of its QP; 0 without."""
    blocks = layout.of_form("rows") if stack.robot.loops else ()
    whole = sum(len(block.rows) for block in blocks if isinstance(block.entry.item, (Mechanism, Unactuated)))
    return whole - sum(len(rows) - held for rows, held in spare_rows(stack, layout))


def spare_rows(stack: Declaration, layout: Layout) -> list[tuple[list[int], int]]:
    """(general rows; how many are independent where loops are closed) of linkages whose rows depend on each other."""
    block, robot = layout.mechanism, stack.robot
    first = 0 if block is None else block.span.stop - len(robot.loops.rows)
    parts = [part for part in robot.loops.linkages if len(part.rows) > part.held]
    return [([first + row for row in part.rows], part.held) for part in parts]


def forces_in_loops(stack: Declaration, layout: Layout) -> int:
    """Variables of the QP, one a row of the mechanism; 0 where rows depend on each other or have no forces, or none is
    a variable.
    """
    block, count = layout.mechanism, len(layout.loop_rows)
    return count if block is not None and len(block.rows) == count and not spare_rows(stack, layout) else 0


def torque_rows(stack: Declaration, layout: Layout) -> list[int]:
    """The degree of freedom whose torque each general row is that no motor gives, -1 for other rows."""
    out = [-1] * layout.general_rows
    for block in layout.of_form("rows"):
        if isinstance(block.entry.item, Unactuated):
            out[block.start : block.start + len(block.rows)] = stack.robot.unactuated
    return out


def late_rows(layout: Layout, at: ca.Sparsity) -> list[int]:
    """1 for general rows that have forces beside accelerations.

    Args:
        at: entries of the rows, transposed [variables, general rows].
    """
    late = {row for variable, row in zip(*at.get_triplet(), strict=True) if variable >= layout.nv}
    return [int(row in late) for row in range(layout.general_rows)]


def give_order(stack: Declaration, layout: Layout, at: ca.Sparsity) -> list[int]:
    """Degrees of freedom in the order in which rows that are taken out give them: those without motors and of few rows
    first, so that loops keep to their own joints and motors are left.

    Args:
        at: as of :func:`late_rows`.
    """
    if not taken_out(stack, layout):
        return list(range(layout.nv))
    block = layout.mechanism
    own = set() if block is None else {*range(block.span.start, block.span.stop)}
    counts = Counter(variable for variable, row in zip(*at.get_triplet(), strict=True) if row in own)
    passive = set(stack.robot.passive)
    return sorted(range(layout.nv), key=lambda dof: (dof not in passive, counts[dof], dof))


def brakes(stack: Declaration, layout: Layout) -> tuple[list[int], np.ndarray]:
    """(entry of ``bound_enabled``, -1 for none; limit) of what limits each degree of freedom's acceleration most."""
    slots, limits = [-1] * layout.variables, np.full(layout.variables, np.inf)
    for k, block in enumerate(layout.of_form("bounds")):
        item = block.entry.item
        assert isinstance(item, Constraint)
        for i, limit in enumerate(item.acceleration_limits(stack.robot)):
            if limit < limits[i]:
                slots[i], limits[i] = k * layout.variables + i, limit
    return slots, limits


def margin_table(layout: Layout) -> list[int]:
    """Margin row of each general row, -1 for rows that are none."""
    out: list[int] = []
    for block in layout.of_form("margins", "rows"):
        out += [block.margin_start + k if block.form == "margins" else -1 for k in range(len(block.rows))]
    return out


def rate_table(layout: Layout) -> list[int]:
    """Where the rate of each general row is in the parameters, 0 for rows without."""
    blocks = layout.of_form("margins", "rows")
    return [b.slots["rate"].start if b.form == "margins" else 0 for b in blocks for _ in b.rows]


class Stops(NamedTuple):
    """Position limits of each degree of freedom.

    Attributes:
        bounds: entries of ``bound_enabled``, -1 for none.
        rows: general rows, of limits that may give way; -1 for none.
        lower: least positions [rad or m].
        upper: largest positions [rad or m].
    """

    bounds: list[int]
    rows: list[int]
    lower: np.ndarray
    upper: np.ndarray


def stops(stack: Declaration, layout: Layout) -> Stops:
    """Position limits of a stack, the narrowest where several items have one."""
    slots, rows = ([-1] * layout.variables for _ in range(2))
    lower, upper = np.full(layout.variables, -np.inf), np.full(layout.variables, np.inf)
    bounds = [(slots, k * layout.variables, block) for k, block in enumerate(layout.of_form("bounds"))]
    yielding = [(rows, block.start, block) for block in layout.of_form("rows") if block.entry.yielding]
    for places, first, block in bounds + yielding:
        item = block.entry.item
        assert isinstance(item, Constraint)
        below, above = item.position_limits(stack.robot)
        for i in np.flatnonzero(np.isfinite(below) | np.isfinite(above)):
            places[i] = first + int(i)
        lower[: layout.nv] = np.maximum(lower[: layout.nv], below)
        upper[: layout.nv] = np.minimum(upper[: layout.nv], above)
    return Stops(slots, rows, lower, upper)
