"""Variables of the QP besides the velocities: slacks of soft rows, and mu = 1 - lambda of tasks that keep a direction.

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
from wbc.tasks.base import Bounds, Rows


def slacks(layout: Layout) -> list[tuple[int, ca.SX, ca.SX, ca.SX, ca.SX]]:
    """(task row; error, wish, factor, J transposed) of what minimises each slack."""
    out = []
    for row, variable in layout.slack_rows.items():
        unit = ca.SX(layout.variables, 1)
        unit[variable] = 1.0
        out.append((row, ca.SX.zeros(1), ca.SX.zeros(1), ca.SX.ones(1), unit))
    return out


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
            scale = stack.length if row.unit.split("/")[0] == "m" else 1.0
            matrix[k, block.variables.start + k] = scale / ca.sqrt(ca.if_else(on, price, 1.0))
        lower.append(ca.if_else(on, rows.lower[k], -np.inf))
        upper.append(ca.if_else(on, rows.upper[k], np.inf))
    return Rows(matrix, ca.vertcat(*lower), ca.vertcat(*upper))


def kept_direction(layout: Layout, block: Block, wish: ca.SX, factor: ca.SX, jacobian: ca.SX) -> Rows:
    """Rows over all variables of what keeps a task's direction, see :class:`wbc.tasks._direction.Direction`."""
    count = jacobian.shape[0]
    matrix = ca.SX(count + 1, layout.variables)
    matrix[:count, : layout.nv] = ca.diag(factor) @ jacobian
    matrix[:count, block.variables.stop - 1] = factor * wish
    matrix[count, block.variables.stop - 1] = 1.0
    ends = factor * wish
    return Rows(matrix, ca.vertcat(ends, 0.0), ca.vertcat(ends, 1.0))
