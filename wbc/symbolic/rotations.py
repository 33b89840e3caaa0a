"""Rotations as CasADi expressions: exact maps whose derivatives exist wherever the map does."""

from __future__ import annotations

from functools import lru_cache

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from wbc import rotations

#: Entries of a constant rotation or translation closer than this to 0 or +-1 are that number:
#: a quarter turn written in floating point leaves 6e-17, which would cost an operation each.
SNAP = 1e-14

_EYE = np.eye(3)


def constant(matrix: ArrayLike) -> ca.SX:
    """A constant as a sparse SX, with rounding dust removed (see :data:`SNAP`)."""
    array = np.array(matrix, dtype=float)
    for special in (0.0, 1.0, -1.0):
        array[np.abs(array - special) < SNAP] = special
    shape = array.shape if array.ndim == 2 else (array.size, 1)
    # A copy: an SX can be changed in place
    # +: a copy, as an SX can be changed in place
    return +_constant(shape, array.tobytes())


@lru_cache(maxsize=4096)
def _constant(shape: tuple[int, int], entries: bytes) -> ca.SX:
    """Kept, because a robot's placements are asked for once an item."""
    array = np.frombuffer(entries).reshape(shape)
    if not array.any():
        return ca.SX(*shape)
    if shape == (3, 3) and np.array_equal(array, _EYE):
        return ca.SX.eye(3)
    return ca.SX(ca.sparsify(ca.DM(array)))


def skew(w: ca.SX) -> ca.SX:
    """[w]x with [w]x a = w x a."""
    return ca.skew(w)


def rotation_rate(rotation: ca.SX) -> ca.SX:
    """9x3 map from an angular velocity in the outer axes to d vec(R)/dt = vec([w]x R), columns first."""
    return _turned()(rotation)


@lru_cache(maxsize=1)
def _turned() -> ca.Function:
    """R -> the map, kept because one call costs less than the operations."""
    rotation = ca.SX.sym("R", 3, 3)
    turns = [ca.skew(ca.SX(ca.sparsify(ca.DM(axis)))) for axis in _EYE]
    return ca.Function("turned", [rotation], [ca.horzcat(*(ca.vec(turn @ rotation) for turn in turns))])


def from_axis_angle(axis: ArrayLike, cos: ca.SX, sin: ca.SX) -> ca.SX:
    """R = aa' + cos(t) (1 - aa') + sin(t) [a]x for a constant unit axis a (Rodrigues)."""
    return _axis_angle(tuple(np.array(axis, dtype=float).tolist()))(cos, sin)


@lru_cache(maxsize=256)
def _axis_angle(axis: tuple[float, float, float]) -> ca.Function:
    """(cos, sin) -> R, kept because one call costs less than the six matrix operations."""
    a = np.array(axis)
    cos, sin = ca.SX.sym("cos"), ca.SX.sym("sin")
    hat = np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])
    outer = np.outer(a, a)
    turn = constant(outer) + constant(_EYE - outer) * cos + constant(hat) * sin
    return ca.Function("axis_angle", [cos, sin], [turn])


def from_quaternion(quat: ca.SX) -> ca.SX:
    """Rotation of a unit quaternion (x, y, z, w)."""
    x, y, z, w = (quat[i] for i in range(4))
    return ca.vertcat(
        ca.horzcat(1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
        ca.horzcat(2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
        ca.horzcat(2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
    )


def _sign_of_scalar(quat: ca.SX) -> ca.SX:
    """The sign that keeps |angle| <= pi; a zero w counts as positive."""
    return ca.if_else(quat[3] < 0, -1, 1)


def _any_quaternion(rotation: ca.SX) -> ca.SX:
    """One of the two unit quaternions of a rotation: the one with its largest entry positive."""
    r = rotation
    trace = r[0, 0] + r[1, 1] + r[2, 2]
    t = ca.sqrt(ca.fmax(1 + trace, 1e-2))
    half = 0.5 / t
    skewed = ca.vertcat(r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1])
    chosen, best = ca.vertcat(skewed * half, 0.5 * t), trace
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        # The pivot 4 quat[i]^2 is at least 1 where this branch is taken
        t = ca.sqrt(ca.fmax(1 + r[i, i] - r[j, j] - r[k, k], 1e-2))
        half = 0.5 / t
        entries: list[ca.SX] = [ca.SX(0)] * 4
        entries[i] = 0.5 * t
        entries[j] = (r[j, i] + r[i, j]) * half
        entries[k] = (r[k, i] + r[i, k]) * half
        entries[3] = skewed[i] * half
        chosen = ca.if_else(r[i, i] > best, ca.vertcat(*entries), chosen)
        best = ca.fmax(r[i, i], best)
    return chosen


def log3(rotation: ca.SX) -> ca.SX:
    """Rotation vector theta * axis of ``rotation``, |theta| <= pi, exact near 0 and near pi.

    See :func:`log_quaternion`; discontinuous at theta = pi, as the logarithm is.
    """
    return log_quaternion(_any_quaternion(rotation))


def log_quaternion(quat: ca.SX) -> ca.SX:
    """Rotation vector of a unit quaternion (x, y, z, w), |theta| <= pi; q and -q give the same.

    log = 2 atan2(s, w) / s * (x, y, z) with s = |(x, y, z)| and the sign of q that makes w >= 0; below
    s^2 = 1e-6 the factor is its series 2/w (1 - s^2 / (3 w^2) + s^4 / (5 w^4)).
    """
    sign = _sign_of_scalar(quat)
    vec, w = quat[:3], sign * quat[3]
    square = ca.dot(vec, vec)
    small = square < 1e-6
    safe = ca.sqrt(ca.if_else(small, 1.0, square))
    ratio = square / ca.if_else(small, w * w, 1.0)
    series = 2 / ca.if_else(small, w, 1.0) * (1 - ratio / 3 + ratio * ratio / 5)
    return sign * ca.if_else(small, series, 2 * ca.atan2(safe, w) / safe) * vec


def exp3(vector: ca.SX) -> ca.SX:
    """Unit quaternion (x, y, z, w) of a rotation vector, with its series below |vector|^2 = 1e-8."""
    square = ca.dot(vector, vector)
    small = square < 1e-8
    angle = ca.sqrt(ca.if_else(small, 1.0, square))
    factor = ca.if_else(small, 0.5 - square / 48, ca.sin(angle / 2) / angle)
    scalar = ca.if_else(small, 1 - square / 8, ca.cos(angle / 2))
    return ca.vertcat(factor * vector, scalar)


def quaternion_product(a: ca.SX, b: ca.SX) -> ca.SX:
    """Hamilton product a * b of quaternions (x, y, z, w)."""
    return ca.SX(ca.vertcat(*rotations.quaternion_product(ca.vertsplit(a), ca.vertsplit(b))))


def quaternion_conjugate(quat: ca.SX) -> ca.SX:
    """The inverse of a unit quaternion (x, y, z, w)."""
    return ca.vertcat(-quat[:3], quat[3])


def left_jacobian(w: ca.SX) -> ca.SX:
    """V(w) of the SE(3) exponential: 1 + (1 - cos t)/t^2 [w]x + (t - sin t)/t^3 [w]x^2, series below t^2 = 1e-4."""
    square = ca.dot(w, w)
    small = square < 1e-4
    t = ca.sqrt(ca.if_else(small, 1.0, square))
    a = ca.if_else(small, 0.5 - square / 24 + square**2 / 720, (1 - ca.cos(t)) / t**2)
    b = ca.if_else(small, 1 / 6 - square / 120 + square**2 / 5040, (t - ca.sin(t)) / t**3)
    hat = skew(w)
    return ca.SX(ca.DM.eye(3)) + a * hat + b * (hat @ hat)


def left_jacobian_inverse(w: ca.SX) -> ca.SX:
    """Inverse of :func:`left_jacobian`, finite up to |w| = pi."""
    square = ca.dot(w, w)
    small = square < 1e-4
    t = ca.sqrt(ca.if_else(small, 1.0, square))
    half = t / 2
    exact = (1 - half * ca.cos(half) / ca.sin(half)) / t**2
    c = ca.if_else(small, 1 / 12 + square / 720 + square**2 / 30240, exact)
    hat = skew(w)
    return ca.SX(ca.DM.eye(3)) - 0.5 * hat + c * (hat @ hat)
