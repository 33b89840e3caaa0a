"""What a path may end at: configurations, and targets of tasks, of which every branch is a goal."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from wbc import validation
from wbc.controller.core import Core
from wbc.errors import RangeError, ShapeError
from wbc.stack.layout import Slot
from wbc.validation import Array


@dataclass(frozen=True, eq=False)
class TargetGoal:
    """Tasks that are to be met: their names, and the numbers of their targets."""

    names: tuple[str, ...]
    numbers: tuple[tuple[Slot, Array], ...]


#: A configuration [nq], or tasks that are to be met
Goal = Array | TargetGoal


def goals_of(core: Core, goal: Any) -> tuple[Goal, ...]:
    """Goals as users write them: a configuration, a mapping from tasks to targets, or several of these.

    Raises:
        UnknownNameError, ShapeError, NotFiniteError, RotationError, RangeError: it is none of them.
    """
    if isinstance(goal, (list, tuple, set, frozenset)) and not _is_configuration(goal):
        if not goal:
            raise RangeError("goal", goal, "expected at least one goal")
        return tuple(g for k, one in enumerate(goal) for g in _goals_within(core, f"goal[{k}]", one))
    return _goals_within(core, "goal", goal)


def _goals_within(core: Core, name: str, goal: Any) -> tuple[Goal, ...]:
    robot = core.stack.robot
    if isinstance(goal, Mapping):
        return (_target(core, name, goal),)
    rows = np.asarray(validation.real_array(name, goal))
    if rows.ndim == 2:
        return tuple(robot.configuration(f"{name}[{k}]", row) for k, row in enumerate(rows))
    return (robot.configuration(name, rows),)


def _is_configuration(goal: Any) -> bool:
    return bool(goal) and all(isinstance(number, (int, float, np.floating, np.integer)) for number in goal)


def _target(core: Core, name: str, goal: Mapping[Any, Any]) -> TargetGoal:
    if not goal:
        raise RangeError(name, goal, "expected at least one task and its target")
    tasks = [entry.name for entry in core.stack.tasks]
    numbers = []
    for task, target in goal.items():
        validation.one_of(name, task, tasks)
        handle = core.handles[task]
        if "target" not in handle.names:
            raise ShapeError(f"{name}[{task!r}]", target, "this task has no target")
        numbers.append((handle.slot("target"), handle.checked("target", target)))
    return TargetGoal(tuple(goal), tuple(numbers))
