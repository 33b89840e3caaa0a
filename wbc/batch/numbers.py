"""Values of many robots, checked together, as the numbers of the buffer."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import ShapeError
from wbc.multibody import is_pose
from wbc.robot import Robot
from wbc.tasks import inputs
from wbc.tasks.base import Input
from wbc.validation import ROTATION_TOLERANCE, Array


def taken(value: Any) -> Any:
    """An array of another library through DLPack, without a copy where that can be; anything else as it is."""
    if not isinstance(value, np.ndarray) and hasattr(value, "__dlpack__"):
        return np.from_dlpack(value)
    return value


def rows(field: str, value: Any, count: int, width: int) -> Array:
    """Numbers of each robot [count, width], or one row for all.

    Raises:
        ShapeError, NotFiniteError: the field names the row.
    """
    numbers = validation.real_array(field, taken(value), finite=False)
    if numbers.shape not in ((width,), (count, width)):
        raise ShapeError(field, value, f"expected shape ({width},) or ({count}, {width}), is {numbers.shape}")
    if not np.isfinite(numbers).all():
        each = numbers.reshape(-1, width)
        _refuse_first(
            np.atleast_1d(~np.isfinite(each).all(axis=1)), lambda k: validation.real_array(f"{field}[{k}]", each[k])
        )
    return np.broadcast_to(numbers, (count, width))


def configurations(robot: Robot, value: Any, count: int, units: list[tuple[int, int]]) -> Array:
    """Configurations [count, nq], or one for all.

    Args:
        units: first place and size of what has unit length in q.

    Raises:
        ShapeError, NotFiniteError, RotationError: the field names the robot.
    """
    q = rows("q", value, count, robot.nq)
    for start, size in units:
        wrong = np.abs((q[:, start : start + size] ** 2).sum(axis=1) - 1.0) > 2.0 * ROTATION_TOLERANCE
        _refuse_first(wrong, lambda k: robot.configuration(f"q[{k}]", q[k]))
    return q


def flat(robot: Robot, field: str, declared: Input, value: Any, count: int, single: Callable[[Any], Array]) -> Array:
    """Values of an input as numbers of the buffer, [count, size].

    Args:
        value: one for all, or one for each robot: an array with an axis of robots before, or a sequence.
        single: checks one value as :class:`Handle` does.

    Raises:
        WbcError: as of one value; the field names the robot.
    """
    value, size = taken(value), inputs.size(robot, declared)
    if declared.kind == "pose":
        return _poses(robot, field, declared, value, count)
    if declared.each and validation.dimensions(field, value) == ():
        return np.broadcast_to(single(value), (count, size))
    if inputs.is_plain(declared):
        return rows(field, value, count, size)
    given = validation.real_array(field, value, finite=False)
    own = {"rotation": 2, "configuration": 1, "tangent": 1}.get(declared.kind, 1 if declared.size else 0)
    if given.ndim == own:
        return np.broadcast_to(single(value), (count, size))
    if given.ndim != own + 1 or len(given) != count:
        raise ShapeError(field, value, f"expected one value, or an array of {count}; is of shape {given.shape}")
    out = np.empty((count, size))
    for k in range(count):
        out[k] = inputs.flat(robot, f"{field}[{k}]", declared, given[k])
        single(given[k])
    return out


def _poses(robot: Robot, field: str, declared: Input, value: Any, count: int) -> Array:
    """Poses as 12 numbers: a rotation by columns, then a position."""
    if not (isinstance(value, np.ndarray) and value.shape == (count, 4, 4)):
        pairs = isinstance(value, tuple) and len(value) == 2
        one = {"position": (3,), "orientation": (3, 3)}.get(declared.part, (4, 4))
        single = is_pose(value) or pairs or not hasattr(value, "__len__")
        if single or _shape(value) in ((4, 4), one):
            return np.broadcast_to(inputs.flat(robot, field, declared, value), (count, 12))
        if len(value) != count:
            raise ShapeError(field, value, f"expected one pose, or {count}; there are {len(value)}")
        return np.stack([inputs.flat(robot, f"{field}[{k}]", declared, pose) for k, pose in enumerate(value)])
    matrices = validation.real_array(field, value, finite=False)
    with np.errstate(invalid="ignore", over="ignore"):
        R = matrices[:, :3, :3]
        off = np.linalg.norm(R.transpose(0, 2, 1) @ R - np.eye(3), axis=(1, 2))
        fine = (off <= ROTATION_TOLERANCE) & (np.linalg.det(R) > 0.0) & np.isfinite(matrices).all(axis=(1, 2))
    fine &= (matrices[:, 3] == (0.0, 0.0, 0.0, 1.0)).all(axis=1)
    _refuse_first(~fine, lambda k: validation.pose_numbers(f"{field}[{k}]", matrices[k]))
    # Columns of the rotation, then the position
    return np.ascontiguousarray(matrices[:, :3].transpose(0, 2, 1)).reshape(count, 12)


def _shape(value: Any) -> tuple[int, ...]:
    """Shape of an array of numbers; () of poses that are no arrays, or are not written alike."""
    try:
        array = np.asarray(value)
    except ValueError:
        return ()
    return () if array.dtype == object else array.shape


def _refuse_first(wrong: np.ndarray, single: Callable[[int], object]) -> None:
    """Let the check of a single value say what is wrong with the first bad one."""
    for k in np.flatnonzero(wrong).tolist():
        single(k)
