"""Names, units and kinds of the bounds of a past tick's rows and joints."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from wbc.explain.explanation import ExplainedBound
from wbc.explain.past import PastTick
from wbc.stack.codegen import row_orders, row_units
from wbc.stack.layout import Block, rate_unit
from wbc.tasks._direction import Direction
from wbc.tasks.base import Constraint, SacrificeOrder
from wbc.tasks.joint_limits import JointLimits
from wbc.validation import Array


class Naming:
    """Bounds by their row of [1; A]: simple bounds first, then general rows."""

    def __init__(self, past: PastTick) -> None:
        self._past, self._nv = past, past.layout.variables
        self.orders = row_orders(past.layout)
        #: what counts as one radian a second: the characteristic length for metres [n + m]
        self.units: Array = np.concatenate((past.layout.dof_scales(past.stack), row_units(past.stack, past.layout)))

    @cached_property
    def general(self) -> list[tuple[Block, int]]:
        """(block, row within it) of every general row."""
        return [(b, k) for b in self._past.layout.of_form("margins", "rows") for k in range(len(b.rows))]

    @cached_property
    def bounds(self) -> list[Block]:
        """Bound blocks by number."""
        return self._past.layout.of_form("bounds")

    def owner(self, row: int, upper: bool) -> Block | None:
        """The item that sets a bound."""
        if row >= self._nv:
            return self.general[row - self._nv][0]
        number = int((self._past.owner_high if upper else self._past.owner_low)[row])
        return self.bounds[number] if number >= 0 else None

    def keeps_direction(self, row: int) -> bool:
        """Whether a general row is one of those that keep the direction of a scaled task."""
        return row >= self._nv and isinstance(self.general[row - self._nv][0].entry.item, Direction)

    def bound(self, row: int, upper: bool) -> ExplainedBound:
        """A bound by name, with its value in the QP."""
        past, block, qp = self._past, self.owner(row, upper), self._past.qp
        value = float((qp.upper if upper else qp.lower)[row])
        which = "equal" if qp.lower[row] == qp.upper[row] else ("upper" if upper else "lower")
        order = SacrificeOrder.ACTUATOR
        if block is not None and isinstance(block.entry.item, Constraint):
            order = block.entry.order
        item = block.entry.name if block is not None else "bounds"
        actuator = order == SacrificeOrder.ACTUATOR
        robot = past.stack.robot
        if robot.nv <= row < self._nv:
            return ExplainedBound(item, past.layout.variable(row)[0], which, value, past.layout.variable(row)[1])
        if row < self._nv:
            unit = rate_unit(robot.dof_units[row], past.layout.command)
            kind = self._kind(block, row, value) if past.layout.command == "velocity" else ""
            return ExplainedBound(
                item, robot.dof_names[row], which, value, unit, kind, None, actuator and kind != "position"
            )
        own, k = self.general[row - self._nv]
        label = own.rows[k]
        margin = float(past.part("margin")[own.margin_start + k]) if own.form == "margins" else None
        unit = rate_unit(label.unit, past.layout.command)
        return ExplainedBound(item, label.label, which, value, unit, "", margin, actuator)

    def _kind(self, block: Block | None, row: int, value: float) -> str:
        """Which of the limits of a :class:`JointLimits` gives a bound its value."""
        if block is None or not isinstance(block.entry.item, JointLimits):
            return ""
        past = self._past
        limits, tick = past.stack.robot.limits, past.tick
        speed = float(limits.velocity[row]) * float(tick.p[block.slots["velocity_scale"].span][0])
        change = float(limits.acceleration[row]) * float(tick.dt[0])
        start = float(tick.v_last[row])
        tolerance = 1e-12 * max(1.0, abs(value))
        if block.entry.item.velocity and abs(abs(value) - speed) <= tolerance:
            return "velocity"
        if block.entry.item.acceleration and min(abs(value - start - change), abs(value - start + change)) <= tolerance:
            return "acceleration"
        return "position" if block.entry.item.position else ""
