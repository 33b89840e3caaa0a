"""Where the body is to be: poses over the time at which it is there when nothing slows it down."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import RangeError, ShapeError
from wbc.multibody import pin
from wbc.validation import Array
from wbc.walking.holds.built_in import PITCH, RADIUS, grid_angle, grid_pose

#: Time from one sample to the next [s]
SPACING = 0.05
#: Rotations this far apart [rad] count as a metre and a half; for paths that only turn
TURN_RADIUS = 1.5
#: Of detours from a path that stands still [m/s, rad/s]
SLOWEST = 0.01


@dataclass(frozen=True, eq=False)
class BodyPath:
    """Poses of the body's frame in the structure's, evenly over the path time u.

    u is the time of the walk at the commanded speed. A walker that must wait is at the same pose later.

    Attributes:
        poses: ``[samples, 4, 4]`` [m].
        spacing: u from one sample to the next [s].
        speed, turn_rate: largest that were asked for, which bound detours as well [m/s, rad/s]; 0: the largest that the
            path has itself, one by :data:`TURN_RADIUS` out of the other where it has only that.

    Raises:
        ShapeError, NotFiniteError, RotationError: no poses. RangeError: spacing not positive.
    """

    poses: Array
    spacing: float = SPACING
    speed: float = 0.0
    turn_rate: float = 0.0
    _steps: dict[int, Array] = field(default_factory=dict, init=False, repr=False)

    def __post_init__(self) -> None:
        poses = validation.real_array("BodyPath.poses", self.poses)
        if poses.ndim != 3 or poses.shape[1:] != (4, 4) or len(poses) < 1:
            raise ShapeError("BodyPath.poses", self.poses, "expected samples x 4 x 4")
        for pose in (poses[0], poses[-1]):
            validation.pose("BodyPath.poses", pose)
        # A path that stands still is two samples long, so that there is something to interpolate
        poses = np.repeat(poses, 2, axis=0) if len(poses) == 1 else poses.copy()
        poses.flags.writeable = False
        object.__setattr__(self, "poses", poses)
        spacing = validation.scalar("BodyPath.spacing", self.spacing, low=0.0, open_low=True, unit="s")
        object.__setattr__(self, "spacing", spacing)
        if not (self.speed and self.turn_rate):
            ahead, turned = self.largest_rates()
            for name, rate in (
                ("speed", max(ahead, TURN_RADIUS * turned)),
                ("turn_rate", max(turned, ahead / TURN_RADIUS)),
            ):
                object.__setattr__(self, name, getattr(self, name) or rate or SLOWEST)

    def largest_rates(self) -> tuple[float, float]:
        """Largest speed of the origin and largest turn rate from sample to sample [m/s, rad/s]."""
        turn = np.swapaxes(self.poses[:-1, :3, :3], 1, 2) @ self.poses[1:, :3, :3]
        half = np.sqrt(np.clip(3.0 - np.trace(turn, axis1=1, axis2=2), 0.0, 4.0) / 4.0)
        moved = np.linalg.norm(np.diff(self.poses[:, :3, 3], axis=0), axis=1)
        return float(moved.max()) / self.spacing, float(2.0 * np.arcsin(half).max()) / self.spacing

    def slower(self, times: int) -> BodyPath:
        """The same poses at so many times lower rates, with so many times as many samples."""
        places = np.arange((len(self) - 1) * times + 1) * (self.spacing / times)
        poses = np.array([self.at(u)[0].homogeneous for u in places])
        poses[::times] = self.poses
        return replace(self, poses=poses, speed=self.speed / times, turn_rate=self.turn_rate / times)

    def __len__(self) -> int:
        return len(self.poses)

    @functools.cached_property
    def duration(self) -> float:
        """u at the last sample [s]."""
        return (len(self.poses) - 1) * self.spacing

    def at(self, u: float) -> tuple[pin.SE3, Array]:
        """Pose, and its derivative along u: (linear; angular) in the structure's axes [m/s, rad/s].

        With the part s of the way from the middle before sample k to the middle behind it, where poses are P,

            P_k exp(s^2 / 2 log(P_k^-1 P_k+1) + (1 - s)^2 / 2 log(P_k^-1 P_k-1))

        so that the rate changes evenly from middle to middle and jumps nowhere; at the ends the path goes straight.
        A sample at which the rate changes by d is passed at d spacing / 8 from it. u is clipped to the path.
        """
        k, part = self.place(u)
        before, after = self.step(k - 1), self.step(k)
        bend = pin.Motion(0.5 * part**2 * after - 0.5 * (1.0 - part) ** 2 * before)
        pose = pin.SE3(self.poses[k]) * pin.exp6(bend)
        twist = pin.Jexp6(bend) @ (part * after + (1.0 - part) * before) / self.spacing
        return pose, (twist.reshape(2, 3) @ pose.rotation.T).ravel()

    def place(self, u: float) -> tuple[int, float]:
        """The sample nearest to u, clipped to the path, and the part of the way from the middle before it to that
        behind it.
        """
        place = min(max(u / self.spacing, 0.0), len(self.poses) - 1.0)
        k = min(int(place + 0.5), len(self.poses) - 1)
        return k, place - k + 0.5

    def step(self, k: int) -> Array:
        """log(P_k^-1 P_k+1), (linear; angular); before the path its first one, behind it its last ``[6]``."""
        k = min(max(k, 0), len(self.poses) - 2)
        if k not in self._steps:
            first, last = self.poses[k], self.poses[k + 1]
            self._steps[k] = np.array(pin.log6(pin.SE3(first).actInv(pin.SE3(last))).vector)
        return self._steps[k]

    @functools.cached_property
    def numbers(self) -> Array:
        """Samples as rotation by columns and position ``[samples, 12]`` [m]."""
        return np.ascontiguousarray(self.poses[:, :3].transpose(0, 2, 1).reshape(-1, 12))

    def blended(self, samples: Array) -> Array:
        """Matrices at fractional samples, by straight lines between entries: for estimates; ``[..., 4, 4]``."""
        at = np.clip(samples, 0.0, len(self.poses) - 1.0)
        low = np.minimum(at.astype(int), len(self.poses) - 2)
        part = (at - low)[..., None, None]
        out: Array = self.poses[low] * (1.0 - part) + self.poses[low + 1] * part
        return out

    def moved(self, pose: pin.SE3) -> BodyPath:
        """The same path on a structure that was moved by ``pose``."""
        return replace(self, poses=pose.homogeneous @ self.poses)


def standing_path(pose: Any, duration: float = 1.0) -> BodyPath:
    """A body that stays where it is.

    Raises:
        ShapeError, NotFiniteError, RotationError, RangeError: of arguments.
    """
    where = validation.pose("pose", pose).homogeneous
    time = validation.scalar("duration", duration, low=0.0, open_low=True, unit="s")
    return BodyPath(np.repeat(where[None], int(np.ceil(time / SPACING)) + 1, axis=0))


def straight_path(poses: Sequence[Any], speed: float, turn_rate: float = 0.05) -> BodyPath:
    """From pose to pose with constant twists: as slow as ``speed`` [m/s] of the origin and ``turn_rate`` [rad/s] ask.

    Raises:
        ShapeError, NotFiniteError, RotationError: fewer than one pose, or bad ones. RangeError: rates not positive.
    """
    speed, turn_rate = _rates(speed, turn_rate)
    points = [validation.pose(f"poses[{k}]", pose) for k, pose in enumerate(poses)]
    if not points:
        raise ShapeError("poses", poses, "expected at least one pose")
    out = [points[0].homogeneous[None]]
    for first, last in itertools.pairwise(points):
        step = pin.log6(first.actInv(last))
        time = max(np.linalg.norm(step.linear) / speed, np.linalg.norm(step.angular) / turn_rate)
        count = int(np.ceil(time / SPACING - 1e-9))
        parts = np.arange(1, count + 1) / max(count, 1)
        out += [(first * pin.exp6(step * part)).homogeneous[None] for part in parts]
    return BodyPath(np.concatenate(out), speed=speed, turn_rate=turn_rate)


def grid_path(
    points: Sequence[Any],
    speed: float,
    turn_rate: float = 0.05,
    height: float = 52 * 0.0254,
    pose: pin.SE3 | None = None,
) -> BodyPath:
    """Over the published cylinder, along straight lines in (T, A, heading), at ``height`` [m] above the surface.

    A segment takes as long as ``speed`` [m/s] of the body's origin and ``turn_rate`` [rad/s] ask, whichever is longer.

    Args:
        points: (T, A) or (T, A, heading [rad]), at least one; a single one stands still.
        pose: of the cylinder, if it was moved.

    Raises:
        ShapeError, NotFiniteError: bad points. RangeError: rates not positive.
    """
    speed, turn_rate = _rates(speed, turn_rate)
    height = validation.scalar("height", height, low=0.0, open_low=True, unit="m")
    rows = []
    for k, point in enumerate(points):
        row = validation.real_array(f"points[{k}]", point)
        if row.shape not in ((2,), (3,)):
            raise ShapeError(f"points[{k}]", point, "expected (T, A) or (T, A, heading)")
        rows.append(np.append(row, np.zeros(3 - len(row))))
    if not rows:
        raise ShapeError("points", points, "expected at least one point")
    radius, grid = RADIUS + height, [rows[0][None]]
    for first, last in itertools.pairwise(rows):
        step = last - first
        length = np.hypot((grid_angle(1.0) - grid_angle(0.0)) * radius * step[0], PITCH * step[1])
        count = int(np.ceil(max(length / speed, abs(step[2]) / turn_rate) / SPACING - 1e-9))
        grid.append(first + step * (np.arange(1, count + 1) / max(count, 1))[:, None])
    poses = np.array([grid_pose(t, a, radius, heading).homogeneous for t, a, heading in np.concatenate(grid)])
    return BodyPath(poses if pose is None else pose.homogeneous @ poses, speed=speed, turn_rate=turn_rate)


def _rates(speed: float, turn_rate: float) -> tuple[float, float]:
    speed = validation.scalar("speed", speed, low=0.0, open_low=True, unit="m/s")
    turn_rate = validation.scalar("turn_rate", turn_rate, low=0.0, open_low=True, unit="rad/s")
    if not np.isfinite([speed, turn_rate]).all():
        raise RangeError("speed", (speed, turn_rate), "expected finite rates")
    return speed, turn_rate
