"""The two-ended arm in closed form, with the first roll joint as the parameter of its redundancy.

Everything is the pose of the far hand in the frame of the near hand, in SI; arrays hold any number of postures, whose
columns are the joints 1 to 7 from the near hand. With joint 1 given, the pitch axis p = (sin t2, -cos t2, 0) in frame 1
is across the yaw axis of joint 6, so the offsets along it fix joint 2: (O6 - O2) p = d3 + d4 + d5. The axis of joint 6
is across p and the approach direction, which leaves two booms in a plane.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from math import pi
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from wbc import validation
from wbc.errors import ShapeError
from wbc.robots import TwoEndedData
from wbc.validation import Array
from wbc.walking.arms.angles import sines, vectors, wrapped

Flags = NDArray[np.bool_]

#: Coordinates at the angles of the link matrices' theta: joints 1, 2, 5 and 6 are a quarter turn ahead or behind
OFFSETS = np.array([pi / 2, pi / 2, 0.0, 0.0, pi / 2, -pi / 2, 0.0])
#: Twists of the link matrices: Rx(+90), Rx(+90), 1, 1, Rx(+90), Rx(-90), 1
TWISTS = (1, 1, 0, 0, 1, -1, 0)
#: An approach direction closer to the pitch axis than this [rad] leaves the last three joints undetermined
LEAST_ANGLE = 1e-9


@dataclass(frozen=True)
class TwoEndedKinematics:
    """Closed-form kinematics of the two-ended arm from hand to hand, a :class:`wbc.robots.Limb` on the near hand.

    Attributes:
        data: lengths [m], limit and rate; default: those of the file.
    """

    data: TwoEndedData = field(default_factory=TwoEndedData.read)

    #: Of the capsules of near tip, first boom, second boom and far tip
    links: ClassVar[tuple[tuple[int, int], ...]] = ((0, 1), (2, 3), (4, 5), (6, 7))
    limit_names: ClassVar[tuple[str, ...]] = tuple(f"joint {k} limit" for k in range(1, 8))

    @property
    def position_limits(self) -> tuple[float, ...]:
        """Largest sizes of the angles [rad]."""
        return (self.data.position_limit,) * 7

    @property
    def joint_rates(self) -> tuple[float, ...]:
        """Largest rates [rad/s]."""
        return (self.data.joint_rate,) * 7

    @property
    def joint_accelerations(self) -> tuple[float, ...]:
        """Largest accelerations: rate / ``acceleration_time`` [rad/s^2]."""
        return (self.data.joint_rate / self.data.acceleration_time,) * 7

    @property
    def radii(self) -> tuple[float, ...]:
        """Radii of the capsules [m]."""
        tip, boom = self.data.wrist_radius, self.data.boom_radius
        return tip, boom, boom, tip

    def margins(self, q: Any) -> Array:
        """Angles to the limits at joints 1 to 7: ``[..., 7]`` [rad]; negative beyond.

        Raises:
            ShapeError, NotFiniteError: not seven finite numbers a posture.
        """
        out: Array = self.data.position_limit - np.abs(vectors("q", q, (7,)))
        return out

    def points(self, q: Any) -> Array:
        """Ends of the capsules' cores in the near hand's frame at joints 1 to 7: ``[..., 8, 3]`` [m].

        Raises:
            ShapeError, NotFiniteError: not seven finite numbers a posture.
        """
        return self.points_of(self.frames(q))

    def points_of(self, frames: Array) -> Array:
        """As :meth:`points`, of :meth:`frames` that may stand elsewhere ``[..., 8, 4, 4]``: ``[..., 8, 3]`` [m]."""
        boom, tip = self.data.boom_length, self.data.roll_offset
        origin, x, z = frames[..., :3, 3], frames[..., :3, 0], frames[..., :3, 2]
        along = (tip * z[..., 0, :], -boom * x[..., 3, :], -boom * x[..., 4, :], -tip * z[..., 7, :])
        out = np.empty((*frames.shape[:-3], 8, 3))
        out[..., ::2, :] = origin[..., [0, 3, 4, 7], :]
        out[..., 1::2, :] = out[..., ::2, :] + np.stack(along, axis=-2)
        return out

    def forward(self, q: Any) -> Array:
        """Far hand in the near hand's frame ``[..., 4, 4]`` at joints 1 to 7, ``[..., 7]`` [rad].

        Raises:
            ShapeError, NotFiniteError: not seven finite numbers a posture.
        """
        return np.asarray(self.frames(q)[..., 7, :, :])

    def frames(self, q: Any) -> Array:
        """Frames 0 to 7 in the near hand's frame ``[..., 8, 4, 4]`` at joints 1 to 7, ``[..., 7]`` [rad].

        Frame 0 stands at the near hand, its z axis along the arm; 3 is the robot's ``body``, where the first boom ends;
        4 where the second one does; 7 the far hand.

        Raises:
            ShapeError, NotFiniteError: not seven finite numbers a posture.
        """
        angles = vectors("q", q, (7,)) + OFFSETS
        data = self.data
        along = (0.0, 0.0, data.boom_length, data.boom_length, 0.0, 0.0, 0.0)
        ends = (data.roll_offset, data.yaw_offset, data.pitch_offset)
        offsets = (*ends, data.elbow_offset, *reversed(ends))
        out = [np.broadcast_to(np.diag([1.0, -1.0, -1.0, 1.0]), (*angles.shape[:-1], 4, 4))]
        for joint in range(7):
            out.append(out[-1] @ _link_matrix(angles[..., joint], TWISTS[joint], along[joint], offsets[joint]))
        return np.stack(out, axis=-3)

    def inverse(self, poses: Any, roll: Any = 0.0) -> tuple[Array, Flags]:
        """All postures with joint 1 at ``roll`` that put the far hand at ``poses`` ``[N, 4, 4]``.

        Args:
            poses: of the far hand in the near hand's frame.
            roll: angle of joint 1 [rad], one number or one a pose.

        Returns:
            (q, valid): ``[N, 8, 7]`` [rad], each within (-pi, pi], and ``[N, 8]``: whether the posture solves the pose
            and keeps the joint limits. Where there is no solution q is finite and means nothing.

        Raises:
            ShapeError, NotFiniteError: not finite poses, or as many rolls.
        """
        frames = vectors("poses", poses, (4, 4)).reshape(-1, 4, 4)
        first = validation.real_array("roll", roll)
        if first.shape not in ((), (len(frames),)):
            raise ShapeError("roll", roll, f"expected one number, or {len(frames)}")
        first = np.broadcast_to(first, (len(frames),))
        target = self._in_frame1(frames, first)
        branches = [*self._branches(target[:, :3, :3], target[:, :3, 3])]
        q = np.empty((len(frames), 8, 7))
        q[..., 0] = wrapped(first)[:, None]
        for k, (angles, _) in enumerate(branches):
            q[:, k, 1:] = wrapped(angles - OFFSETS[1:])
        solved = np.stack([flags for _, flags in branches], axis=1)
        return q, solved & (np.abs(q).max(axis=-1) <= self.data.position_limit)

    def unwound(self, q: Any, reference: Any) -> Array:
        """Postures turned joint by joint by whole turns to be nearest to ``reference`` within the limits [rad]."""
        angle, near = np.broadcast_arrays(vectors("q", q, (7,)), vectors("reference", reference, (7,)))
        choices = angle + 2 * pi * np.arange(-2, 3).reshape(-1, *([1] * angle.ndim))
        cost = np.where(np.abs(choices) <= self.data.position_limit, np.abs(choices - near), np.inf)
        return np.asarray(np.take_along_axis(choices, np.argmin(cost, axis=0)[None], axis=0)[0])

    def _in_frame1(self, frames: Array, roll: Array) -> Array:
        """Far hand in frame 1, which joint 1 carries."""
        base = frames * np.array([1.0, -1.0, -1.0, 1.0])[:, None]
        return np.asarray(np.linalg.inv(_link_matrix(roll + OFFSETS[0], 1, 0.0, self.data.roll_offset)) @ base)

    def _branches(self, rotation: Array, position: Array) -> Iterator[tuple[Array, Flags]]:
        """(theta2 to theta7 ``[N, 6]``, whether they solve the pose) of shoulder by wrist by elbow."""
        data, approach = self.data, rotation[:, :, 2]
        height = 2 * data.pitch_offset + data.elbow_offset
        wrist = position - data.roll_offset * approach - [0.0, 0.0, data.yaw_offset]
        radius, ahead = np.hypot(wrist[:, 0], wrist[:, 1]), np.arctan2(wrist[:, 1], wrist[:, 0])
        wide = radius >= height
        lean = np.arcsin(height / np.where(wide, radius, height))
        for theta2 in (ahead + lean, ahead + pi - lean):
            s, c = sines(theta2)
            zero = np.zeros_like(s)
            pitch, x2 = np.stack([s, -c, zero], axis=-1), np.stack([c, s, zero], axis=-1)
            normal = np.cross(pitch, approach)
            length = np.linalg.norm(normal, axis=-1)
            clear = length > LEAST_ANGLE
            yaw = normal / np.where(clear, length, 1.0)[:, None]
            for sign in (1.0, -1.0):
                tip = wrist - sign * data.yaw_offset * yaw
                plane = ((tip * x2).sum(axis=-1), tip[:, 2])
                last = self._last(sign * yaw, x2, pitch, rotation)
                for elbow in (1.0, -1.0):
                    theta3, theta4, reached = self._booms(*plane, elbow)
                    angles = (theta2, theta3, theta4, last[0] - theta3 - theta4, last[1], last[2])
                    yield np.stack(angles, axis=-1), wide & clear & reached

    def _last(self, yaw: Array, x2: Array, pitch: Array, rotation: Array) -> tuple[Array, Array, Array]:
        """theta3 + theta4 + theta5, theta6 and theta7 for an axis of joint 6."""
        psi = np.arctan2((yaw * x2).sum(axis=-1), -yaw[:, 2])
        s, c = sines(psi)
        x5 = c[:, None] * x2 + s[:, None] * np.array([0.0, 0.0, 1.0])
        approach, x7 = rotation[:, :, 2], rotation[:, :, 0]
        theta6 = np.arctan2(-(approach * x5).sum(axis=-1), (approach * pitch).sum(axis=-1))
        s, c = sines(theta6)
        x6 = c[:, None] * x5 + s[:, None] * pitch
        return psi, theta6, np.arctan2(-(x7 * yaw).sum(axis=-1), (x7 * x6).sum(axis=-1))

    def _booms(self, u: Array, v: Array, elbow: float) -> tuple[Array, Array, Flags]:
        """theta3, theta4 of two booms of one length whose end is at (u, v), and whether they reach it."""
        cosine = (u * u + v * v) / (2 * self.data.boom_length**2) - 1.0
        theta4 = elbow * np.arccos(np.clip(cosine, -1.0, 1.0))
        return np.arctan2(v, u) - theta4 / 2, theta4, cosine <= 1.0


def _link_matrix(theta: Array, twist: int, along: float, offset: float) -> Array:
    """Rz(theta) Tz(offset) Tx(along) Rx(twist 90 degrees), ``[..., 4, 4]``."""
    s, c = sines(theta)
    zero, one, cosine = np.zeros_like(s), np.ones_like(s), 1 - abs(twist)
    rows = (
        (c, -cosine * s, twist * s, along * c),
        (s, cosine * c, -twist * c, along * s),
        (zero, twist * one, cosine * one, offset * one),
        (zero, zero, zero, one),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
