"""Where everything stands in the flat buffers, known from the declaration alone (no expression is built)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wbc.errors import ShapeError
from wbc.stack.declaration import HIGHEST_PRICE, Declaration, Entry, soft_rows
from wbc.tasks import inputs
from wbc.tasks._direction import Direction
from wbc.tasks.base import Constraint, Form, Input, Row, Task


@dataclass(frozen=True, eq=False)
class Slot:
    """An input and its place in the parameter buffer."""

    input: Input
    start: int
    size: int

    @cached_property
    def span(self) -> slice:
        """Place in the parameter buffer."""
        return slice(self.start, self.start + self.size)


@dataclass(frozen=True, eq=False)
class Block:
    """An item's rows and inputs.

    ``start`` counts within the rows of the same form: task rows, general constraint rows, or, for
    bounds, blocks of nv. ``margin_start`` counts margin rows only (-1: none). ``variables`` are those of the QP that
    the rows have for themselves, see :mod:`wbc.stack.soft`.
    """

    entry: Entry
    form: Form
    rows: tuple[Row, ...]
    start: int
    margin_start: int
    slots: dict[str, Slot]
    variables: slice

    @property
    def span(self) -> slice:
        """Rows of the block within its form."""
        return slice(self.start, self.start + len(self.rows))

    @property
    def margins(self) -> slice:
        """Margin rows of the block."""
        return slice(self.margin_start, self.margin_start + len(self.rows))


class Layout:
    """Blocks, tasks by level and else in stack order, and the sizes of all buffers.

    Attributes:
        levels: numbers of the levels at which something is minimised, in order. cascade: they are strict levels, solved
            one after the other; False: all is one problem.
        leading: task rows of the first level, which come first.
        row_levels: place in ``levels`` of each general row that is minimised there, -1 for hard rows.
        nv: degrees of freedom. variables: of the QP; what comes after the velocities are slacks of soft rows, and
            shares of scaled tasks.
        slack_rows: task row -> the slack that it minimises. share_rows: task row -> the speed of a scaled task; such a
            row counts for nothing, and its error is the speed that is asked for.
        nothing: a place in the parameters that holds 0, where there are slacks.
    """

    def __init__(self, stack: Declaration) -> None:
        robot = stack.robot
        self.nq, self.nv = robot.nq, robot.nv
        self.variables = self.nv
        self.parameters = 0
        self.task_rows = self.general_rows = self.bound_blocks = self.margin_rows = 0
        self.blocks: dict[str, Block] = {}
        self.levels = stack.levels
        self.row_levels: list[int] = []
        self.slack_rows: dict[int, int] = {}
        self.share_rows: dict[int, int] = {}
        self._ends: list[int] = []
        variables: dict[str, slice] = {}
        for level in self.levels:
            for entry in (e for e in stack.tasks if e.level == level):
                self._add(stack, entry)
            for entry in (e for e in stack.constraints if e.price is not None and e.level == level):
                variables[entry.name] = self._slacks(stack, entry)
            self._ends.append(self.task_rows)
        for entry in stack.constraints:
            self._add(stack, entry, variables.get(entry.name, slice(0, 0)))
        self.nothing = -1
        if self.slack_rows:
            self.nothing, self.parameters = self.parameters, self.parameters + 1
        self.cascade = len(self.levels) > 1 or any(level >= 0 for level in self.row_levels)
        self.leading = self.level_rows(0).stop

    def _slacks(self, stack: Declaration, entry: Entry) -> slice:
        """Variables of a soft constraint; task rows at its level minimise those that are slacks."""
        first, count = self.variables, soft_rows(entry, stack.robot)
        for k in range(count):
            self.slack_rows[self.task_rows + k] = first + k
        self.task_rows += count
        self.variables += count
        if isinstance(entry.item, Direction):
            self.share_rows[self.task_rows] = self.variables
            self.task_rows, self.variables = self.task_rows + 1, self.variables + 1
        return slice(first, self.variables)

    def _add(self, stack: Declaration, entry: Entry, variables: slice = slice(0, 0)) -> None:
        robot, item = stack.robot, entry.item
        rows = item.rows(robot)
        labels = [r.label for r in rows]
        if len(set(labels)) != len(labels):
            raise ShapeError(f"{entry.name}.rows", labels, "row labels repeat")
        slots: dict[str, Slot] = {}
        declared = list(item.inputs(robot))
        form: Form = "task"
        if isinstance(item, Constraint):
            form = item.form
            count = item.sensed_rows(robot)
            if count:
                declared += inputs.sensed(robot, count)
            if form == "margins":
                declared.append(Input("rate", unit="1/s", default=item.default_rate, low=0.0))
        elif isinstance(item, Task) and not any(i.name == "gain" for i in declared):
            default = item.default_gain if item.gain is None else item.gain
            declared.append(Input("gain", unit="1/s", default=default, low=0.0))
        if entry.price is not None:
            high = np.inf if isinstance(item, Direction) else HIGHEST_PRICE
            declared.append(Input("price", default=entry.price, low=0.0, high=high))
        for declared_input in declared:
            if declared_input.name in slots:
                raise ShapeError(f"{entry.name}.inputs", declared_input.name, "an input of this name is declared twice")
            size = inputs.size(robot, declared_input)
            slots[declared_input.name] = Slot(declared_input, self.parameters, size)
            self.parameters += size
        margin = -1
        if form == "task":
            start, self.task_rows = self.task_rows, self.task_rows + len(rows)
        elif form == "bounds":
            start, self.bound_blocks = self.bound_blocks, self.bound_blocks + 1
        else:
            start, self.general_rows = self.general_rows, self.general_rows + len(rows)
            level = self.levels.index(entry.level) if entry.level > 0 and entry.price is None else -1
            self.row_levels += [level] * len(rows)
            if form == "margins":
                margin, self.margin_rows = self.margin_rows, self.margin_rows + len(rows)
        self.blocks[entry.name] = Block(entry, form, rows, start, margin, slots, variables)

    def of_form(self, *forms: Form) -> list[Block]:
        """Blocks of the given forms, in row order."""
        return [b for b in self.blocks.values() if b.form in forms]

    def level_rows(self, place: int) -> slice:
        """Task rows of a level, by its place in ``levels``, those that minimise slacks included."""
        return slice(self._ends[place - 1] if place else 0, self._ends[place])

    def row_scales(self, stack: Declaration) -> np.ndarray:
        """Scale of each task row: the characteristic length for rows in metres, see :meth:`Row.scale`."""
        scales = np.ones(self.task_rows)
        for block in self.of_form("task"):
            for k, row in enumerate(block.rows):
                scales[block.start + k] = row.scale(stack.length)
        return scales

    def dof_scales(self, stack: Declaration) -> np.ndarray:
        """Scale of each variable: the characteristic length for metres, 1 for radians and slacks."""
        own = [stack.length if u == "m" else 1.0 for u in stack.robot.dof_units]
        return np.array(own + [1.0] * (self.variables - self.nv))
