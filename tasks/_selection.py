"""Which joints or links a constraint is about."""

from __future__ import annotations

from typing import Any

from wbc import validation
from wbc.errors import DuplicateNameError, ShapeError
from wbc.robot import Robot
from wbc.tasks.base import Row


def selection(field: str, value: Any) -> tuple[str, ...]:
    """Names as a tuple, from one name or several.

    Raises:
        ShapeError: not names, or none.
        DuplicateNameError: a name given twice.
    """
    names = (value,) if isinstance(value, str) else validation.items(field, value, "names")
    if not names or not all(isinstance(name, str) for name in names):
        raise ShapeError(field, value, "expected one name or several")
    for k, name in enumerate(names):
        if name in names[:k]:
            raise DuplicateNameError(field, name, "named twice")
    return names


def joint_dofs(robot: Robot, field: str, joints: tuple[str, ...] | None) -> tuple[int, ...]:
    """Indices into v of the named joints, or of all joints for None.

    Raises:
        UnknownNameError: no such joint.
    """
    if joints is None:
        return tuple(range(robot.nv))
    out: list[int] = []
    for name in joints:
        place = robot.dofs(name, field)
        out += range(place.start, place.stop)
    return tuple(out)


def dof_rows(robot: Robot) -> tuple[Row, ...]:
    """One row a degree of freedom, for constraints that are simple bounds on v."""
    return tuple(Row(name, f"{unit}/s") for name, unit in zip(robot.dof_names, robot.dof_units, strict=True))
