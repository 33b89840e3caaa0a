"""How fast a hand can swing along its way while the body moves: the least time under the limits of the first joints."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking.arm_kinematics import ArmKinematics
from wbc.walking.body_path import BodyPath
from wbc.walking.grips import Ints
from wbc.walking.swing_curve import Curves

#: Parts of joint rates and accelerations that a swing is planned with; the rest is for feedback
RATE_PART, ACCELERATION_PART = 0.88, 0.75
#: Fastest hand [m/s]: lifting and lowering are short
FASTEST = 1.2
#: Room of the wrist [m] within its reach, and about the axis of joint 1; and of joints 1 to 3 [rad]
REACH_ROOM, AXIS_ROOM, ANGLE_ROOM = 0.8 * 0.0254, 7.5 * 0.0254, 0.03
#: Derivatives smaller than this [rad] limit nothing
LEAST = 1e-6


@dataclass(frozen=True, eq=False)
class Speeds:
    """Laws of m swings over n points, evenly over x in [0, 1] of their curves.

    Attributes:
        possible: the wrist stays in reach and joints 1 to 3 within their limits ``[m]``.
        angles: of joints 1 to 3 ``[m, n, 3]`` [rad].
        rate: dx/dt ``[m, n]`` [1/s].
        time: from point to point ``[m, n - 1]`` [s].
    """

    possible: NDArray[np.bool_]
    angles: Array
    rate: Array
    time: Array

    @property
    def duration(self) -> Array:
        """Of each swing [s]."""
        out: Array = self.time.sum(axis=1)
        return out


def speeds(walker: Walker, arms: Ints, path: BodyPath, way: Curves, samples: Array) -> Speeds:
    """Least times along m curves, each for an arm of a body that is at fractional ``samples`` ``[m, n]`` of its path:

        |q_k' x'| <= part rate_k,     |q_k' x'' + q_k'' x'^2| <= part acceleration_k,     |p' x'| <= fastest

    for the joints k = 1 to 3 that place the wrist, by one pass forwards and one backwards over x'^2.
    """
    kinematics = ArmKinematics(walker.data)  # type: ignore[arg-type]
    points = samples.shape[1]
    x = np.linspace(0.0, 1.0, points)
    place, slope = way.at(x)
    angles, possible = _wrist_angles(kinematics, walker, arms, path.blended(samples), place, way.axes(x)[0])
    step = 1.0 / (points - 1)
    first = np.gradient(angles, axis=1) / step
    second = np.abs(np.gradient(first, axis=1) / step)
    first = np.maximum(np.abs(first), LEAST)
    rates = RATE_PART * np.array(kinematics.data.joint_rates)[:3]
    accelerations = ACCELERATION_PART * np.array(kinematics.data.joint_accelerations)[:3]
    top = (rates / first).min(axis=2) ** 2
    top = np.minimum(top, (accelerations / np.maximum(second, LEAST)).min(axis=2))
    square = np.minimum(top, (FASTEST / np.maximum(np.linalg.norm(slope, axis=2), LEAST)) ** 2)
    square[:, 0] = square[:, -1] = 0.0

    def push(i: int) -> Array:
        # Where the curvature alone takes the whole acceleration, x' must still be able to change a little
        left = (accelerations - second[:, i] * square[:, i, None]) / first[:, i]
        out: Array = np.maximum(left.min(axis=1), 0.05)
        return out

    for i in range(points - 1):
        square[:, i + 1] = np.minimum(square[:, i + 1], square[:, i] + 2 * step * push(i))
    for i in range(points - 1, 0, -1):
        square[:, i - 1] = np.minimum(square[:, i - 1], square[:, i] + 2 * step * push(i))
    rate = np.sqrt(square)
    return Speeds(possible, angles, rate, 2 * step / np.maximum(rate[:, 1:] + rate[:, :-1], 1e-6))


def _wrist_angles(
    kinematics: ArmKinematics, walker: Walker, arms: Ints, bodies: Array, place: Array, axis: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """Angles of joints 1 to 3 ``[m, n, 3]`` with the hand at ``place`` along ``axis``, and whether that is possible."""
    bases = np.array([arm.base.homogeneous for arm in walker.arms])[arms]
    frames = bodies @ bases[:, None]
    turn, origin = frames[..., :3, :3], frames[..., :3, 3]
    points = np.einsum("mnji,mnj->mni", turn, place - origin)
    axes = np.einsum("mnji,mnj->mni", turn, axis)
    axes /= np.linalg.norm(axes, axis=2, keepdims=True)
    wrists = kinematics.wrist_of(points, axes)
    flat, _ = kinematics.inverse_axis(points.reshape(-1, 3), axes.reshape(-1, 3), limits=False)
    angles = np.unwrap(flat[:, 0, :3].reshape(points.shape), axis=1)
    limits = np.array(kinematics.data.position_limits)[:3]
    possible = (kinematics.wrist_reach(wrists).min(axis=1) > REACH_ROOM) & (
        np.hypot(wrists[..., 0], wrists[..., 1]).min(axis=1) > AXIS_ROOM
    )
    return angles, possible & (np.abs(angles).max(axis=1) < limits - ANGLE_ROOM).all(axis=1)
