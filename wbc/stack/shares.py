"""Soft rows, and the variable nu = lambda |w| of a task that keeps its direction.

A row lower <= a v <= upper of a soft constraint with the price p, in its unit with the scale r (the characteristic
length for metres), has no bound: a violation x costs p (x / r)^2. It gives way by ``give`` = r^2 / p per multiplier,

    lower <= a v - give lambda <= upper,

which is all that a solver needs to know of it; at the price 0 the row is left out. With strict levels soft rows are
minimised at their level, like a constraint that was added to it.
"""

from __future__ import annotations

import casadi as ca

from wbc.stack.declaration import Declaration
from wbc.stack.layout import Block, Layout
from wbc.tasks._direction import Direction
from wbc.tasks.base import Bounds, Rows

#: Speed that a task asks for which asks for nothing [rad/s, lengths per second]
LEAST = 1e-12


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


def kept_direction(
    stack: Declaration, layout: Layout, block: Block, wish: ca.SX, factor: ca.SX, jacobian: ca.SX
) -> Rows:
    """Rows over all variables of what keeps a task's direction, see :class:`wbc.tasks._direction.Direction`."""
    assert isinstance(block.entry.item, Direction)
    count = jacobian.shape[0]
    asked = speed(factor * wish / layout.row_scales(stack)[layout.blocks[block.entry.item.of].span])
    matrix = ca.SX(count + 1, layout.variables)
    matrix[:count, : layout.nv] = ca.diag(factor) @ jacobian
    matrix[:count, block.share] = -factor * wish / asked
    matrix[count, block.share] = 1.0
    ends = ca.SX.zeros(count)
    return Rows(matrix, ca.vertcat(ends, 0.0), ca.vertcat(ends, asked))
