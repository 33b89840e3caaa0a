"""Placements of all links for many postures at once, against the root link."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wbc.validation import Array
from wbc.walking.checker.urdf import Urdf


@dataclass(frozen=True, eq=False)
class Placements:
    """Rotations [s, 3, 3] and positions [s, 3] of links in the root link's frame, by name."""

    rotation: dict[str, Array]
    position: dict[str, Array]

    def point(self, link: str, local: Array) -> Array:
        """A point of a link, [s, 3]."""
        out: Array = self.position[link] + self.rotation[link] @ local
        return out


def forward(urdf: Urdf, joints: Sequence[str], q: Array) -> Placements:
    """T_child = T_parent T_origin Rot(axis, q), link by link.

    Args:
        joints: names of the columns of ``q``, [s, m] rad. Joints that are not among them stay at 0.
    """
    count, column = len(q), {name: k for k, name in enumerate(joints)}
    rotation = {urdf.root: np.broadcast_to(np.eye(3), (count, 3, 3))}
    position = {urdf.root: np.zeros((count, 3))}
    for joint in urdf.joints:
        parent = rotation[joint.parent]
        position[joint.child] = position[joint.parent] + parent @ joint.origin[:3, 3]
        # Turned such that the axis is z: then a turn mixes two columns
        to_z = _frame_about(joint.axis)
        placed = _times(parent, joint.origin[:3, :3] @ to_z)
        if joint.turns and joint.name in column:
            angle = q[:, column[joint.name], None]
            c, s = np.cos(angle), np.sin(angle)
            turned = placed.copy()
            turned[:, :, 0] = c * placed[:, :, 0] + s * placed[:, :, 1]
            turned[:, :, 1] = c * placed[:, :, 1] - s * placed[:, :, 0]
            placed = turned
        rotation[joint.child] = _times(placed, to_z.T)
    return Placements(rotation, position)


def _times(many: Array, one: Array) -> Array:
    out: Array = np.reshape(np.reshape(many, (-1, 3)) @ one, (-1, 3, 3))
    return out


def _frame_about(axis: Array) -> Array:
    """A rotation whose z column is ``axis``."""
    if axis[2] == 1.0:
        return np.eye(3)
    side = np.eye(3)[int(np.argmin(np.abs(axis)))]
    x = np.cross(side, axis)
    x = x / np.linalg.norm(x)
    return np.column_stack([x, np.cross(axis, x), axis])
