"""Declared rows in floating point, by Pinocchio and not by the polynomials: what witnesses are checked with."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc.analysis.rows import BodyRows, JointRows, Rows
from wbc.errors import RangeError
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.symbolic.kinematics import WORLD, frame_index, joint_of
from wbc.validation import Array

#: Singular values below this part of the largest count as zero
RANK_TOLERANCE = 1e-9
#: Random configurations among which a task must have full rank
PLACES = 20


class NumericRows:
    """Jacobians of declarations at configurations of a robot [rows, nv]."""

    def __init__(self, robot: Robot) -> None:
        self.robot, self._data = robot, robot.model.createData()

    def value(self, rows: Sequence[Rows], q: Array) -> Array:
        """The rows at a configuration of the robot, open axes being the world's."""
        pin.computeJointJacobians(self.robot.model, self._data, q)
        pin.updateFramePlacements(self.robot.model, self._data)
        return np.vstack([self._rows(declared) for declared in rows])

    def _rows(self, declared: Rows) -> Array:
        if isinstance(declared, JointRows):
            return np.eye(self.robot.nv)[self.robot.dofs(declared.joint)]
        if isinstance(declared, BodyRows):
            carrier, moved = (self._placement(name) for name in (declared.base, declared.frame))
            below, above = (self._jacobian(name) for name in (declared.base, declared.frame))
            arm = moved.translation - carrier.translation
            linear = above[:3] - below[:3] + pin.skew(arm) @ below[3:]
            angular = above[3:] - below[3:]
            turn = self._placement(declared.expressed or WORLD).rotation.T
            return np.vstack(((turn @ linear)[list(declared.translation)], (turn @ angular)[list(declared.rotation)]))
        return self._pitch_plane(declared.shoulder, declared.wrist)

    def _pitch_plane(self, shoulder: str, wrist: str) -> Array:
        joint = joint_of(self.robot.model, shoulder)
        columns = pin.getJointJacobian(self.robot.model, self._data, joint, pin.WORLD)
        axis = columns[3:, int(self.robot.model.idx_vs[joint])]
        span = self._placement(wrist).translation - self._placement(shoulder).translation
        row: Array = (span - axis * (axis @ span)) @ self._jacobian(shoulder)[3:]
        return row[None]

    def _placement(self, name: str) -> pin.SE3:
        return pin.SE3.Identity() if name == WORLD else self._data.oMf[frame_index(self.robot.model, name)]

    def _jacobian(self, name: str) -> Array:
        if name == WORLD:
            return np.zeros((6, self.robot.nv))
        index = frame_index(self.robot.model, name)
        out: Array = pin.getFrameJacobian(self.robot.model, self._data, index, pin.LOCAL_WORLD_ALIGNED)
        return out


def check_task(robot: Robot, task: Sequence[Rows]) -> None:
    """That a task has full rank somewhere.

    Raises:
        RangeError: it loses rank at every configuration, so that nothing could be said of what completes it.
    """
    numeric, rng = NumericRows(robot), np.random.default_rng(0)
    ranks = []
    for _ in range(PLACES):
        q = pin.integrate(robot.model, robot.neutral, rng.uniform(-np.pi, np.pi, robot.nv))
        J = numeric.value(task, q)
        ranks.append(rank(J))
        if ranks[-1] == J.shape[0]:
            return
    names = ", ".join(map(str, task))
    raise RangeError("task", names, f"its {J.shape[0]} rows have rank {max(ranks)} at most, at every configuration")


def singular_values(matrix: Array) -> Array:
    """Largest first."""
    return np.asarray(np.linalg.svd(matrix, compute_uv=False), dtype=np.float64)


def rank(matrix: Array) -> int:
    """Singular values that are not zero to rounding."""
    sigma = singular_values(matrix)
    return int((sigma > RANK_TOLERANCE * sigma[0]).sum()) if sigma[0] > 0.0 else 0
