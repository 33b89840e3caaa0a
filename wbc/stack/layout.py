"""Where everything stands in the flat buffers, known from the declaration alone (no expression is built)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wbc.errors import ShapeError
from wbc.stack.declaration import Declaration, Entry
from wbc.tasks import inputs
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
    bounds, blocks of nv. ``margin_start`` counts margin rows only (-1: none).
    """

    entry: Entry
    form: Form
    rows: tuple[Row, ...]
    start: int
    margin_start: int
    slots: dict[str, Slot]

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
    """

    def __init__(self, stack: Declaration) -> None:
        robot = stack.robot
        self.nq, self.nv = robot.nq, robot.nv
        self.parameters = 0
        self.task_rows = self.general_rows = self.bound_blocks = self.margin_rows = 0
        self.blocks: dict[str, Block] = {}
        self.levels = stack.levels
        self.row_levels: list[int] = []
        for entry in (*sorted(stack.tasks, key=lambda e: e.level), *stack.constraints):
            self._add(stack, entry)
        self.cascade = len(self.levels) > 1 or any(level >= 0 for level in self.row_levels)
        self.leading = self.level_rows(0).stop

    def _add(self, stack: Declaration, entry: Entry) -> None:
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
            level = self.levels.index(entry.level) if entry.level > 0 else -1
            self.row_levels += [level] * len(rows)
            if form == "margins":
                margin, self.margin_rows = self.margin_rows, self.margin_rows + len(rows)
        self.blocks[entry.name] = Block(entry, form, rows, start, margin, slots)

    def of_form(self, *forms: Form) -> list[Block]:
        """Blocks of the given forms, in row order."""
        return [b for b in self.blocks.values() if b.form in forms]

    def level_rows(self, place: int) -> slice:
        """Task rows of a level, by its place in ``levels``."""
        level = self.levels[place]
        spans = [b.span for b in self.of_form("task")]
        levels = [b.entry.level for b in self.of_form("task")]
        start = sum(s.stop - s.start for s, k in zip(spans, levels, strict=True) if k < level)
        return slice(start, start + sum(s.stop - s.start for s, k in zip(spans, levels, strict=True) if k == level))

    def row_scales(self, stack: Declaration) -> np.ndarray:
        """Scale of each task row: the characteristic length for rows in metres, 1 for others."""
        scales = np.ones(self.task_rows)
        for block in self.of_form("task"):
            for k, row in enumerate(block.rows):
                if row.unit.split("/")[0] == "m":
                    scales[block.start + k] = stack.length
        return scales

    def dof_scales(self, stack: Declaration) -> np.ndarray:
        """Scale of each degree of freedom: the characteristic length for metres, 1 for radians."""
        return np.array([stack.length if u == "m" else 1.0 for u in stack.robot.dof_units])
