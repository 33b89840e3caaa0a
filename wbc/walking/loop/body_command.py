"""The body's command from tick to tick along its path."""

from __future__ import annotations

import functools

import casadi as ca
import numpy as np
import pinocchio as pin

from wbc.native.compiled_function import compiled
from wbc.stack.evaluation import SingleState
from wbc.symbolic.rotations import exp3, from_quaternion, left_jacobian, left_jacobian_inverse, log3, to_quaternion
from wbc.validation import Array
from wbc.walking.body_path import BodyPath

#: Where things are in the output: the target and its rate, and where it is afterwards as numbers and as position and
#: quaternion
TARGET, AFTER, POSE = slice(0, 18), slice(18, 30), slice(30, 37)


@functools.cache
def way_function() -> ca.Function:
    """f(now, first, last, part, rate), poses as 12 numbers: the rotation by columns, the position.

    The body is at M exp(s log(M' N)) when it has come the part s of the way from M to N; its rate from where it is now
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
    return compiled(ca.Function("way", [now, first, last, part, rate], [out]))


class BodyCommand:
    """Where the body is to be as a tick begins, how fast it is to move, and where it is then as the tick ends.

    Args:
        dt: control period [s].

    Attributes:
        pose: at the end of the tick: position [m] and quaternion x, y, z, w.
    """

    def __init__(self, dt: float) -> None:
        self._step = SingleState(way_function())
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
