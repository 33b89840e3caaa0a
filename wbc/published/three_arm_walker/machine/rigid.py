"""Vectors and rigid poses, 4 x 4: what numpy does slowly one at a time."""

from __future__ import annotations

import numpy as np

from wbc.validation import Array


def cross(a: Array, b: Array) -> Array:
    """a x b of two vectors of 3."""
    x, y, z = a
    u, v, w = b
    return np.array([y * w - z * v, z * u - x * w, x * v - y * u])


def inverse(pose: Array) -> Array:
    """Of a rigid pose."""
    out = np.eye(4)
    out[:3, :3] = pose[:3, :3].T
    out[:3, 3] = -out[:3, :3] @ pose[:3, 3]
    return out
