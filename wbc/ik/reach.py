"""Poses that no configuration reaches, proven by the lengths between a chain's axes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from wbc.multibody import pin
from wbc.robot import Robot
from wbc.stack.declaration import Entry
from wbc.symbolic.kinematics import WORLD, frame_index
from wbc.tasks import EndEffector
from wbc.validation import Array

#: Passes in which points move along their axes
PASSES = 30
#: How far rounding may carry a distance [m]
ROUNDING = 1e-9


def beyond_reach(robot: Robot, entry: Entry, tolerance: float) -> Callable[[Array], np.ndarray] | None:
    """What says of poses [n, 12] (a rotation by columns, a position), as of the entry's target, which are proven out of
    reach of a chain of hinges on a fixed base; None: nothing can be proven.

    A point P_k on the axis of each hinge k is fixed in the links on both its sides, so the distances of successive ones
    stay, P_1 stays in the world and P_n in the frame. At every configuration

        |P_1 - P_n| <= sum_k |P_k - P_{k+1}|

    whichever points are taken; those here make the sum small.

    Args:
        tolerance: of every row of the goal, in metres and radians.
    """
    item = entry.item
    if not isinstance(item, EndEffector) or item.kind != "pose" or item.weights not in (None, (1.0,) * 6):
        return None
    if item.relative_to != WORLD or entry.frame or robot.base_nv:
        return None
    model = robot.model
    frame = model.frames[frame_index(model, item.frame)]
    chain = [joint for joint in model.supports[frame.parentJoint] if joint > 0]
    hinges = all(model.nvs[j] == 1 and "R" in model.joints[j].shortname() for j in chain)
    if not chain or not hinges:
        return None
    data = model.createData()
    J = pin.computeJointJacobians(model, data, robot.neutral)
    columns = [int(model.idx_vs[j]) for j in chain]
    if any(abs(np.linalg.norm(J[3:, k]) - 1.0) > ROUNDING for k in columns):
        return None
    axes = J[3:, columns].T
    points = np.array([data.oMi[j].translation for j in chain])
    for _ in range(PASSES):
        for k, axis in enumerate(axes):
            near = points[[i for i in (k - 1, k + 1) if 0 <= i < len(points)]]
            if not len(near):
                continue
            along = (near - points[k]) @ axis
            off = np.linalg.norm(near - points[k] - np.outer(along, axis), axis=1)
            # The shortest way from one neighbour over the axis to the other, unfolded into a plane
            share = off[::-1] / off.sum() if len(near) == 2 and off.sum() > 0.0 else np.full(len(near), 1.0 / len(near))
            points[k] += (share @ along) * axis
    longest = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    placement = data.oMi[frame.parentJoint] * frame.placement
    last = placement.actInv(points[-1])
    # An error of each row by the tolerance moves the point by so much at most
    longest += np.sqrt(3.0) * tolerance * (1.0 + float(np.linalg.norm(last))) + ROUNDING

    def beyond(poses: Array) -> np.ndarray:
        ends = np.einsum("nij,i->nj", poses[:, :9].reshape(-1, 3, 3), last) + poses[:, 9:]
        return np.asarray(np.linalg.norm(ends - points[0], axis=1) > longest)

    return beyond
