"""A swing as angles of joints 1 to 6: the hand on its curve, the wrist between its two postures."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from wbc.validation import Array
from wbc.walking.arms.angles import sines, wrapped
from wbc.walking.arms.puma import ArmKinematics
from wbc.walking.planner.grips.rolls import ANY
from wbc.walking.planner.grips.table import Grips, Ints

#: Room of the wrist within its reach [m], and of joints 1 to 5 within their limits [rad]
REACH_ROOM, ANGLE_ROOM = 0.3 * 0.0254, 0.02
#: The elbow of a swinging arm stays this far from its limit [rad]: a straight arm cannot follow what its body does
ELBOW_ROOM = 0.2
#: The wrist stays this far from the axis of joint 1, besides the shoulder's offset [m]
AXIS_ROOM = 0.08

#: Angles of joints 4 and 5, and 6 where the roll counts, ``[m, n, 2 or 3]`` at fractional samples ``[m, n]``
Wrists = Callable[[Array], Array]


def blend(x: Array) -> Array:
    """Part of the wrist's way at ``x`` in [0, 1] of the hand's: x^2 (3 - 2x)."""
    out: Array = x * x * (3.0 - 2.0 * x)
    return out


def grip_wrists(
    grips: Grips, source: Ints, target: Ints, points: int, parts: tuple[float, float] = (0.0, 1.0)
) -> Wrists:
    """Wrists that leave grips and come to others, from part to part of their way; both change as the body moves on."""
    part = (parts[0] + (parts[1] - parts[0]) * blend(np.linspace(0.0, 1.0, points)))[None, :, None]
    end = wrist_end(grips, source, target)

    def wrists(samples: Array) -> Array:
        first, last = (grips.between(g[:, None], samples)[..., 3:end] for g in (source, target))
        out: Array = first + part * (last - first)
        return out

    return wrists


def wrist_end(grips: Grips, source: Ints, target: Ints) -> int:
    """Joints before this one count: 5, and 6 where some hold fixes the roll."""
    return 5 if (grips.roll[source] == ANY).all() and (grips.roll[target] == ANY).all() else 6


def joint_paths(
    kinematics: ArmKinematics, frames: Array, place: Array, wrists: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """Joints 1 to 5 or 6 ``[m, n, 5 or 6]`` [rad] with hands at ``place`` ``[m, n, 3]`` and wrists bent by ``wrists``.

    Forearm and hand are one link from the elbow to the hand: A = WE + HW c5 along the forearm, B = HW c4 s5 across it
    in the arm's plane, and HW s4 s5 out of the plane. So theta3 + atan2(B, A) is the angle at the elbow of an arm with
    the lengths ES and hypot(A, B).

    Args:
        frames: of the arms' bases ``[m, n, 4, 4]``, affine.

    Returns:
        (angles, possible): whether the whole swing is within reach and limits, ``[m]``.
    """
    data = kinematics.data
    turn, origin = frames[..., :3, :3], frames[..., :3, 3]
    points = np.einsum("mnji,mnj->mni", turn, place - origin)
    (s4, c4), (s5, c5) = sines(wrists[..., 0]), sines(wrists[..., 1])
    hand = data.hand_length
    along, across, out = data.forearm_length + hand * c5, hand * c4 * s5, data.shoulder_offset + hand * s4 * s5
    es, reach, tilt = data.upper_arm_length, np.hypot(along, across), np.arctan2(across, along)
    x, y, z = points[..., 0], points[..., 1], points[..., 2] - data.neck_length
    square = x * x + y * y - out * out
    r = np.sqrt(np.maximum(square, AXIS_ROOM**2))
    distance = np.hypot(r, z)
    bend = np.arccos(np.clip((distance**2 - es * es - reach * reach) / (2 * es * reach), -1.0, 1.0))
    angles = np.empty((*r.shape, 3 + wrists.shape[2]))
    angles[..., 0] = np.unwrap(np.arctan2(y, x) - np.arctan2(out, r), axis=1)
    angles[..., 0] += wrapped(angles[:, :1, 0]) - angles[:, :1, 0]
    angles[..., 1] = np.arctan2(r, z) + np.arctan2(reach * np.sin(bend), es + reach * np.cos(bend))
    angles[..., 2] = -bend - tilt
    angles[..., 3:] = wrists
    room = np.array(data.position_limits)[: angles.shape[2]] - np.abs(angles)
    lean = angles[..., 1] + angles[..., 2] / 2 - data.shoulder_limit
    elbow = data.elbow_limit - angles[..., 2]
    possible = (square.min(axis=1) > AXIS_ROOM**2) & ((es + reach - distance).min(axis=1) > REACH_ROOM)
    # Limits of the published robot at the ends are kept as close as holding grips keep them
    possible &= (
        (room.min(axis=(1, 2)) > ANGLE_ROOM) & (lean.min(axis=1) > ANGLE_ROOM) & (elbow.min(axis=1) > ELBOW_ROOM)
    )
    return angles, possible
