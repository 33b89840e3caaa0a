"""The walker's arm in closed form: forward and inverse kinematics, rates and margins of many postures at once.

Everything is in the arm's base frame and in SI; arrays hold any number of postures along their leading axes. With
c_i = cos theta_i, s_23 = sin(theta2 + theta3) and the lengths NO, SN, ES, WE, HW (neck, shoulder offset, upper arm,
forearm, hand), the wrist is at

    x = c1 r - s1 SN,   y = s1 r + c1 SN,   z = NO + c2 ES + c23 WE,   r = s2 ES + s23 WE

and the hand is turned against frame 3 by Rz(theta4) Ry(theta5) Rz(theta6).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import hypot, pi, radians
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from wbc.errors import ShapeError
from wbc.robots import BodyLimb, Margins, Walker, WalkerData
from wbc.validation import Array
from wbc.walking.arms.angles import (
    checked_signs,
    frame3,
    hand_poses,
    sines,
    unit_vectors,
    vectors,
    wrapped,
    wrist_angles,
    zyz,
)
from wbc.walking.arms.rates import joint_rates
from wbc.walking.arms.reach import shoulder_span, wrist_margin

Flags = NDArray[np.bool_]

#: What each column of :meth:`ArmKinematics.margins` is about
LIMIT_NAMES = (*(f"joint {i} limit" for i in range(1, 7)), "elbow limit", "shoulder limit")
#: Relative slack of reach, for rounding: a straight arm may miss by this
ROUNDING = 1e-12
#: Where hands wait in the air: angles about the axis of joint 1 [rad], and in parts of upper arm and forearm together
#: their distance from that axis and how far they are beyond the neck
WAITING_ANGLES, WAITING_RADIUS, WAITING_BEYOND = (0.0, radians(40.0), radians(-40.0)), 20.0 / 34.0, 10.0 / 34.0


def limb_of(walker: Walker) -> BodyLimb:
    """The kinematics of a walker's arms: its own, or the closed form of a body with PUMA arms.

    Raises:
        ShapeError: a machine without arms of a body.
    """
    return walker.limb or ArmKinematics(walker.arm_data)


@dataclass(frozen=True)
class ArmKinematics:
    """Closed-form kinematics of one PUMA 600 arm, a :class:`wbc.robots.BodyLimb`.

    Attributes:
        data: lengths [m] and limits [rad]; default: those of the file.
    """

    data: WalkerData = field(default_factory=WalkerData.read)

    def forward(self, q: Any) -> Array:
        """Hand poses ``[..., 4, 4]`` at ``q`` ``[..., 6]`` [rad].

        Raises:
            ShapeError, NotFiniteError: not six finite numbers a posture.
        """
        array = vectors("q", q, (6,))
        turned, hand = frame3(array), zyz(array[..., 3], array[..., 4], array[..., 5])
        out = np.zeros((*array.shape[:-1], 4, 4))
        out[..., :3, :3] = turned @ hand
        out[..., :3, 3] = self._wrist(array) + self.data.hand_length * out[..., :3, 2]
        out[..., 3, 3] = 1.0
        return out

    def wrist(self, q: Any) -> Array:
        """Wrist positions ``[..., 3]`` [m] at ``q`` ``[..., 6]`` [rad].

        Raises:
            ShapeError, NotFiniteError: not six finite numbers a posture.
        """
        return self._wrist(vectors("q", q, (6,)))

    def points(self, q: Any) -> Array:
        """Base O, neck N, shoulder S, elbow E, wrist W and hand H at ``q`` ``[..., 6]``: ``[..., 6, 3]`` [m].

        The capsules of the links are about O N, S E, E W and W H, with the radii :attr:`radii`.

        Raises:
            ShapeError, NotFiniteError: not six finite numbers a posture.
        """
        array, data = vectors("q", q, (6,)), self.data
        (s1, c1), (s2, c2) = sines(array[..., 0]), sines(array[..., 1])
        out = np.zeros((*array.shape[:-1], 6, 3))
        out[..., 1:, 2] = data.neck_length
        out[..., 2, 0], out[..., 2, 1] = -data.shoulder_offset * s1, data.shoulder_offset * c1
        out[..., 3, :] = out[..., 2, :] + data.upper_arm_length * np.stack([c1 * s2, s1 * s2, c2], axis=-1)
        out[..., 4, :] = self._wrist(array)
        # The hand's z axis: (c4 s5, s4 s5, c5) in frame 3
        (s, c), (s4, c4) = sines(array[..., 1] + array[..., 2]), sines(array[..., 3])
        s5, c5 = sines(array[..., 4])
        outward, sideways = c * c4 * s5 + s * c5, s4 * s5
        axis = out[..., 5, :]
        axis[..., 0], axis[..., 1] = c1 * outward - s1 * sideways, s1 * outward + c1 * sideways
        axis[..., 2] = c * c5 - s * c4 * s5
        axis *= data.hand_length
        axis += out[..., 4, :]
        return out

    #: Of the capsules of neck O N, which stands still, upper arm S E, forearm E W and hand W H
    links: ClassVar[tuple[tuple[int, int], ...]] = ((0, 1), (2, 3), (3, 4), (4, 5))
    still: ClassVar[int] = 1
    guided: ClassVar[int] = 3
    limit_names: ClassVar[tuple[str, ...]] = LIMIT_NAMES

    @property
    def radii(self) -> tuple[float, float, float, float]:
        """Radii of the capsules of neck, upper arm, forearm and hand [m]."""
        data = self.data
        return data.neck_radius, data.upper_arm_radius, data.forearm_radius, data.hand_radius

    @property
    def position_limits(self) -> tuple[float, ...]:
        """Largest sizes of the angles [rad]."""
        return self.data.position_limits

    @property
    def joint_rates(self) -> tuple[float, ...]:
        """Largest rates [rad/s]."""
        return self.data.joint_rates

    @property
    def joint_accelerations(self) -> tuple[float, ...]:
        """Largest accelerations [rad/s^2]."""
        return self.data.joint_accelerations

    @property
    def pivot(self) -> Array:
        """The neck, on the axis of joint 1 ``[3]`` [m]."""
        return np.array([0.0, 0.0, self.data.neck_length])

    @property
    def hand_span(self) -> float:
        """No hand is farther from the neck [m]: the whole arm, straight."""
        data = self.data
        return data.shoulder_offset + data.upper_arm_length + data.forearm_length + data.hand_length

    @property
    def hand_length(self) -> float:
        """From the wrist to the hand's origin [m]."""
        return self.data.hand_length

    @property
    def waiting(self) -> tuple[tuple[float, float, float], ...]:
        """Where a hand may wait in the air: angle about the axis of joint 1 [rad], distance from it, height [m]."""
        data = self.data
        reach = data.upper_arm_length + data.forearm_length
        return tuple(
            (angle, WAITING_RADIUS * reach, data.neck_length + WAITING_BEYOND * reach) for angle in WAITING_ANGLES
        )

    @property
    def closed_form(self) -> WalkerData:
        """The numbers that compiled loops take."""
        return self.data

    def held(self, points: Array, axes: Array, x: Array | None = None, /) -> tuple[Array, Flags]:
        """Both wrist branches with the hand at ``points`` along ``axes``, see :meth:`wbc.robots.BodyLimb.held`.

        Raises:
            as :meth:`inverse_axis` and :meth:`inverse`.
        """
        if x is None:
            return self.inverse_axis(points, axes, limits=False)
        return self.inverse(hand_poses(points, axes, x), limits=False)

    def wrist_bend(self, q: Array, /) -> Array:
        """\\|sin theta5\\|: joint 4 turns the hand's axis by so much."""
        return np.abs(np.sin(q[..., 4]))

    def elbow_bend(self, q: Array, /) -> Array:
        """-theta3 [rad]."""
        return -q[..., 2]

    def follow(self, frames: Array, places: Array, guide: Array, margins: Margins, /) -> tuple[Array, Flags]:
        """Joints 1 to 5 or 6 ``[m, n, 5 or 6]`` [rad] with hands at ``places`` and the wrists at ``guide``.

        Forearm and hand are one link from the elbow to the hand: A = WE + HW c5 along the forearm, B = HW c4 s5 across
        it in the arm's plane, and HW s4 s5 out of the plane. So theta3 + atan2(B, A) is the angle at the elbow of an
        arm with the lengths ES and hypot(A, B). See :meth:`wbc.robots.BodyLimb.follow`.
        """
        data = self.data
        turn, origin = frames[..., :3, :3], frames[..., :3, 3]
        points = np.einsum("mnji,mnj->mni", turn, places - origin)
        (s4, c4), (s5, c5) = sines(guide[..., 0]), sines(guide[..., 1])
        hand = data.hand_length
        along, across, out = data.forearm_length + hand * c5, hand * c4 * s5, data.shoulder_offset + hand * s4 * s5
        es, reach, tilt = data.upper_arm_length, np.hypot(along, across), np.arctan2(across, along)
        x, y, z = points[..., 0], points[..., 1], points[..., 2] - data.neck_length
        square, least = x * x + y * y - out * out, margins.swing_axis**2
        r = np.sqrt(np.maximum(square, least))
        distance = np.hypot(r, z)
        elbow = np.arccos(np.clip((distance**2 - es * es - reach * reach) / (2 * es * reach), -1.0, 1.0))
        angles = np.empty((*r.shape, 3 + guide.shape[2]))
        angles[..., 0] = np.unwrap(np.arctan2(y, x) - np.arctan2(out, r), axis=1)
        angles[..., 0] += wrapped(angles[:, :1, 0]) - angles[:, :1, 0]
        angles[..., 1] = np.arctan2(r, z) + np.arctan2(reach * np.sin(elbow), es + reach * np.cos(elbow))
        angles[..., 2] = -elbow - tilt
        angles[..., 3:] = guide
        free = np.array(data.position_limits)[: angles.shape[2]] - np.abs(angles)
        lean = angles[..., 1] + angles[..., 2] / 2 - data.shoulder_limit
        straight = data.elbow_limit - angles[..., 2]
        possible = (square.min(axis=1) > least) & ((es + reach - distance).min(axis=1) > margins.swing_reach)
        # Limits of the published robot at the ends are approached as closely as holding grips do
        possible &= (free.min(axis=(1, 2)) > margins.swing_angle) & (lean.min(axis=1) > margins.swing_angle)
        possible &= straight.min(axis=1) > margins.swing_elbow
        return angles, possible

    def wrist_of(self, points: Any, axes: Any) -> Array:
        """Where the wrist of a hand at ``points`` [m] is whose z axis is ``axes``: p - HW z, ``[..., 3]``."""
        return vectors("points", points, (3,)) - self.data.hand_length * vectors("axes", axes, (3,))

    def wrist_reach(self, wrists: Any) -> Array:
        """Signed distance-like margin [m] of wrist positions ``[..., 3]`` from the bounds of the first three joints.

        The least of: (longest - d) and (d - shortest), where d is the distance from the shoulder, which lies between
        what the limit of joint 3 and the elbow limit leave; and the distance from the cone that the shoulder limit
        keeps free, in the plane of the bent arm. Negative: out of reach. It is the arm that reaches forwards with
        theta3 < 0; the limits of joints 1 and 2 are left to :meth:`margins`.

        Raises:
            ShapeError, NotFiniteError: not three finite numbers a point.
        """
        return wrist_margin(self.data, vectors("wrists", wrists, (3,)))

    @property
    def wrist_span(self) -> float:
        """Largest distance of the wrist from the neck [m], at the elbow limit."""
        return hypot(self.data.shoulder_offset, shoulder_span(self.data, self.data.elbow_limit))

    def inverse(
        self,
        poses: Any,
        *,
        theta4: Any = 0.0,
        elbows: Sequence[int] = (-1,),
        shoulders: Sequence[int] = (1,),
        limits: bool = True,
    ) -> tuple[Array, Flags]:
        """All postures that put the hand at ``poses``, ``[N, 4, 4]`` in the arm's base frame.

        The branches are shoulder by elbow by wrist, in this order: shoulder 1 is the arm reaching forwards (r > 0), -1
        over its back; elbow -1 is theta3 < 0, the walker's; wrist 1 is theta5 >= 0, then theta5 < 0.

        Args:
            poses: of the hand.
            theta4: what joint 4 is where theta5 = 0 leaves it open, within 1e-9 [rad]; one number, or one a pose.
            elbows, shoulders: which branches to make.
            limits: count limits of joints, elbow and shoulder.

        Returns:
            (q, valid): ``[N, branches, 6]`` [rad], theta6 within (-pi, pi], and ``[N, branches]``: whether the posture
            solves the pose and, with ``limits``, keeps them. Where there is no solution q is finite and means nothing.

        Raises:
            ShapeError, NotFiniteError: not finite poses.
        """
        frames = vectors("poses", poses, (4, 4))
        frames = frames.reshape(-1, 4, 4)
        rotations = frames[:, :3, :3]
        wrists = frames[:, :3, 3] - self.data.hand_length * rotations[:, :, 2]
        first, solved = self._first_three(wrists, elbows, shoulders)
        wrist = wrist_angles(first, rotations[:, :, 2], rotations[:, :, 0], theta4)
        return self._finish(first, solved, wrist, limits)

    def inverse_axis(
        self,
        points: Any,
        axes: Any,
        *,
        theta4: Any = 0.0,
        elbows: Sequence[int] = (-1,),
        shoulders: Sequence[int] = (1,),
        limits: bool = True,
    ) -> tuple[Array, Flags]:
        """All postures that put the hand's origin at ``points`` [m] and its z axis along ``axes``, joint 6 at 0.

        The roll of the hand is what follows. ``[N, 3]`` each; the rest is as in :meth:`inverse`.

        Raises:
            ShapeError, NotFiniteError: not three finite numbers each. RangeError: an axis that is not of unit length.
        """
        at, along = vectors("points", points, (3,)).reshape(-1, 3), unit_vectors("axes", axes)
        first, solved = self._first_three(at - self.data.hand_length * along, elbows, shoulders)
        wrist = wrist_angles(first, along, None, theta4)
        return self._finish(first, solved, wrist, limits)

    def margins(self, q: Any) -> Array:
        """Angles to the limits [rad], ``[..., 8]`` in the order of :data:`LIMIT_NAMES`; negative beyond.

        limit_i - \\|theta_i\\| for the six joints; elbow_limit - theta3; theta2 + theta3 / 2 - shoulder_limit.

        Raises:
            ShapeError, NotFiniteError: not six finite numbers a posture.
        """
        return self._margins(vectors("q", q, (6,)))

    def limiting(self, q: Any) -> NDArray[np.int64]:
        """Index in :data:`LIMIT_NAMES` of the nearest limit of postures ``[..., 6]``."""
        out: NDArray[np.int64] = np.argmin(self.margins(q), axis=-1)
        return out

    def nearest(self, q: Any, valid: Any, reference: Any) -> tuple[Array, NDArray[np.int64], Array]:
        """Of the branches ``[N, branches, 6]`` the one that is reached soonest from ``reference`` at full joint rates.

        Joint 6 is turned by a whole turn where that is nearer and within its limit.

        Returns:
            (q, branch, time): ``[N, 6]``, ``[N]`` (-1 where none is valid; q is then the reference) and the largest
            \\|q - reference\\| / rate of a joint ``[N]`` [s], infinite for none.

        Raises:
            ShapeError, NotFiniteError: arrays that do not fit each other.
        """
        postures = vectors("q", q, (6,))
        if postures.ndim != 3:
            raise ShapeError("q", q, "expected [N, branches, 6]")
        start = np.broadcast_to(vectors("reference", reference, (6,)), (len(postures), 6))
        fits = np.asarray(valid, dtype=bool)
        if fits.shape != postures.shape[:2]:
            raise ShapeError("valid", valid, f"expected shape {postures.shape[:2]}")
        postures = postures.copy()
        postures[..., 5] = self.unwound(postures[..., 5], start[:, None, 5])
        times = (np.abs(postures - start[:, None]) / np.array(self.data.joint_rates)).max(axis=-1)
        times = np.where(fits, times, np.inf)
        branch = np.argmin(times, axis=1)
        rows = np.arange(len(postures))
        time = times[rows, branch]
        none = ~np.isfinite(time)
        chosen = np.where(none[:, None], start, postures[rows, branch])
        return chosen, np.where(none, -1, branch), time

    def unwound(self, theta6: Any, reference: Any) -> Array:
        """Angles of joint 6 turned by whole turns to be nearest to ``reference`` within the joint's limit [rad]."""
        angle, near = np.broadcast_arrays(np.asarray(theta6, dtype=float), np.asarray(reference, dtype=float))
        limit = self.data.position_limits[5] + ROUNDING
        choices = angle + 2 * pi * np.arange(-2, 3).reshape(-1, *([1] * angle.ndim))
        cost = np.where(np.abs(choices) <= limit, np.abs(choices - near), np.inf)
        best = np.argmin(cost, axis=0)[None]
        return np.asarray(np.take_along_axis(choices, best, axis=0)[0])

    def rates(self, q: Any, twists: Any) -> tuple[Array, Flags]:
        """Joint rates ``[..., 6]`` [rad/s] for hand twists ``[..., 6]`` (linear, then angular, along the base's axes).

        The wrist's velocity gives the first three rates, the rotation that is left the last three. Where
        \\|sin theta5\\| < 0.01, joint 4 stands still and joints 5 and 6 do what they can (published treatment).

        Returns:
            (rates, exact): ``exact`` is False where the twist is not met: theta5, the elbow or the shoulder is
            singular.

        Raises:
            ShapeError, NotFiniteError: not six finite numbers each.
        """
        return joint_rates(self.data, vectors("q", q, (6,)), vectors("twists", twists, (6,)))

    def _wrist(self, q: Array) -> Array:
        data = self.data
        (s1, c1), (s2, c2), (s23, c23) = sines(q[..., 0]), sines(q[..., 1]), sines(q[..., 1] + q[..., 2])
        r = s2 * data.upper_arm_length + s23 * data.forearm_length
        z = data.neck_length + c2 * data.upper_arm_length + c23 * data.forearm_length
        offset = data.shoulder_offset
        return np.stack([c1 * r - s1 * offset, s1 * r + c1 * offset, z], axis=-1)

    def _first_three(self, wrists: Array, elbows: Sequence[int], shoulders: Sequence[int]) -> tuple[Array, Flags]:
        """(theta1 to theta3 of every shoulder and elbow ``[N, branches, 3]``, whether the wrist is there)."""
        data = self.data
        es, we, offset = data.upper_arm_length, data.forearm_length, data.shoulder_offset
        x, y, z = wrists[:, 0], wrists[:, 1], wrists[:, 2] - data.neck_length
        rho2 = x * x + y * y
        r = np.sqrt(np.maximum(rho2 - offset * offset, 0.0))
        cosine = (r * r + z * z - es * es - we * we) / (2 * es * we)
        solved = (np.abs(cosine) <= 1 + ROUNDING) & (rho2 >= offset * offset * (1 - ROUNDING))
        bend = np.arccos(np.clip(cosine, -1.0, 1.0))
        out = []
        for shoulder in checked_signs("shoulders", shoulders):
            theta1 = wrapped(np.arctan2(y, x) - np.arctan2(offset, shoulder * r))
            for elbow in checked_signs("elbows", elbows):
                theta3 = elbow * bend
                theta2 = np.arctan2(shoulder * r, z) - np.arctan2(we * np.sin(theta3), es + we * np.cos(theta3))
                out.append(np.stack([theta1, wrapped(theta2), theta3], axis=-1))
        return np.stack(out, axis=1), np.repeat(solved[:, None], len(out), axis=1)

    def _finish(self, first: Array, solved: Flags, wrist: Array, limits: bool) -> tuple[Array, Flags]:
        """Joins first three and last three angles: ``[N, b, 3]`` and ``[N, b, 2, 3]`` to ``[N, 2 b, 6]``."""
        count, branches = first.shape[:2]
        pairs = np.empty((count, branches, 2, 6))
        pairs[..., :3] = first[:, :, None]
        pairs[..., 3:] = wrist
        q = pairs.reshape(count, 2 * branches, 6)
        valid = np.repeat(solved, 2, axis=1)
        if limits:
            valid = valid & (self._margins(q).min(axis=-1) >= -ROUNDING)
        return q, valid

    def _margins(self, q: Array) -> Array:
        out = np.empty((*q.shape[:-1], 8))
        out[..., :6] = np.array(self.data.position_limits) - np.abs(q)
        out[..., 6] = self.data.elbow_limit - q[..., 2]
        out[..., 7] = q[..., 1] + q[..., 2] / 2 - self.data.shoulder_limit
        return out
