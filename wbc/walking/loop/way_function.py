"""A tick's step along a body path, as one expression: where the body's target is, and how fast it moves."""

from __future__ import annotations

import functools

import casadi as ca

from wbc.native.compiled_function import compiled
from wbc.symbolic.rotations import exp3, from_quaternion, left_jacobian, left_jacobian_inverse, log3, to_quaternion

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
