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


def wrist_angles(z: Array, x: Array | None, theta4: Any) -> Array:
    """theta4 to theta6 of both wrists ``[N, b, 2, 3]`` from the hand's z axis (and x axis) in frame 3 ``[N, b, 3]``."""
    sine = np.hypot(z[..., 0], z[..., 1])
    chosen = np.broadcast_to(validation.real_array("theta4", theta4), z.shape[:1])[:, None]
    out = np.zeros((*z.shape[:-1], 2, 3))
    for k, sign in enumerate((1.0, -1.0)):
        fourth = np.where(sine > ALIGNED, np.arctan2(sign * z[..., 1], sign * z[..., 0]), chosen)
        fifth = np.arctan2(sign * sine, z[..., 2])
        out[..., k, 0], out[..., k, 1] = fourth, fifth
        if x is not None:
            (s4, c4), (s5, c5) = sines(fourth), sines(fifth)
            across = c4 * x[..., 1] - s4 * x[..., 0]
            along = c4 * c5 * x[..., 0] + s4 * c5 * x[..., 1] - s5 * x[..., 2]
            out[..., k, 2] = np.arctan2(across, along)
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
    """The branches asked for: 1, -1 or both.

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
