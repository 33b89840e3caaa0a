"""Compliant holds: how far, and in which direction, a hand leans on them so that its wrist comes into reach."""

from __future__ import annotations

import numpy as np

from wbc.robots import BodyLimb
from wbc.validation import Array

#: What plan and loop use of max_tilt; the rest is for the time between two ticks
TILT_PART = 0.9
#: Holds with less [rad] are held without tilt: a cone this narrow is none
LEAST_TILT = 0.002


def leaning(limb: BodyLimb, points: Array, axes: Array, tilts: Array, wanted: float) -> Array:
    """Axes of hands that lean by no more than they need, and than they may, to bring the wrist within reach.

    The wrist is at p - HW a. Turned towards g, the direction from the pivot to the wrist, less its part along a, by an
    angle tau the axis brings the wrist nearer by HW tau |g|, so

        tau = (wanted - reach) / (HW |g|),   0 <= tau <= TILT_PART max_tilt

    Args:
        points, axes: of the hands in the arm's base ``[n, 3]``. tilts: max_tilt of the holds ``[n]`` [rad].
        wanted: reach that they lean for [m]; see :meth:`wbc.robots.BodyLimb.wrist_reach`.
    """
    if (tilts < LEAST_TILT).all():
        return axes
    wrists = limb.wrist_of(points, axes)
    lack = wanted - limb.wrist_reach(wrists)
    need = (lack > 0.0) & (tilts >= LEAST_TILT)
    if not need.any():
        return axes
    out, a = axes.copy(), axes[need]
    away = wrists[need] - limb.pivot
    away /= np.linalg.norm(away, axis=1)[:, None]
    across = away - (away * a).sum(axis=1)[:, None] * a
    size = np.maximum(np.linalg.norm(across, axis=1), 1e-6)
    angle = np.minimum(lack[need] / (limb.hand_length * size), TILT_PART * tilts[need])
    out[need] = np.cos(angle)[:, None] * a + np.sin(angle)[:, None] * across / size[:, None]
    return out
