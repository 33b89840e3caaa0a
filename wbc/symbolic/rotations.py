"""Rotations as CasADi expressions: exact maps whose derivatives exist wherever the map does."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

#: Entries of a constant rotation or translation closer than this to 0 or +-1 are that number:
#: a quarter turn written in floating point leaves 6e-17, which would cost an operation each.
SNAP = 1e-14


def constant(matrix: ArrayLike) -> ca.SX:
    """A constant as a sparse SX, with rounding dust removed (see :data:`SNAP`)."""
    array = np.array(matrix, dtype=float)
    for special in (0.0, 1.0, -1.0):
        array[np.abs(array - special) < SNAP] = special
    return ca.SX(ca.sparsify(ca.DM(array)))


def skew(w: ca.SX) -> ca.SX:
    """[w]x with [w]x a = w x a."""
    return ca.skew(w)


def from_axis_angle(axis: ArrayLike, cos: ca.SX, sin: ca.SX) -> ca.SX:
    """R = 1 + sin(t) [a]x + (1 - cos(t)) [a]x^2 for a constant unit axis (Rodrigues)."""
    a = np.array(axis, dtype=float)
    hat = np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])
    out = ca.SX(3, 3)
    square = hat @ hat
    for i in range(3):
        for j in range(3):
            # aa' + cos (1 - aa') + sin [a]x, entry by entry, so that a coordinate axis leaves no dead terms
            outer = square[i, j] + (1.0 if i == j else 0.0)
            entry = _times(outer, ca.SX(1)) + _times((1.0 if i == j else 0.0) - outer, cos) + _times(hat[i, j], sin)
            if not entry.is_zero():
                out[i, j] = entry
    return out


def from_quaternion(quat: ca.SX) -> ca.SX:
    """Rotation of a unit quaternion (x, y, z, w)."""
    x, y, z, w = (quat[i] for i in range(4))
    return ca.vertcat(
        ca.horzcat(1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
        ca.horzcat(2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
        ca.horzcat(2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
    )


def to_quaternion(rotation: ca.SX) -> ca.SX:
    """Unit quaternion (x, y, z, w), w >= 0, by the branch with the largest pivot (Shepperd 1978).

    Every branch is guarded, so the three that are not taken stay finite in value and derivative.
    """
    r = rotation
    trace = r[0, 0] + r[1, 1] + r[2, 2]
    candidates = (
        (trace, 3),
        (r[0, 0], 0),
        (r[1, 1], 1),
        (r[2, 2], 2),
    )
    quats = []
    for _, which in candidates:
        if which == 3:
            square = 1 + trace
            raw = (r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1])
        else:
            i, j, k = which, (which + 1) % 3, (which + 2) % 3
            square = 1 + r[i, i] - r[j, j] - r[k, k]
        t = ca.sqrt(ca.fmax(square, 1e-2))
        half = 0.5 / t
        if which == 3:
            quats.append(ca.vertcat(raw[0] * half, raw[1] * half, raw[2] * half, 0.5 * t))
        else:
            entries: list[ca.SX] = [ca.SX(0)] * 4
            entries[i] = 0.5 * t
            entries[j] = (r[j, i] + r[i, j]) * half
            entries[k] = (r[k, i] + r[i, k]) * half
            entries[3] = (r[k, j] - r[j, k]) * half
            quats.append(ca.vertcat(*entries))
    chosen, best = quats[0], candidates[0][0]
    for (value, _), quat in zip(candidates[1:], quats[1:], strict=True):
        chosen = ca.if_else(value > best, quat, chosen)
        best = ca.fmax(value, best)
    # Flipping by the sign of w keeps |angle| <= pi; a zero w counts as positive
    return chosen * ca.if_else(chosen[3] < 0, -1, 1)


def log3(rotation: ca.SX) -> ca.SX:
    """Rotation vector theta * axis of ``rotation``, |theta| <= pi, exact near 0 and near pi.

    Through the quaternion (x, y, z, w): log = 2 atan2(s, w) / s * (x, y, z) with s = |(x, y, z)|;
    below s^2 = 1e-6 the factor is its series 2/w (1 - s^2 / (3 w^2) + s^4 / (5 w^4)). Discontinuous at
    theta = pi, as the logarithm is.
    """
    quat = to_quaternion(rotation)
    vec, w = quat[:3], quat[3]
    square = ca.dot(vec, vec)
    small = square < 1e-6
    safe = ca.sqrt(ca.if_else(small, 1.0, square))
    ratio = square / ca.if_else(small, w * w, 1.0)
    series = 2 / ca.if_else(small, w, 1.0) * (1 - ratio / 3 + ratio * ratio / 5)
    return ca.if_else(small, series, 2 * ca.atan2(safe, w) / safe) * vec


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
    av, aw, bv, bw = a[:3], a[3], b[:3], b[3]
    return ca.vertcat(aw * bv + bw * av + ca.cross(av, bv), aw * bw - ca.dot(av, bv))


def _times(factor: float, value: ca.SX) -> ca.SX:
    if abs(factor) < SNAP:
        return ca.SX(0)
    if abs(factor - 1.0) < SNAP:
        return value
    if abs(factor + 1.0) < SNAP:
        return -value
    return factor * value
