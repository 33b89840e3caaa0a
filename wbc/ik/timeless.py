"""A stack without time: its tick is a displacement, for inverse kinematics."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable

import numpy as np

from wbc import validation
from wbc.controller.compiled_stack import CompiledStack, core_of
from wbc.errors import LevelError, RangeError
from wbc.stack.artifact import compile_stack
from wbc.stack.declaration import Declaration
from wbc.tasks import Damping, JointLimits, Posture
from wbc.tasks._linkage_speed import LinkageSpeed
from wbc.tasks.base import Constraint
from wbc.validation import Array

#: Length of a tick [s], the longest that the stack allows: velocities are displacements
TICK = 1.0

#: What joints may move in a tick at most [rad, or characteristic lengths]; descents take shorter strides
LONGEST = 1.0

#: Goals outweigh secondary tasks by this once they are met, so that these cost them nothing
FIRST = 1e8


def timeless(stack: Declaration) -> Declaration:
    """The same items on joints that may move by :data:`LONGEST` a tick, without accelerations; always calm.

    Raises:
        LevelError: the stack has strict levels. RangeError: it has soft constraints or scaled tasks.
    """
    for entry in stack.entries:
        if entry.price is not None:
            reason = "inverse kinematics has no time, so no rate has a price or a scale; leave soft= and scaled= out"
            raise RangeError(f"stack.{entry.name}", entry.price, reason)
    levels = stack.levels
    if len(levels) > 1 or any(e.level > 0 and not e.is_task for e in stack.entries):
        reason = "inverse kinematics takes one level: goals come before secondary tasks there; name them with goals="
        raise LevelError("levels", levels, reason)
    scales = np.array([stack.length if u == "m" else 1.0 for u in stack.robot.dof_units])
    robot = stack.robot.with_limits(velocity=LONGEST / TICK * scales, acceleration=np.inf)
    # dt_range ends at twice the declared step
    out = Declaration(robot, 0.5 * TICK, damping=stack.damping, length=stack.length)
    for entry in stack.entries:
        item = entry.item
        if isinstance(item, LinkageSpeed):
            continue
        if isinstance(item, JointLimits):
            item = dataclasses.replace(item, velocity=True, acceleration=False, shortest_dt=None)
        if entry.name not in out:
            frame = entry.frame or None
            out.add(item, name=entry.name, level=entry.level, weight=entry.weight, relative_to=frame)
    return out


def searching(stack: Declaration, backend: str) -> CompiledStack:
    """The stack's controller, with inverse kinematics in its library; :meth:`Stack.compile` leaves that out.

    Raises:
        UnknownNameError, CompileError: as there.
    """
    from wbc import __version__

    return CompiledStack(stack, compile_stack(stack, backend, __version__, search=True), "daqp")


def hasten(controller: CompiledStack) -> None:
    """Errors and margins are corrected in one tick; limits of speed are off, which mean nothing without time."""
    for entry in controller.stack.entries:
        handle, item = controller[entry.name], entry.item
        for name in ("gain", "rate", "return_rate"):
            if name in handle.names:
                handle.set(**{name: 1.0 / TICK})
        block = core_of(controller).layout.blocks[entry.name]
        if isinstance(item, Constraint) and block.form == "rows" and not item.equality:
            handle.enabled = False


def chosen_goals(stack: Declaration, goals: Iterable[str] | None) -> tuple[str, ...]:
    """Names of the tasks to be met; by default those of the greatest weight, postures and damping left out.

    Raises:
        UnknownNameError: no such task. RangeError: none is left.
    """
    validation.instance("stack", stack, Declaration, "a wbc Stack")
    names = [entry.name for entry in stack.tasks]
    if goals is not None:
        chosen = tuple(dict.fromkeys((goals,) if isinstance(goals, str) else validation.strings("goals", goals)))
        for name in chosen:
            validation.one_of("goals", name, names)
    else:
        aims = [entry for entry in stack.tasks if not isinstance(entry.item, (Posture, Damping))]
        most = max((entry.weight for entry in aims), default=0.0)
        chosen = tuple(entry.name for entry in aims if entry.weight == most > 0.0)
    if not chosen:
        raise RangeError("goals", goals, "no task is to be met; name at least one", names)
    return chosen


def goal_rows(controller: CompiledStack, goals: Iterable[str]) -> Array:
    """1 for the task rows of goals, 0 for those of secondary tasks."""
    out = np.zeros(core_of(controller).layout.task_rows)
    for name in goals:
        out[core_of(controller).layout.blocks[name].span] = 1.0
    return out
