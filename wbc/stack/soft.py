"""Variables of the QP besides the velocities: slacks of soft rows, and nu = lambda |w| of tasks that keep a direction.

A row of a soft constraint with the price p, in its unit with the scale r (the characteristic length for metres), is

    lower <= a v + r / sqrt(p) s <= upper            s in the QP at the cost s^2

so that a violation x = r |s| / sqrt(p) costs p (x / r)^2. The cost is a task row of the constraint's level, so that
nothing else in a tick knows of slacks. At the price 0 the row is left out.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from wbc.stack.declaration import Declaration, soft_rows
from wbc.stack.layout import Block, Layout
from wbc.tasks._direction import Direction
from wbc.tasks.base import Bounds, Rows

#: Speed that a task asks for which asks for nothing [rad/s, lengths per second]
LEAST = 1e-12


def slacks(layout: Layout) -> list[tuple[int, ca.SX, ca.SX, ca.SX, ca.SX]]:
    """(task row; error, wish, factor, J transposed) of what minimises each slack."""
    out = []
    for row, variable in layout.slack_rows.items():
        unit = ca.SX(layout.variables, 1)
        unit[variable] = 1.0
        out.append((row, ca.SX.zeros(1), ca.SX.zeros(1), ca.SX.ones(1), unit))
    return out


def speeds(
    stack: Declaration, layout: Layout, tasks: dict[str, tuple[ca.SX, ca.SX, ca.SX, ca.SX]]
) -> list[tuple[int, ca.SX, ca.SX, ca.SX, ca.SX]]:
    """The same of the rows that report the speed |w| that a scaled task asks for, and count for nothing."""
    out, zero = [], ca.SX.zeros(1)
    scales = layout.row_scales(stack)
    for row, block in zip(layout.share_rows, _directions(layout), strict=True):
        assert isinstance(block.entry.item, Direction)
        task = layout.blocks[block.entry.item.of]
        _, wish, factor, _ = tasks[task.entry.name]
        asked = speed(factor * wish / scales[task.span])
        out.append((row, asked, zero, zero, ca.SX(layout.variables, 1)))
    return out


def _directions(layout: Layout) -> list[Block]:
    return [b for b in layout.of_form("rows") if isinstance(b.entry.item, Direction)]


def speed(rates: ca.SX) -> ca.SX:
    """|w|, and as good as nothing where that is 0."""
    return ca.sqrt(ca.sumsqr(rates) + LEAST**2)


def widened(layout: Layout, transposed: ca.SX) -> ca.SX:
    """Columns of numbers a degree of freedom, with none for the other variables."""
    return ca.vertcat(transposed, ca.SX(layout.variables - layout.nv, transposed.shape[1]))


def unlimited(layout: Layout, bounds: Bounds) -> Bounds:
    """Bounds on velocities, with none on the other variables."""
    free = ca.SX.inf(layout.variables - layout.nv)
    return Bounds(ca.vertcat(bounds.lower, -free), ca.vertcat(bounds.upper, free))


def softened(stack: Declaration, block: Block, rows: Rows, p: ca.SX) -> Rows:
    """Rows of a constraint over all variables, with their slacks where it is soft."""
    if block.entry.price is None:
        return rows
    matrix = ca.SX(rows.matrix)
    price, lower, upper = p[block.slots["price"].span], [], []
    on = price > 0.0
    for k, row in enumerate(block.rows):
        if k < soft_rows(block.entry, stack.robot):
            scale = row.scale(stack.length)
            matrix[k, block.variables.start + k] = scale / ca.sqrt(ca.if_else(on, price, 1.0))
        lower.append(ca.if_else(on, rows.lower[k], -np.inf))
        upper.append(ca.if_else(on, rows.upper[k], np.inf))
    return Rows(matrix, ca.vertcat(*lower), ca.vertcat(*upper))


def kept_direction(
    stack: Declaration, layout: Layout, block: Block, wish: ca.SX, factor: ca.SX, jacobian: ca.SX
) -> Rows:
    """Rows over all variables of what keeps a task's direction, see :class:`wbc.tasks._direction.Direction`."""
    assert isinstance(block.entry.item, Direction)
    count = jacobian.shape[0]
    asked = speed(factor * wish / layout.row_scales(stack)[layout.blocks[block.entry.item.of].span])
    matrix = ca.SX(count + 1, layout.variables)
    matrix[:count, : layout.nv] = ca.diag(factor) @ jacobian
    matrix[:count, block.variables.stop - 1] = -factor * wish / asked
    matrix[count, block.variables.stop - 1] = 1.0
    ends = ca.SX.zeros(count)
    return Rows(matrix, ca.vertcat(ends, 0.0), ca.vertcat(ends, asked))
