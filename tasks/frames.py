"""What tasks on frames share: axes by name, a point's error in chosen axes, a frame's pose at a configuration."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from wbc import validation
from wbc.errors import ShapeError
from wbc.multibody import algebra, pin
from wbc.robot import Robot
from wbc.symbolic import rotations as rot
from wbc.symbolic.kinematics import WORLD, frame_index
from wbc.symbolic.tracer import Tracer
from wbc.tasks.base import Row

#: Axes that turn with the task's own frame.
OWN = "frame"
#: Axes that the target is given in.
REFERENCE = "reference"


def resolve_axes(robot: Robot, field: str, axes: Any, frame: str | None, reference: str = WORLD) -> str:
    """The frame whose axes are meant: ``"frame"`` is the task's own, ``"reference"`` the target's, else a frame's name.

    Raises:
        UnknownNameError: none of these.
    """
    words = {REFERENCE: reference} if frame is None else {OWN: frame, REFERENCE: reference}
    if isinstance(axes, str) and axes in words:
        return words[axes]
    return validation.one_of(field, axes, (*words, *robot.frame_names))


def into_axes(kin: Tracer, vector: ca.SX, axes: str) -> ca.SX:
    """R_a' vector: the components along the axes of a frame of a vector given in world axes."""
    return vector if axes == WORLD else kin.rotation(axes).T @ vector


def point_in(kin: Tracer, frame: str, offset: tuple[float, float, float], reference: str) -> ca.SX:
    """R_b' (p + R offset - p_b): a point fixed in a frame (R, p), as seen from a reference frame b [m]."""
    own, base = kin.pose(frame), kin.pose(reference)
    point = own.point(rot.constant(offset)) if any(offset) else own.position
    return point if reference == WORLD else base.inverse_point(point)


def frame_pose(robot: Robot, frame: str, q: NDArray[np.float64]) -> pin.SE3:
    """Pose of a named frame in the world at a configuration."""
    tree = robot.tree
    library = algebra(tree)
    if frame == WORLD:
        return library.SE3.Identity()
    data = tree.createData()
    library.forwardKinematics(tree, data, q)
    return library.updateFramePlacement(tree, data, frame_index(tree, frame)).copy()


def point_rows() -> tuple[Row, ...]:
    """Rows x, y, z in metres."""
    return tuple(Row(label, "m") for label in "xyz")


def checked_weights(field: str, weights: Any, count: int | None = None) -> tuple[float, ...] | None:
    """Weights >= 0, one a row, as a tuple; None stays None (all 1).

    Raises:
        ShapeError: not one number a row. NotFiniteError, RangeError: NaN, infinite or negative.
    """
    if weights is None:
        return None
    array = validation.real_array(field, weights)
    if array.ndim != 1 or (count is not None and array.shape != (count,)):
        raise ShapeError(field, weights, f"expected {'one number a row' if count is None else f'{count} numbers'}")
    return tuple(validation.scalar(f"{field}[{i}]", w, low=0.0) for i, w in enumerate(array))
