"""The body along its path: its command from tick to tick, and how fast it goes on."""

from __future__ import annotations

import functools
from math import sqrt

import casadi as ca
import numpy as np
import pinocchio as pin

from wbc.native.compiled_function import compiled
from wbc.stack.evaluation import SingleState
from wbc.symbolic.rotations import exp3, from_quaternion, left_jacobian, left_jacobian_inverse, log3, to_quaternion
from wbc.validation import Array
from wbc.walking.body_path import BodyPath
from wbc.walking.loop.stopping import Stops

#: Where things are in the output: the target and its rate, and where it is afterwards as numbers and as position and
#: quaternion
TARGET, AFTER, POSE = slice(0, 18), slice(18, 30), slice(30, 37)


@functools.cache
def pose_function() -> ca.Function:
    """f(now, first, last, part, rate), poses as 12 numbers: the rotation by columns, the position.

    The body is at M exp(s log(M' N)) when it has come the part s from M to N; its rate from where it is now
    on is (p' - p, R log(R' R')) / dt in the structure's axes.

    Args:
        now: at the beginning of the tick. first, last: M and N. part: s at the end of the tick. rate: 1 / dt [1/s].

    Returns:
        now, its rate ``[6]``, the pose afterwards ``[12]``, and its position and quaternion x, y, z, w ``[7]``.
    """
    sizes = {"now": 12, "first": 12, "last": 12, "part": 1, "rate": 1}
    now, first, last, part, rate = (ca.SX.sym(name, size) for name, size in sizes.items())
    turns, places = zip(*((ca.reshape(pose[:9], 3, 3), pose[9:]) for pose in (now, first, last)), strict=True)
    angular = log3(turns[1].T @ turns[2])
    linear = left_jacobian_inverse(angular) @ (turns[1].T @ (places[2] - places[1]))
    turned = turns[1] @ from_quaternion(exp3(part * angular))
    moved = places[1] + turns[1] @ (left_jacobian(part * angular) @ (part * linear))
    speed = ca.vertcat(moved - places[0], turns[0] @ log3(turns[0].T @ turned)) * rate
    out = ca.vertcat(now, speed, ca.vec(turned), moved, moved, to_quaternion(turned))
    return compiled(ca.Function("pose", [now, first, last, part, rate], [out]))


class BodyCommand:
    """Where the body is to be as a tick begins, how fast it is to move, and where it is then as the tick ends.

    Args:
        dt: control period [s].

    Attributes:
        pose: at the end of the tick: position [m] and quaternion x, y, z, w.
    """

    def __init__(self, dt: float) -> None:
        self._step = SingleState(pose_function())
        self._now, self._first, self._last, self._part, rate = self._step.inputs
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
        row, part = path.place(end)
        self._part[0] = part
        if row != self._row:
            self._first[:], self._last[:] = path.numbers[row : row + 2]
            self._row = row
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
#: By which the body's velocity may change where its path has a corner [m/s, rad/s]: half of what a checker allows
CORNER = 0.01


class Corners:
    """How fast a path may be followed: where its rate jumps by d from one sample to the next, the pace is at most
    CORNER / d, and before it as much as can be braked in time.

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
        most = np.ones(len(path.poses))
        most[1:-1] = np.minimum(CORNER / np.maximum(jumps, CORNER), 1.0)
        reach = most**2 + self._gain * path.spacing * np.arange(len(most))
        self._reach: list[float] = np.minimum.accumulate(reach[::-1])[::-1].tolist()

    def pace(self, u: float) -> float:
        """The greatest at a path time [s]."""
        row = min(int(u / self.path.spacing + 1.0 - 1e-9), len(self._reach) - 1)
        return sqrt(max(self._reach[row] - self._gain * u, 0.0))


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
        """The pace of this tick: as fast as asked, as slow as the hands need. Braking from p in a time T takes
        p^2 T / 2 of path time.

        Args:
            margin: path time until a holding hand reaches the end of its grip [s]. left: until the end of the path or
                of what is planned [s]. landing: path time that is left until the swinging hand has to hold, and the
                time that it needs until then [s]; None: no hand is swinging. stands: the body is to come to rest.
            most: that the path allows.
        """
        brake = self._stops.brake
        wanted = min(1.0, most, sqrt(2.0 * margin / brake * PART), sqrt(2.0 * left / self._stops.ramp * PART))
        if landing is not None and landing[0] < landing[1]:
            wanted = min(wanted, landing[0] / landing[1])
        self.wanted = 0.0 if stands else wanted
        self.pace = max(
            self.pace + min(max(self.wanted - self.pace, -self._dt / brake), self._dt / self._stops.ramp), 0.0
        )

    def go(self, path: BodyPath, begin: float) -> tuple[Array, float]:
        """A tick along a path from a path time on [s]: what the stack follows, as of :meth:`BodyCommand.go`, and the
        path time as it ends.
        """
        end = min(begin + self.pace * self._dt, path.duration)
        return self._command.go(path, begin, end), end
