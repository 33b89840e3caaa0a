"""Angles and rotations of the walker's arm, for many postures at once."""

from __future__ import annotations

from collections.abc import Sequence
from math import pi
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import ShapeError
from wbc.validation import Array

#: \|sin theta5\| below which joints 4 and 6 turn about one axis
ALIGNED = 1e-9


def frame3(q: Array) -> Array:
    """Rotation of frame 3 in the arm's base, ``[..., 3, 3]``: Rz(theta1) Ry(theta2 + theta3)."""
    (s1, c1), (s, c) = sines(q[..., 0]), sines(q[..., 1] + q[..., 2])
    zero = np.zeros_like(c1)
    rows = [[c1 * c, -s1, c1 * s], [s1 * c, c1, s1 * s], [-s, zero, c]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def wrist_angles(first: Array, z: Array, x: Array | None, theta4: Any) -> Array:
    """theta4 to theta6 of both wrists, ``[N, b, 2, 3]``: theta5 >= 0, then theta5 < 0.

    ``first`` are theta1 to theta3 ``[N, b, 3]``; ``z`` and ``x`` the hand's axes in the base ``[N, 3]``, x None for
    theta6 = 0. In frame 3 the z axis is (c4 s5, s4 s5, c5). The second wrist is (theta4 + pi, -theta5, theta6 + pi);
    where theta5 = 0, theta4 is as given and the two are one.

    Raises:
        ShapeError, NotFiniteError: theta4 that is neither a number nor N of them.
    """
    turn = sines(first[..., 0]), sines(first[..., 1] + first[..., 2])
    zx, zy, zz = _in_frame3(turn, z)
    sine = np.hypot(zx, zy)
    aligned = sine <= ALIGNED
    chosen = validation.real_array("theta4", theta4)
    if chosen.shape not in ((), z.shape[:1]):
        raise ShapeError("theta4", theta4, f"expected one number, or {len(z)}")
    fourth = np.where(aligned, chosen.reshape(-1, 1), np.arctan2(zy, zx))
    out = np.zeros((*sine.shape, 2, 3))
    out[..., 0, 0], out[..., 0, 1] = fourth, np.arctan2(sine, zz)
    out[..., 1, 0], out[..., 1, 1] = np.where(aligned, fourth, _opposite(fourth)), -out[..., 0, 1]
    if x is not None:
        xx, xy, xz = _in_frame3(turn, x)
        s4, c4 = sines(fourth)
        sixth = np.arctan2(c4 * xy - s4 * xx, zz * (c4 * xx + s4 * xy) - sine * xz)
        out[..., 0, 2], out[..., 1, 2] = sixth, np.where(aligned, sixth, _opposite(sixth))
    return out


def _in_frame3(turn: tuple[tuple[Array, Array], tuple[Array, Array]], vector: Array) -> tuple[Array, Array, Array]:
    """Components of vectors ``[N, 3]`` along the axes of frame 3, ``[N, b]`` each."""
    (s1, c1), (s, c) = turn
    vx, vy, vz = vector[:, :1], vector[:, 1:2], vector[:, 2:]
    outward = c1 * vx + s1 * vy
    return c * outward - s * vz, c1 * vy - s1 * vx, s * outward + c * vz


def _opposite(angle: Array) -> Array:
    """Angles turned by half a turn, within (-pi, pi]."""
    return np.where(angle > 0, angle - pi, angle + pi)


def hand_poses(points: Array, axes: Array, references: Array) -> Array:
    """Homogeneous matrices ``[n, 4, 4]`` of hands at points along axes, x as near to the references as it can be."""
    across = references - (references * axes).sum(axis=1)[:, None] * axes
    out = np.zeros((len(points), 4, 4))
    out[:, :3, 0] = across / np.linalg.norm(across, axis=1)[:, None]
    out[:, :3, 1], out[:, :3, 2] = np.cross(axes, out[:, :3, 0]), axes
    out[:, :3, 3], out[:, 3, 3] = points, 1.0
    return out


def zyz(a: Array, b: Array, c: Array) -> Array:
    """Rz(a) Ry(b) Rz(c), ``[..., 3, 3]``."""
    (sa, ca), (sb, cb), (sc, cc) = sines(a), sines(b), sines(c)
    rows = [
        [ca * cb * cc - sa * sc, -ca * cb * sc - sa * cc, ca * sb],
        [sa * cb * cc + ca * sc, -sa * cb * sc + ca * cc, sa * sb],
        [-sb * cc, sb * sc, cb],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def sines(angle: Array) -> tuple[Array, Array]:
    """Sine and cosine."""
    return np.sin(angle), np.cos(angle)


def wrapped(angle: Array) -> Array:
    """Angles in (-pi, pi]."""
    out: Array = pi - (pi - angle) % (2 * pi)
    return out


def checked_signs(field_name: str, values: Sequence[int]) -> tuple[int, ...]:
    """The requested branches: 1, -1 or both.

    Raises:
        ShapeError: something else.
    """
    signs = tuple(values)
    if not signs or any(sign not in (1, -1) for sign in signs):
        raise ShapeError(field_name, values, "expected 1, -1 or both")
    return signs


def vectors(field_name: str, value: Any, tail: tuple[int, ...]) -> Array:
    """An array whose last axes are ``tail``.

    Raises:
        ShapeError, NotFiniteError: something else.
    """
    array = validation.real_array(field_name, value)
    if array.shape[-len(tail) :] != tail:
        raise ShapeError(field_name, value, f"expected an array whose last axes are {tail}")
    return array


def unit_vectors(field_name: str, value: Any) -> Array:
    """Directions ``[n, 3]``.

    Raises:
        ShapeError, NotFiniteError: something else, or not of unit length.
    """
    array = vectors(field_name, value, (3,)).reshape(-1, 3)
    if (np.abs((array**2).sum(axis=-1) - 1.0) > validation.ROTATION_TOLERANCE).any():
        raise ShapeError(field_name, value, "expected directions of unit length")
    return array
