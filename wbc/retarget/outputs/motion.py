"""A robot's motion as writers see it: its root and its joints by name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from wbc import validation
from wbc.multibody import pin
from wbc.rotations import quaternion
from wbc.validation import Array

if TYPE_CHECKING:
    from wbc.retarget.retargeted import Retargeted

#: Columns of a root in a table
ROOT = ("root.x", "root.y", "root.z", "root.qx", "root.qy", "root.qz", "root.qw")


@dataclass(frozen=True)
class JointColumns:
    """A motion in numbers that need no model.

    Attributes:
        root_position: of the base in the world [frames, 3] [m].
        root_quaternion: x, y, z, w [frames, 4].
        names: of the joints' degrees of freedom, in the robot's order.
        positions: of them [frames, joints] [rad, m]; a joint that turns without end by its angle, a ball joint by its
            rotation vector.
    """

    root_position: Array
    root_quaternion: Array
    names: tuple[str, ...]
    positions: Array

    @property
    def table(self) -> Array:
        """Root and joints side by side [frames, 7 + joints]."""
        return np.column_stack((self.root_position, self.root_quaternion, self.positions))

    @classmethod
    def of(cls, motion: Retargeted) -> JointColumns:
        """Those of a motion."""
        robot, q = motion.robot, validation.ordinary_array("motion.q", motion.q)
        model, first = robot.model, 1 if robot.base == "fixed" else 2
        root_position, root_quaternion = np.zeros((len(q), 3)), np.tile([0.0, 0.0, 0.0, 1.0], (len(q), 1))
        if robot.base == "floating":
            root_position, root_quaternion = q[:, :3].copy(), q[:, 3:7].copy()
        elif first == 2:
            data = model.createData()
            for frame, row in enumerate(q):
                pin.forwardKinematics(model, data, row)
                root_position[frame] = data.oMi[1].translation
                root_quaternion[frame] = quaternion(data.oMi[1].rotation)
        columns = []
        for joint in range(first, model.njoints):
            start, nq, nv = int(model.idx_qs[joint]), int(model.nqs[joint]), int(model.nvs[joint])
            own = q[:, start : start + nq]
            if nq == nv:
                columns.append(own)
            elif (nq, nv) == (2, 1):
                columns.append(np.unwrap(np.arctan2(own[:, 1], own[:, 0]))[:, None])
            else:
                steps = [pin.difference(model, robot.neutral, row) for row in q]
                columns.append(np.array(steps)[:, int(model.idx_vs[joint]) : int(model.idx_vs[joint]) + nv])
        names = robot.dof_names[int(model.idx_vs[first]) if first < model.njoints else robot.nv :]
        positions = np.concatenate(columns, axis=1) if columns else np.zeros((len(q), 0))
        return cls(root_position, root_quaternion, names, positions)

    def in_order(self, joints: Sequence[str]) -> JointColumns:
        """The same with joints in another order, or fewer.

        Raises:
            UnknownNameError: no such joint.
        """
        numbers = [self.names.index(validation.one_of("joints", name, self.names)) for name in joints]
        names = tuple(self.names[k] for k in numbers)
        return JointColumns(self.root_position, self.root_quaternion, names, self.positions[:, numbers])
