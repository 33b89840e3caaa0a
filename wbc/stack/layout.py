"""Where everything stands in the flat buffers, known from the declaration alone (no expression is built)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wbc.errors import ShapeError
from wbc.robot import Robot
from wbc.stack.declaration import HIGHEST_PRICE, Declaration, Entry, soft_rows
from wbc.tasks import inputs
from wbc.tasks._contact import Contact, ContactWrench, force_sizes
from wbc.tasks._direction import Direction
from wbc.tasks.base import Constraint, Form, Input, Row, Task
from wbc.tasks.mechanism import Mechanism
from wbc.tasks.torque_limits import TorqueLimits
from wbc.tasks.wrench_sum import WrenchSum


@dataclass(frozen=True, eq=False)
class Slot:
    """An input and its slots in the parameter buffer."""

    input: Input
    start: int
    size: int

    @cached_property
    def span(self) -> slice:
        """Slots in the parameter buffer."""
        return slice(self.start, self.start + self.size)


@dataclass(frozen=True, eq=False)
class Block:
    """An item's rows and inputs.

    ``start`` counts within the rows of the same form: task rows, general constraint rows, or, for
    bounds, blocks of nv. ``margin_start`` counts margin rows only (-1: none). ``share`` is the variable of the QP that
    says how much of its command a scaled task is given (-1: none), see :mod:`wbc.stack.shares`.
    """

    entry: Entry
    form: Form
    rows: tuple[Row, ...]
    start: int
    margin_start: int
    slots: dict[str, Slot]
    share: int = -1

    @property
    def span(self) -> slice:
        """Rows of the block within its form."""
        return slice(self.start, self.start + len(self.rows))

    @property
    def margins(self) -> slice:
        """Margin rows of the block."""
        return slice(self.margin_start, self.margin_start + len(self.rows))


def _moves(robot: Robot) -> list[tuple[bool, int, int]]:
    """See :attr:`Layout.moves`."""
    joints = [joint for joint in list(robot.tree.joints)[1:] if joint.nq > 0]
    free = ["FreeFlyer" in joint.shortname() for joint in joints]
    if robot.loops or not all(base or (joint.nq, joint.nv) == (1, 1) for base, joint in zip(free, joints, strict=True)):
        return []
    return [(base, int(joint.idx_q), int(joint.idx_v)) for base, joint in zip(free, joints, strict=True)]


class Layout:
    """Blocks, tasks by level and else in stack order, and the sizes of all buffers.

    Attributes:
        levels: numbers of the levels at which something is minimised, in order. cascade: they are strict levels, solved
            one after the other; False: all is one problem.
        leading: task rows of the first level, which come first.
        row_levels: index in ``levels`` of each general row that is minimised there, -1 for the others.
        price_at: offset in the parameters of the price of each general row that is soft, -1 for the others.
        command: what is commanded. nv: degrees of freedom. variables: of the QP; what comes after the velocities, or
            accelerations, are shares of scaled tasks, or the wrenches of contacts.
        elastic: limits of motion are rows, and they and what is held give way at prices and not in order.
        moves: of each joint whether it is a free base, and its places in q and v; empty where q (+) v dt is not for C.
        forces: where the wrench of each contact is among the variables, by the contact's name.
        loop_forces: where the forces in loops are among the variables, one a row of :attr:`loop_rows`.
        share_rows: task row -> the share of a scaled task; such a row counts for nothing, and its error is the speed
            that is asked for.
        nothing: an offset in the parameters that holds 0, where there are shares.
        slewed: places in the parameters of torques of the last command that may change only so fast, and their degrees
            of freedom.
    """

    def __init__(self, stack: Declaration) -> None:
        robot = stack.robot
        self.nq, self.nv = robot.nq, robot.nv
        self.command = stack.command
        self.moves = _moves(robot) if self.command == "velocity" else []
        self.elastic = stack.command == "torque" and bool(robot.unactuated)
        self.variables = self.nv
        self.forces: dict[str, slice] = {}
        if stack.command == "torque":
            for entry in stack.constraints:
                if isinstance(entry.item, Contact):
                    count = entry.item.components
                    self.forces[entry.name] = slice(self.variables, self.variables + count)
                    self.variables += count
        self.loop_rows = robot.loops.rows if stack.command == "torque" else ()
        self.loop_forces = slice(self.variables, self.variables + len(self.loop_rows))
        self.variables += len(self.loop_rows)
        self.parameters = 0
        self.task_rows = self.general_rows = self.bound_blocks = self.margin_rows = 0
        self.blocks: dict[str, Block] = {}
        self.levels = stack.levels
        self.row_levels: list[int] = []
        self.price_at: list[int] = []
        self.share_rows: dict[int, int] = {}
        self.slewed: tuple[list[int], list[int]] = ([], [])
        self._ends: list[int] = []
        self.cascade = len(self.levels) > 1 or any(e.level > 0 and e.price is None for e in stack.constraints)
        shares: dict[str, int] = {}
        for level in self.levels:
            for entry in (e for e in stack.tasks if e.level == level):
                self._add(stack, entry)
            for entry in (e for e in stack.constraints if isinstance(e.item, Direction) and e.level == level):
                shares[entry.name] = self.share_rows[self.task_rows] = self.variables
                self.task_rows, self.variables = self.task_rows + 1, self.variables + 1
            self._ends.append(self.task_rows)
        for entry in stack.constraints:
            self._add(stack, entry, shares.get(entry.name, -1))
        self.nothing = -1
        if self.share_rows:
            self.nothing, self.parameters = self.parameters, self.parameters + 1
        self.leading = self.level_rows(0).stop

    @cached_property
    def shares(self) -> int:
        """Variables that are shares of scaled tasks."""
        return len(self.share_rows)

    def _add(self, stack: Declaration, entry: Entry, share: int = -1) -> None:
        robot, item = stack.robot, entry.item
        rows = item.rows(robot)
        labels = [r.label for r in rows]
        if len(set(labels)) != len(labels):
            raise ShapeError(f"{entry.name}.rows", labels, "row labels repeat")
        slots: dict[str, Slot] = {}
        declared = list(item.inputs(robot))
        form: Form = "task"
        if isinstance(item, Constraint):
            form = entry.form
            count = item.sensed_rows(robot)
            if count:
                declared += inputs.sensed(robot, count)
            decays = self.command != "velocity" and not (entry.yielding or _on_forces(item, rows))
            if form == "margins" or (form == "rows" and decays):
                declared.append(Input("rate", unit="1/s", default=item.default_rate, low=0.0))
            if self.command == "torque" and (isinstance(item, Contact) or item.is_load):
                declared.append(Input(CLOSED, default=1.0, low=0.0, high=1.0, sensed=True))
        elif isinstance(item, Task) and not any(i.name == "gain" for i in declared):
            default = item.default_gain if item.gain is None else item.gain
            declared += _gains(default) if self.command != "velocity" else [_gain(default)]
        if self.command != "velocity":
            declared = inputs.with_accelerations(robot, declared)
        if entry.price is not None:
            high = np.inf if isinstance(item, Direction) else HIGHEST_PRICE
            declared.append(Input("price", default=entry.price, low=0.0, high=high))
        for declared_input in declared:
            if declared_input.name in slots:
                raise ShapeError(f"{entry.name}.inputs", declared_input.name, "an input of this name is declared twice")
            size = inputs.size(robot, declared_input)
            slots[declared_input.name] = Slot(declared_input, self.parameters, size)
            self.parameters += size
        if isinstance(item, TorqueLimits) and "last" in slots:
            last = slots["last"]
            self.slewed[0].extend(range(last.start, last.start + last.size))
            self.slewed[1].extend(item.dofs(robot))
        margin = -1
        if form == "task":
            start, self.task_rows = self.task_rows, self.task_rows + len(rows)
        elif form == "bounds":
            start, self.bound_blocks = self.bound_blocks, self.bound_blocks + 1
        else:
            start, self.general_rows = self.general_rows, self.general_rows + len(rows)
            level = self.levels.index(entry.level) if entry.level > 0 and entry.price is None else -1
            own = self.levels.index(entry.level) if self.cascade and entry.price is not None else level
            soft = soft_rows(entry, robot)
            self.row_levels += [own] * soft + [level] * (len(rows) - soft)
            self.price_at += [slots["price"].start if k < soft else -1 for k in range(len(rows))]
            if form == "margins":
                margin, self.margin_rows = self.margin_rows, self.margin_rows + len(rows)
        self.blocks[entry.name] = Block(entry, form, rows, start, margin, slots, share)

    @property
    def with_slacks(self) -> int:
        """Variables of a QP that has one more for each soft row, see :meth:`wbc.qp.problem.QP.with_slacks`."""
        return self.variables + (0 if self.cascade else sum(at >= 0 for at in self.price_at))

    def of_form(self, *forms: Form) -> list[Block]:
        """Blocks of the given forms, in row order."""
        return [b for b in self.blocks.values() if b.form in forms]

    @property
    def mechanism(self) -> Block | None:
        """That of couplings and loops; None of a robot without."""
        return next((block for block in self.of_form("rows") if isinstance(block.entry.item, Mechanism)), None)

    def level_rows(self, place: int) -> slice:
        """Task rows of a level, by its index in ``levels``."""
        return slice(self._ends[place - 1] if place else 0, self._ends[place])

    def row_scales(self, stack: Declaration) -> np.ndarray:
        """Scale of each task row: the characteristic length for rows in metres, see :meth:`Row.scale`."""
        scales = np.ones(self.task_rows)
        for block in self.of_form("task"):
            for k, row in enumerate(block.rows):
                scales[block.start + k] = row.scale(stack.length)
        return scales

    def dof_scales(self, stack: Declaration) -> np.ndarray:
        """Scale of each variable: the characteristic length for metres, 1 for radians and shares; of wrenches see
        :meth:`wbc.tasks._contact.Contact.sizes`.
        """
        own = [stack.length if u == "m" else 1.0 for u in stack.robot.dof_units]
        out = np.array(own + [1.0] * (self.variables - self.nv))
        for name, span in self.forces.items():
            item = self.blocks[name].entry.item
            assert isinstance(item, Contact)
            out[span] = item.sizes(stack.robot)
        out[self.loop_forces] = force_sizes(stack.robot)[[0 if unit == "m" else 3 for _, unit in self.loop_rows]]
        return out

    def variable(self, number: int) -> tuple[str, str]:
        """Name and unit of a variable of the QP that is no degree of freedom: of a contact's wrench, or a share."""
        for name, span in self.forces.items():
            if span.start <= number < span.stop:
                item = self.blocks[name].entry.item
                assert isinstance(item, Contact)
                axis = item.axes[number - span.start]
                return f"{name}.{WRENCH[axis]}", "N" if axis < 3 else "N m"
        if self.loop_forces.start <= number < self.loop_forces.stop:
            label, unit = self.loop_rows[number - self.loop_forces.start]
            return label, "N" if unit == "m" else "N m"
        return f"variable {number}", ""


#: Components of a wrench
WRENCH = ("fx", "fy", "fz", "mx", "my", "mz")

#: Input of a contact or a load, 1 where it is enabled and 0 where it is not, so that it bears nothing
CLOSED = "closed"


def _gain(default: float) -> Input:
    return Input("gain", unit="1/s", default=default, low=0.0)


def _gains(gain: float) -> list[Input]:
    """Stiffness and damping of a stack of accelerations: critically damped, with the same time integral of the error
    from rest as exp(-gain t) has.
    """
    return [
        Input("stiffness", unit="1/s^2", default=4.0 * gain * gain, low=0.0),
        Input("damping", unit="1/s", default=4.0 * gain, low=0.0),
    ]


def _on_forces(item: Constraint, rows: tuple[Row, ...]) -> bool:
    """Whether rows are on forces, which have no rate, or there are none."""
    return (
        not rows or isinstance(item, (ContactWrench, WrenchSum)) or type(item).torque_rows is not Constraint.torque_rows
    )


def rate_unit(unit: str, command: str) -> str:
    """Unit of what a row of the QP bounds or asks for, where the row's own unit is that of an error or of a rate."""
    if unit in ("N", "N m"):
        return unit
    rate = unit if unit.endswith("/s") else f"{unit or '1'}/s"
    return rate if command == "velocity" else f"{rate}^2"
