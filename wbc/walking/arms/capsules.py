"""Distances of the middle lines of capsules, many at once."""

from __future__ import annotations

import numpy as np

from wbc.validation import Array


def segment_distances(a: Array, b: Array, c: Array, d: Array) -> Array:
    """Distances between segments a-b and c-d, ``[..., 3]`` each: clamped parameters of the nearest points."""
    u, v, w = b - a, d - c, a - c
    uu, vv, uv = (u * u).sum(-1), (v * v).sum(-1), (u * v).sum(-1)
    uw, vw = (u * w).sum(-1), (v * w).sum(-1)
    det = uu * vv - uv * uv
    with np.errstate(divide="ignore", invalid="ignore"):
        s = np.where(det > 1e-12 * uu * vv, np.clip((uv * vw - vv * uw) / det, 0.0, 1.0), 0.0)
        t = np.where(vv > 0, (uv * s + vw) / vv, 0.0)
        clipped = np.clip(t, 0.0, 1.0)
        s = np.where(clipped == t, s, np.where(uu > 0, np.clip((uv * clipped - uw) / uu, 0.0, 1.0), 0.0))
    gap = w + s[..., None] * u - clipped[..., None] * v
    out: Array = np.linalg.norm(gap, axis=-1)
    return out
