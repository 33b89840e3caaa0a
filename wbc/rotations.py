"""Rotation vectors, matrices and unit quaternions, as numbers."""

from __future__ import annotations

from typing import Any

import numpy as np

from wbc.multibody import pin
from wbc.validation import Array

#: Entries of a quaternion x, y, z, w, which is Pinocchio's order, in MuJoCo's and viser's, which is w, x, y, z
TO_MUJOCO = [3, 0, 1, 2]
#: Entries of a quaternion w, x, y, z in the order x, y, z, w
TO_PINOCCHIO = [1, 2, 3, 0]
#: Signs of the entries x, y, z, w of a conjugate quaternion
CONJUGATE = np.array([-1.0, -1.0, -1.0, 1.0])


def exponential(turns: Array) -> Array:
    """Rotation matrices of rotation vectors, m x 3 [rad]: 1 + sin(t) K + (1 - cos(t)) K^2, by Rodrigues."""
    angles = np.sqrt(np.vecdot(turns, turns))
    axes = turns / np.where(angles > 0.0, angles, 1.0)[:, None]
    x, y, z = axes.T
    cross = np.zeros((len(turns), 3, 3))
    cross[:, 0, 1], cross[:, 0, 2], cross[:, 1, 2] = -z, y, -x
    cross[:, 1, 0], cross[:, 2, 0], cross[:, 2, 1] = z, -y, x
    sines, halves = np.sin(angles)[:, None, None], np.sin(0.5 * angles)[:, None, None]
    out: Array = np.eye(3) + sines * cross + 2.0 * halves**2 * (cross @ cross)
    return out


def matrices(quaternions: Array) -> Array:
    """Rotation matrices [..., 3, 3] of unit quaternions x, y, z, w, [..., 4]."""
    x, y, z, w = np.moveaxis(quaternions, -1, 0)
    rows = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def quaternion_product(p: Any, q: Any) -> list[Any]:
    """Entries of the product p q of quaternions x, y, z, w, whose entries are numbers, arrays or expressions."""
    (x, y, z, w), (a, b, c, d) = p, q
    return [
        w * a + x * d + y * c - z * b,
        w * b + y * d + z * a - x * c,
        w * c + z * d + x * b - y * a,
        w * d - x * a - y * b - z * c,
    ]


def relative_quaternion(left: Array, right: Array) -> Array:
    """left times the conjugate of right, quaternions x, y, z, w [..., 4]."""
    return np.stack(quaternion_product(left.T, (right * CONJUGATE).T), axis=-1)


def continuous_quaternions(quaternions: Array) -> Array:
    """The same rotations [m, 4], each with the sign that is nearer to the one before."""
    flips = np.where(np.sum(quaternions[1:] * quaternions[:-1], axis=1) < 0.0, -1.0, 1.0)
    return np.asarray(quaternions * np.concatenate([[1.0], np.cumprod(flips)])[:, None])


def quaternion(rotation: Any) -> Array:
    """Unit quaternion x, y, z, w of a rotation matrix that may be off by rounding."""
    # Not pin.Quaternion(rotation), whose 80 bytes pin 4.1 never frees
    q = np.asarray(pin.SE3ToXYZQUAT(pin.SE3(np.asarray(rotation), np.zeros(3)))[3:], dtype=np.float64)
    return np.asarray(q / np.linalg.norm(q))
