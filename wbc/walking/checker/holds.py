"""The holds of a log as arrays, and how far hands are off them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wbc.validation import Array
from wbc.walking.log.log import WalkLog


def rotations(quaternions: Array) -> Array:
    """Matrices [..., 3, 3] of quaternions (x, y, z, w), [..., 4], scaled to unit length."""
    x, y, z, w = np.moveaxis(quaternions / np.linalg.norm(quaternions, axis=-1, keepdims=True), -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def angles_between(a: Array, b: Array) -> Array:
    """Angle [rad] between unit vectors [..., 3]: atan2(|a x b|, a.b)."""
    return np.asarray(np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), (a * b).sum(axis=-1)))


def turns_between(a: Array, b: Array) -> Array:
    """Angle [rad] of the rotation from a to b, [..., 3, 3]."""
    turn = np.swapaxes(a, -1, -2) @ b
    skew = np.stack([turn[..., 2, 1] - turn[..., 1, 2], turn[..., 0, 2] - turn[..., 2, 0]], axis=-1)
    skew = np.concatenate([skew, (turn[..., 1, 0] - turn[..., 0, 1])[..., None]], axis=-1)
    trace = np.trace(turn, axis1=-2, axis2=-1)
    return np.asarray(np.arctan2(np.linalg.norm(skew, axis=-1), trace - 1.0))


@dataclass(frozen=True, eq=False)
class HoldTable:
    """Positions [h, 3], rotations [h, 3, 3], roll (0 free, 1 fixed, n n-fold) and max_tilt of the holds of a log."""

    position: Array
    rotation: Array
    roll: NDArray[np.int64]
    max_tilt: Array

    @classmethod
    def of(cls, log: WalkLog) -> HoldTable:
        """The table of a log."""
        return cls(log.hold_pose[:, :3], rotations(log.hold_pose[:, 3:]), log.hold_roll, log.hold_max_tilt)

    def offsets(self, hold: NDArray[np.int64], position: Array, rotation: Array) -> tuple[Array, Array, Array]:
        """How far hands are off the holds of rows ``hold`` [...], at ``position`` [..., 3], ``rotation`` [..., 3, 3].

        Returns:
            Distance [m], angle between the z axes beyond max_tilt (0 within) and angle off the nearest roll that is
            allowed (0 where any is) [rad], [...] each.
        """
        frames = self.rotation[hold]
        distance = np.linalg.norm(position - self.position[hold], axis=-1)
        tilt = np.maximum(angles_between(frames[..., 2], rotation[..., 2]) - self.max_tilt[hold], 0.0)
        roll, off = self._roll(hold, frames, rotation)
        return distance, tilt, np.where(self.roll[hold] > 0, np.abs(roll - off), 0.0)

    def references(self, hold: NDArray[np.int64], rotation: Array) -> Array:
        """The x axes [..., 3] that hands should have: the nearest roll that is allowed; meaningless where any is."""
        frames = self.rotation[hold]
        _, allowed = self._roll(hold, frames, rotation)
        return np.asarray(
            np.cos(allowed)[..., None] * frames[..., :, 0] + np.sin(allowed)[..., None] * frames[..., :, 1]
        )

    def _roll(self, hold: NDArray[np.int64], frames: Array, rotation: Array) -> tuple[Array, Array]:
        """(roll of hands about the holds' z axes, the nearest that is allowed) [rad]."""
        x = rotation[..., :, 0]
        roll = np.arctan2((x * frames[..., :, 1]).sum(axis=-1), (x * frames[..., :, 0]).sum(axis=-1))
        step = 2 * np.pi / np.maximum(self.roll[hold], 1)
        return roll, step * np.round(roll / step)
