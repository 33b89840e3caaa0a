"""The body along its path: its command from tick to tick, and how fast it goes on."""

from __future__ import annotations

import functools
from math import inf, sqrt

import casadi as ca
import numpy as np

from wbc.multibody import pin
from wbc.native.compiled_function import compiled
from wbc.symbolic.evaluation import SingleState
from wbc.symbolic.rotations import exp3, from_quaternion, left_jacobian, log3, to_quaternion
from wbc.validation import Array
from wbc.walking.body_path import BodyPath
from wbc.walking.loop.stopping import Stops

#: Where things are in the output: the target and its rate, and where it is afterwards as numbers and as position and
#: quaternion
TARGET, AFTER, POSE = slice(0, 18), slice(18, 30), slice(30, 37)


@functools.cache
def pose_function() -> ca.Function:
    """f(now, sample, around, part, rate), poses as 12 numbers: the rotation by columns, the position.

    At the end of the tick the body is at M exp(s^2 / 2 after - (1 - s)^2 / 2 before), see
    :meth:`wbc.walking.body_path.BodyPath.at`; its rate from where it is now on is (p' - p, R log(R' R')) / dt in the
    structure's axes.

    Args:
        now: at the beginning of the tick. sample: M. around: the steps before and after it, each (linear; angular)
            ``[12]``. part: s. rate: 1 / dt [1/s].

    Returns:
        now, its rate ``[6]``, the pose afterwards ``[12]``, and its position and quaternion x, y, z, w ``[7]``.
    """
    sizes = {"now": 12, "sample": 12, "around": 12, "part": 1, "rate": 1}
    now, sample, around, part, rate = (ca.SX.sym(name, size) for name, size in sizes.items())
    bend = 0.5 * part**2 * around[6:] - 0.5 * (1.0 - part) ** 2 * around[:6]
    turns, places = zip(*((ca.reshape(pose[:9], 3, 3), pose[9:]) for pose in (now, sample)), strict=True)
    turned = turns[1] @ from_quaternion(exp3(bend[3:]))
    moved = places[1] + turns[1] @ (left_jacobian(bend[3:]) @ bend[:3])
    speed = ca.vertcat(moved - places[0], turns[0] @ log3(turns[0].T @ turned)) * rate
    out = ca.vertcat(now, speed, ca.vec(turned), moved, moved, to_quaternion(turned))
    return compiled(ca.Function("pose", [now, sample, around, part, rate], [out]))


class BodyCommand:
    """Where the body is to be as a tick begins, how fast it is to move, and where it is then as the tick ends.

    Args:
        dt: control period [s].

    Attributes:
        pose: at the end of the tick: position [m] and quaternion x, y, z, w.
    """

    def __init__(self, dt: float) -> None:
        self._step = SingleState(pose_function())
        self._now, self._sample, self._around, self._part, rate = self._step.inputs
        rate[0] = 1.0 / dt
        self._path: BodyPath | None = None
        self._place, self._row = np.nan, -1
        self.pose: Array = np.zeros(7)

    def go(self, path: BodyPath, begin: float, end: float) -> Array:
        """From one path time to another [s].

        Returns:
            The target, rotation by columns and position, and its rate (linear; angular) in the structure's axes
            ``[18]`` [m, m/s, rad/s].
        """
        out = self._step.output
        if path is not self._path:
            self._path, self._row = path, -1
            self._now[:] = pose_numbers(path.at(begin)[0])
        elif begin != self._place:
            self._now[:] = pose_numbers(path.at(begin)[0])
        else:
            self._now[:] = out[AFTER]
        row, self._part[0] = path.place(end)
        if row != self._row:
            self._sample[:], self._row = path.numbers[row], row
            self._around[:6], self._around[6:] = path.step(row - 1), path.step(row)
        self._step.run()
        self._place = end
        self.pose = out[POSE].copy()
        return out[TARGET]


def pose_numbers(pose: pin.SE3) -> Array:
    """A pose as 12 numbers, rotation by columns, then position."""
    out: Array = pose.homogeneous[:3].ravel(order="F")
    return out


#: Part of the pace from which a body that brakes steadily comes to rest in time
PART = 0.9
#: Accelerations of the body where its path bends [m/s^2, rad/s^2]: a quarter of the jumps that a checker allows a tick
BENDING = 0.5


class Corners:
    """How fast a path may be followed: where its rate changes by d around a sample, over one spacing, at the pace p by
    p^2 d / spacing, which is at most :data:`BENDING`; and before it as fast as can be braked in time.

    Args:
        brake: time in which the body comes to rest from full pace [s].
    """

    def __init__(self, path: BodyPath, brake: float) -> None:
        self.path, self._gain = path, 2.0 * PART / brake
        turns, places = path.poses[:, :3, :3], path.poses[:, :3, 3]
        step = turns[1:] @ turns[:-1].transpose(0, 2, 1)
        # Of small turns the skew part is the rotation vector
        skew = 0.5 * np.stack(
            [step[:, 2, 1] - step[:, 1, 2], step[:, 0, 2] - step[:, 2, 0], step[:, 1, 0] - step[:, 0, 1]]
        )
        rates = np.stack([np.diff(places, axis=0), skew.T], axis=1) / path.spacing
        jumps = np.linalg.norm(np.diff(rates, axis=0), axis=2).max(axis=1)
        squares = np.ones(len(path.poses))
        squares[1:-1] = np.minimum(BENDING * path.spacing / np.maximum(jumps, BENDING * path.spacing), 1.0)
        # From half a spacing before a sample on
        reach = squares + self._gain * path.spacing * (np.arange(len(squares)) - 0.5)
        self._here: list[float] = squares.tolist()
        self._reach: list[float] = [*np.minimum.accumulate(reach[::-1])[::-1].tolist(), inf]

    def pace(self, u: float) -> float:
        """The greatest at a path time [s]."""
        row = min(int(u / self.path.spacing + 0.5), len(self._here) - 1)
        return sqrt(max(min(self._here[row], self._reach[row + 1] - self._gain * u), 0.0))


def wanted_pace(
    stops: Stops, margin: float, left: float, landing: tuple[float, float] | None, most: float = 1.0
) -> float:
    """The pace that a body should have: as fast as asked, as slow as the hands need. Braking from p in a time T takes
    p^2 T / 2 of path time.

    Args:
        margin: path time until a holding hand reaches the end of its grip [s]. left: until the end of the path or of
            what is planned [s]. landing: path time that is left until the swinging hand has to hold, and the time that
            it needs until then [s]; None: no hand is swinging. most: that the path allows.
    """
    wanted = min(1.0, most, sqrt(2.0 * margin / stops.brake * PART), sqrt(2.0 * left / stops.ramp * PART))
    if landing is not None and landing[0] < landing[1]:
        wanted = min(wanted, landing[0] / landing[1])
    return wanted


class BodyMotion:
    """The pace of the body, 1 the path's own, and its command; how fast it changes says :class:`Stops`.

    Attributes:
        pace: now. wanted: that it should have. pose: where the body is to be as the tick ends: position [m] and
            quaternion x, y, z, w.
    """

    def __init__(self, dt: float, stops: Stops) -> None:
        self._dt, self._stops, self._command = dt, stops, BodyCommand(dt)
        self.pace, self.wanted = 0.0, 1.0
        self._corners: Corners | None = None

    @property
    def pose(self) -> Array:
        return self._command.pose

    def corners(self, path: BodyPath) -> Corners:
        """Of a path, which are made once."""
        if self._corners is None or self._corners.path is not path:
            self._corners = Corners(path, self._stops.brake)
        return self._corners

    def choose(
        self, margin: float, left: float, landing: tuple[float, float] | None, stands: bool, most: float = 1.0
    ) -> None:
        """The pace of this tick: as fast as asked, as slow as the hands need.

        Args:
            margin, left, landing, most: as of :func:`wanted_pace`. stands: the body is to come to rest.
        """
        wanted = wanted_pace(self._stops, margin, left, landing, most)
        self.wanted = 0.0 if stands else wanted
        self.pace = max(
            self.pace + min(max(self.wanted - self.pace, -self._dt / self._stops.brake), self._dt / self._stops.ramp),
            0.0,
        )

    def go(self, path: BodyPath, begin: float) -> tuple[Array, float]:
        """A tick along a path from a path time on [s]: what the stack follows, as of :meth:`BodyCommand.go`, and the
        path time as it ends.
        """
        end = min(begin + self.pace * self._dt, path.duration)
        return self._command.go(path, begin, end), end
