"""Configurations drawn from a robot's joint range, and where they put its bodies."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from wbc.multibody import algebra, pin
from wbc.validation import Array

if TYPE_CHECKING:
    from wbc.robot.robot import Robot


def joint_range(robot: Robot) -> tuple[Array, Array]:
    """(lower, upper) [nv]: the span that each degree of freedom is drawn from, counted from ``robot.neutral``.

    The position limits; an unlimited angle covers a turn, an unlimited length twice the robot's characteristic
    length. The base stays where it is: it moves all links alike.
    """
    free = np.array([np.pi if unit == "rad" else robot.characteristic_length for unit in robot.dof_units])
    where = robot.position_index
    here = np.where(where >= 0, robot.neutral[where], 0.0)
    lower = np.where(np.isfinite(robot.limits.position_lower), robot.limits.position_lower - here, -free)
    upper = np.where(np.isfinite(robot.limits.position_upper), robot.limits.position_upper - here, free)
    lower[: robot.base_nv] = upper[: robot.base_nv] = 0.0
    return lower, upper


def configuration(robot: Robot, step: Array) -> Array:
    """The configuration a ``step`` [nv] away from the neutral one, followers of mimic joints where they belong."""
    return _within(robot, np.array(pin.integrate(robot.model, robot.neutral, step)))


def _within(robot: Robot, q: Array) -> Array:
    for coupling in robot.couplings:
        follower, leader = (int(robot.position_index[k]) for k in (coupling.follower, coupling.leader))
        limits = robot.limits
        value = coupling.ratio * q[leader] + coupling.offset
        low, high = limits.position_lower[coupling.follower], limits.position_upper[coupling.follower]
        q[follower] = min(max(value, low), high)
    return q


def draw(robot: Robot, count: int, rng: np.random.Generator) -> Array:
    """``count`` steps away from the neutral configuration [count x nv], uniform in :func:`joint_range`."""
    lower, upper = joint_range(robot)
    return rng.uniform(lower, upper, size=(count, robot.nv))


def joint_poses(robot: Robot, steps: Array, joints: list[int]) -> tuple[Array, Array]:
    """(rotations [n x joints x 3 x 3], positions [n x joints x 3]) of some joints at each step from neutral."""
    # For the neutral configuration alone Pinocchio is not imported
    still = not np.any(steps)
    model = robot.tree if still else robot.model
    library, data = algebra(model), model.createData()
    poses = [data.oMi[joint] for joint in joints]  # references: looking them up costs more than the kinematics
    out = np.empty((len(steps), len(joints), 4, 4))
    for n, step in enumerate(steps):
        q = _within(robot, robot.neutral.copy()) if still else configuration(robot, step)
        library.forwardKinematics(model, data, q)
        for k, pose in enumerate(poses):
            out[n, k] = pose.homogeneous
    return out[:, :, :3, :3], out[:, :, :3, 3]
