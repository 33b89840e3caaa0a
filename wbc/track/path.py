"""Timed Cartesian paths: a pose and its exact twist at every time.

A path starts and ends at rest: velocity and acceleration are zero at both ends, so that a robot that stands
still can follow it from the first tick.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from wbc import validation
from wbc.errors import RangeError, ShapeError
from wbc.multibody import pin
from wbc.rotations import continuous_quaternions, quaternion, relative_quaternion
from wbc.validation import Array

#: Consecutive orientations may be at most this far apart [rad]; beyond it, the direction of the turn is ambiguous.
LARGEST_TURN = math.radians(170.0)

#: Shortest time between poses [s]
SHORTEST = 1e-6
#: Longest path [s]: powers up to the fifth of times are added
LONGEST = 1e9

#: The spline of quaternions may not come nearer to zero than this, where its direction is badly defined.
SHORTEST_QUATERNION = 0.2


@dataclass(frozen=True, eq=False)
class Sample:
    """A path at one time.

    Attributes:
        pose: in the world.
        twist: linear [m/s] and angular [rad/s] velocity in world axes, of the pose's origin, 6.
    """

    pose: pin.SE3
    twist: Array


class TimedPath(Protocol):
    """What can be followed."""

    @property
    def duration(self) -> float:
        """Length in time [s]; ``sample`` holds still outside [0, duration]."""

    def sample(self, t: float) -> Sample:
        """Pose and twist at time t [s]."""


class SplinePath:
    """A C4 path through poses at given times.

    Position: the quintic spline p(t) through the points. Orientation: the quintic spline s(t) in R^4 through the
    quaternions (signs chosen so that neighbours are nearest), projected to the unit sphere:

        Q = s / |s|,    omega = 2 vec(dQ/dt Q^-1),    dQ/dt = (1 - Q Q') ds/dt / |s|.

    At both ends the first and second derivatives of both splines are zero, hence velocity and acceleration. Two
    poses give the minimum-jerk polynomial and a turn about one axis.

    Args:
        times: strictly increasing, n >= 2 [s]; counted from the first.
        poses: n poses in the world (``pin.SE3``, 4x4, or position and quaternion x, y, z, w).

    Raises:
        ShapeError, NotFiniteError, RotationError: bad times or poses.
        RangeError: times do not increase, or neighbouring orientations are more than 170 degrees apart.

    Cannot do: keep corners or straight pieces between points (a spline bows and may overshoot); respect limits.
    """

    def __init__(self, times: Any, poses: Sequence[Any]) -> None:
        from scipy.interpolate import make_interp_spline

        poses = validation.items("path.poses", poses, "poses")
        stamps = validation.ordinary_array("path.times", times)
        if stamps.ndim != 1 or len(stamps) < 2 or len(stamps) != len(poses):
            raise ShapeError("path.times", times, f"expected at least two times, one for each of {len(poses)} poses")
        if (np.diff(stamps) <= 0.0).any():
            k = int(np.argmax(np.diff(stamps) <= 0.0)) + 1
            raise RangeError(f"path.times[{k}]", float(stamps[k]), f"expected a time after {stamps[k - 1]:g} s")
        if (np.diff(stamps) < SHORTEST).any() or stamps[-1] - stamps[0] > LONGEST:
            raise RangeError("path.times", times, f"expected times {SHORTEST:g} s apart or more, {LONGEST:g} s in all")
        placed = [validation.pose(f"path.poses[{k}]", pose) for k, pose in enumerate(poses)]
        points = validation.ordinary_array("path.poses", [pose.translation for pose in placed])
        quaternions = _continuous(np.array([quaternion(pose.rotation) for pose in placed]))
        self.times = stamps - stamps[0]
        self.points = points
        self._quaternions = quaternions
        ends = [(1, np.zeros(7)), (2, np.zeros(7))]
        values = np.hstack([points, quaternions])
        self._spline = make_interp_spline(self.times, values, k=5, bc_type=(ends, ends))
        self._rate = self._spline.derivative()
        self._check_quaternions()

    @property
    def duration(self) -> float:
        """Time of the last pose [s]."""
        return float(self.times[-1])

    def sample(self, t: float) -> Sample:
        """Pose and twist at time t [s]; at rest outside [0, duration]."""
        t = validation.scalar("t", t, unit="s")
        inside = min(max(t, 0.0), self.duration)
        value = self._spline(inside)
        rate = self._rate(inside) if inside == t else np.zeros(7)
        size = float(np.linalg.norm(value[3:]))
        unit = value[3:] / size
        turning = (rate[3:] - unit * float(unit @ rate[3:])) / size
        pose = pin.SE3(pin.Quaternion(unit).matrix(), value[:3])
        return Sample(pose, np.concatenate([rate[:3], _angular_velocity(unit, turning)]))

    def stretched(self, duration: float) -> SplinePath:
        """The same poses in another time [s], > 0."""
        duration = validation.scalar("duration", duration, low=0.0, open_low=True, unit="s")
        poses = [pin.SE3(pin.Quaternion(q).matrix(), p) for p, q in zip(self.points, self._quaternions, strict=True)]
        return SplinePath(self.times * (duration / self.duration), poses)

    def _check_quaternions(self) -> None:
        grid = np.linspace(0.0, self.duration, 50 * len(self.times))
        sizes = np.linalg.norm(self._spline(grid)[:, 3:], axis=1)
        if sizes.min() < SHORTEST_QUATERNION:
            at = float(grid[int(np.argmin(sizes))])
            raise RangeError("path.poses", f"t = {at:.3g} s", "orientations change too unevenly here; add poses")


class ApproachedPath:
    """First a path from a pose to the start of another path, then that path. Both are at rest where they meet."""

    def __init__(self, start: pin.SE3, path: TimedPath, duration: float) -> None:
        self._first = SplinePath([0.0, duration], [start, path.sample(0.0).pose])
        self._path = path

    @property
    def duration(self) -> float:
        """Duration of both [s]."""
        return self._first.duration + self._path.duration

    def sample(self, t: float) -> Sample:
        return self._first.sample(t) if t < self._first.duration else self._path.sample(t - self._first.duration)


def smooth_step(t: float, duration: float) -> tuple[float, float]:
    """x = 10 s^3 - 15 s^4 + 6 s^5 with s = t / duration cut to [0, 1], and dx/dt [1/s]."""
    s = min(max(t / duration, 0.0), 1.0)
    return s**3 * (10.0 + s * (6.0 * s - 15.0)), 30.0 * (s * (1.0 - s)) ** 2 / duration


def _continuous(quaternions: Array) -> Array:
    """Signs such that neighbours are nearest."""
    out = continuous_quaternions(quaternions)
    for k in range(1, len(out)):
        angle = 2.0 * math.acos(min(float(out[k] @ out[k - 1]), 1.0))
        if angle > LARGEST_TURN:
            shown = f"{math.degrees(angle):.1f} deg"
            raise RangeError(f"path.poses[{k}]", shown, "too far from the orientation before it; add a pose between")
    return out


def _angular_velocity(unit: Array, rate: Array) -> Array:
    """2 vec(dQ/dt Q^-1) of a unit quaternion x, y, z, w, in world axes."""
    return 2.0 * relative_quaternion(rate, unit)[:3]
