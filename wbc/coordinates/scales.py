"""What ties metres to radians in the rates of coordinates: the length of the arm that a row belongs to."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from wbc.coordinates import expressions
from wbc.coordinates.chains import carrying_joint, chains
from wbc.coordinates.rows import Coordinate
from wbc.robot import Robot
from wbc.validation import Array


def arm_lengths(robot: Robot) -> Array:
    """Length [m] of the arm that each joint belongs to, one number a joint of the model, ``universe`` first.

    The length of an arm (see :func:`chains`) is the sum of the distances between its joints, for a robot of one arm its
    characteristic length. Joints of an arm without length, such as a single one, have the robot's.
    """
    first, total = chains(robot), np.zeros(robot.model.njoints)
    for j, head in enumerate(first):
        if j != head:
            total[head] += np.linalg.norm(robot.model.jointPlacements[j].translation)
    own = total[list(first)]
    return np.where(own > 0.0, own, robot.characteristic_length)


def scales(robot: Robot, coordinates: Iterable[Coordinate], length: float | None = None) -> tuple[Array, Array]:
    """(D_r, D_c) as vectors: 1 / length of every row of the coordinates in metres, length of sliding joints, else 1.

    Args:
        length: one for all [m]; default: :func:`arm_lengths`, of the body whose row it is.
    """
    own = arm_lengths(robot) if length is None else np.full(robot.model.njoints, length)
    rows = [
        1.0 / own[carrying_joint(robot, one)] if row.unit == "m" else 1.0
        for one in coordinates
        for row in expressions.labels(robot, one)
    ]
    joints = np.repeat(np.arange(robot.model.njoints), list(robot.model.nvs))
    slides = np.array([unit == "m" for unit in robot.dof_units])
    return np.array(rows), np.where(slides, own[joints], 1.0)
