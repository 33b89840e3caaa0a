"""Joint rates of the walker's arm in closed form: the wrist's velocity first, the rotation that is left after."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wbc.robots import WalkerData
from wbc.validation import Array
from wbc.walking.arms.angles import ALIGNED, frame3, sines

#: \|sin theta5\| below which the published treatment of the wrist's singularity takes over
SINGULAR = 1e-2


def joint_rates(data: WalkerData, q: Array, twists: Array) -> tuple[Array, NDArray[np.bool_]]:
    """See :meth:`wbc.walking.ArmKinematics.rates`; arrays are checked already."""
    angles, twist = np.broadcast_arrays(q, twists)
    turned = frame3(angles)
    es, we = data.upper_arm_length, data.forearm_length
    s4, c4, s5, c5 = sines(angles[..., 3]) + sines(angles[..., 4])
    axis = np.einsum("...ij,...j->...i", turned, np.stack([c4 * s5, s4 * s5, c5], axis=-1))
    linear, angular = twist[..., :3], twist[..., 3:]
    wrist_velocity = linear + data.hand_length * np.cross(axis, angular)
    (s1, c1), (s2, c2) = sines(angles[..., 0]), sines(angles[..., 1])
    s23, c23 = sines(angles[..., 1] + angles[..., 2])
    forward = c1 * wrist_velocity[..., 0] + s1 * wrist_velocity[..., 1]
    sideways = c1 * wrist_velocity[..., 1] - s1 * wrist_velocity[..., 0]
    reach = s2 * es + s23 * we
    open_reach, open_elbow = np.abs(reach) > ALIGNED, np.abs(np.sin(angles[..., 2])) > ALIGNED
    first = sideways / np.where(open_reach, reach, np.inf)
    # In the plane of the upper arm: (r, z) moves by (c2, -s2) ES rate2 + (c23, -s23) WE (rate2 + rate3)
    along = forward + data.shoulder_offset * first
    upward = wrist_velocity[..., 2]
    determinant = np.where(open_elbow, es * we * np.sin(angles[..., 2]), np.inf)
    second = we * (along * s23 + upward * c23) / determinant
    both = -es * (along * s2 + upward * c2) / determinant
    third = both - second
    left = angular - np.stack([-s1 * both, c1 * both, first], axis=-1)
    w = np.einsum("...ji,...j->...i", turned, left)
    regular = np.abs(s5) >= SINGULAR
    sixth = np.where(regular, (c4 * w[..., 0] + s4 * w[..., 1]) / np.where(regular, s5, 1.0), w[..., 2])
    fourth = np.where(regular, w[..., 2] - c5 * sixth, 0.0)
    fifth = c4 * w[..., 1] - s4 * w[..., 0]
    return np.stack([first, second, third, fourth, fifth, sixth], axis=-1), regular & open_reach & open_elbow
