"""Rotations in Pinocchio's conventions, as numbers: quaternions x, y, z, w, rotation vectors, roll, pitch and yaw."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Below this angle [rad] series take the place of quotients whose terms cancel; what they leave out is below 1e-16
SMALL = 1e-4
#: cos + 1 of vectors that point apart, below which any axis across them turns one into the other
APART = 1e-12


def vector(value: Any, count: int) -> Array:
    """A copy of so many numbers.

    Raises:
        ValueError: another count.
    """
    out = np.array(value, dtype=np.float64)
    if out.size != count:
        raise ValueError(f"expected {count} numbers, got the shape {out.shape}")
    return out.reshape(count)


def skew(v: Any) -> Array:
    """The matrix that crosses: skew(v) w = v x w."""
    x, y, z = vector(v, 3).tolist()
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def turn_about(axis: Array, cosine: float, sine: float) -> Array:
    """R = c 1 + s [a] + (1 - c) a a' of a unit vector a, by Rodrigues."""
    x, y, z = axis.tolist()
    rest = 1.0 - cosine
    return np.array(
        [
            [cosine + rest * x * x, rest * x * y - sine * z, rest * x * z + sine * y],
            [rest * x * y + sine * z, cosine + rest * y * y, rest * y * z - sine * x],
            [rest * x * z - sine * y, rest * y * z + sine * x, cosine + rest * z * z],
        ]
    )


def quaternion_matrix(q: Any) -> Array:
    """The rotation matrix of a unit quaternion x, y, z, w."""
    x, y, z, w = (float(number) for number in q)
    tx, ty, tz = 2.0 * x, 2.0 * y, 2.0 * z
    return np.array(
        [
            [1.0 - (ty * y + tz * z), ty * x - tz * w, tz * x + ty * w],
            [ty * x + tz * w, 1.0 - (tx * x + tz * z), tz * y - tx * w],
            [tz * x - ty * w, tz * y + tx * w, 1.0 - (tx * x + ty * y)],
        ]
    )


def matrix_quaternion(rotation: Any) -> Array:
    """The quaternion x, y, z, w of a rotation matrix, by the largest of its four numbers (Shepperd 1978)."""
    m = np.asarray(rotation, dtype=np.float64)
    trace = float(m[0, 0] + m[1, 1] + m[2, 2])
    out = np.empty(4)
    if trace > 0.0:
        root = math.sqrt(trace + 1.0)
        out[3] = 0.5 * root
        out[:3] = (0.5 / root) * np.array([m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]])
        return out
    i = int(np.argmax(np.diagonal(m)))
    j, k = (i + 1) % 3, (i + 2) % 3
    root = math.sqrt(m[i, i] - m[j, j] - m[k, k] + 1.0)
    out[i] = 0.5 * root
    out[[3, j, k]] = (0.5 / root) * np.array([m[k, j] - m[j, k], m[j, i] + m[i, j], m[k, i] + m[i, k]])
    return out


def product(a: Any, b: Any) -> Array:
    """The quaternion a b."""
    ax, ay, az, aw = (float(number) for number in a)
    bx, by, bz, bw = (float(number) for number in b)
    return np.array(
        [
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by + ay * bw + az * bx - ax * bz,
            aw * bz + az * bw + ax * by - ay * bx,
            aw * bw - ax * bx - ay * by - az * bz,
        ]
    )


def quaternion_exp(turn: Any) -> Array:
    """The quaternion of a rotation vector."""
    x, y, z = (float(number) for number in turn)
    angle = math.sqrt(x * x + y * y + z * z)
    share = math.sin(0.5 * angle) / angle if angle > SMALL else 0.5 - angle * angle / 48.0
    return np.array([share * x, share * y, share * z, math.cos(0.5 * angle)])


def quaternion_log(q: Any) -> Array:
    """The rotation vector, at most a half turn, of a unit quaternion."""
    x, y, z, w = (float(number) for number in q)
    sine = math.sqrt(x * x + y * y + z * z)
    sign = -1.0 if w < 0.0 else 1.0
    if sine > SMALL:
        share = 2.0 * math.atan2(sine, sign * w) / sine
    else:
        share = 2.0 / abs(w) * (1.0 - sine * sine / (3.0 * w * w))
    return np.array([sign * share * x, sign * share * y, sign * share * z])


def exp3(turn: Any) -> Array:
    """The rotation matrix of a rotation vector."""
    w = vector(turn, 3)
    angle = math.sqrt(float(w @ w))
    if angle > SMALL:
        return turn_about(w / angle, math.cos(angle), math.sin(angle))
    cross = skew(w)
    return np.asarray(np.eye(3) + (1.0 - angle * angle / 6.0) * cross + 0.5 * (cross @ cross))


def log3(rotation: Any) -> Array:
    """The rotation vector, at most a half turn, of a rotation matrix."""
    q = matrix_quaternion(rotation)
    return quaternion_log(q / math.sqrt(float(q @ q)))


def _shares(angle: float) -> tuple[float, float]:
    """(1 - cos t) / t^2 and (t - sin t) / t^3."""
    square = angle * angle
    if angle > 10.0 * SMALL:
        half = math.sin(0.5 * angle)
        return 2.0 * half * half / square, (angle - math.sin(angle)) / (square * angle)
    return 0.5 - square / 24.0, (1.0 - square / 20.0) / 6.0


def left_jacobian(turn: Any) -> Array:
    """Jl with exp3(r + d) = exp3(Jl(r) d) exp3(r), to first order in d."""
    w = vector(turn, 3)
    first, second = _shares(math.sqrt(float(w @ w)))
    cross = skew(w)
    return np.asarray(np.eye(3) + first * cross + second * (cross @ cross))


def left_jacobian_inverse(turn: Any) -> Array:
    """The inverse of :func:`left_jacobian`."""
    w = vector(turn, 3)
    angle, cross = math.sqrt(float(w @ w)), skew(w)
    if angle > 10.0 * SMALL:
        share = (1.0 - 0.5 * angle / math.tan(0.5 * angle)) / (angle * angle)
    else:
        share = (1.0 + angle * angle / 60.0) / 12.0
    return np.asarray(np.eye(3) - 0.5 * cross + share * (cross @ cross))


def Jexp3(turn: Any) -> Array:
    """Jr with exp3(r + d) = exp3(r) exp3(Jr(r) d), to first order in d."""
    return left_jacobian(-vector(turn, 3))


def rpy_matrix(*angles: Any) -> Array:
    """R = Rz(yaw) Ry(pitch) Rx(roll)."""
    roll, pitch, yaw = vector(angles[0] if len(angles) == 1 else angles, 3).tolist()
    return np.asarray(axis_turn("z", yaw) @ axis_turn("y", pitch) @ axis_turn("x", roll))


def matrix_rpy(rotation: Any) -> Array:
    """roll, pitch in [-pi/2, pi/2] and yaw of a rotation matrix; at a pitch of a quarter turn roll is 0."""
    m = np.asarray(rotation, dtype=np.float64)
    upright = math.hypot(m[0, 0], m[1, 0])
    pitch = math.atan2(-m[2, 0], upright)
    if upright < APART:
        return np.array([0.0, pitch, math.atan2(-m[0, 1], m[1, 1])])
    return np.array([math.atan2(m[2, 1], m[2, 2]), pitch, math.atan2(m[1, 0], m[0, 0])])


def axis_turn(axis: str, angle: float) -> Array:
    """A turn about the axis x, y or z.

    Raises:
        ValueError: another axis.
    """
    return turn_about(np.eye(3)["xyz".index(axis)], math.cos(angle), math.sin(angle))


def least_turn(a: Any, b: Any) -> Array:
    """The quaternion of the least turn that takes the direction of a to that of b; where one of them is 0, which has no
    direction, Pinocchio's (0, 0, 0, sqrt(1/2)), which is no rotation.
    """
    first, second = (x / (float(np.linalg.norm(x)) or 1.0) for x in (vector(a, 3), vector(b, 3)))
    cosine = float(first @ second)
    if cosine < APART - 1.0:
        # Half a turn about any axis across takes a to -a, and the rest is small
        across = np.cross(first, np.eye(3)[int(np.argmin(np.abs(first)))])
        return product(least_turn(-first, second), np.append(across / np.linalg.norm(across), 0.0))
    root = math.sqrt(2.0 * (1.0 + cosine))
    return np.append(np.cross(first, second) / root, 0.5 * root)
