"""How joints come to rest: evenly, as fast as they can, or as the hand that they bring stays on its hold."""

from __future__ import annotations

import numpy as np

from wbc.robots import BodyLimb
from wbc.validation import Array

#: An arm that is farther than this from where its hand has it is not known [rad]
KNOWN = 0.02


def fallen(times: Array, stop: float) -> Array:
    """f at times, of what is at rest at ``stop`` [s], see :class:`wbc.walking.loop.coasting.Coasting`."""
    t = np.minimum(times, stop)
    return np.asarray(t - t * t / (2.0 * stop))


def quickest(q: Array, rates: Array, end: Array, most: Array, dt: float, least: float = 0.0) -> Array:
    """Joints with rates that go to rest at ``end``, each with its acceleration a, at first one way and then the other:

        v_1 = s sqrt(v^2 / 2 + s a (q_end - q)),     s = sign(q_end - q - v |v| / (2 a))

    Args:
        q, end: [rad]. rates: v [rad/s]. most: a [rad/s^2]. dt: from row to row [s]. least: time of all rows [s].

    Returns:
        Rows until all are at rest ``[n, joints]`` [rad].
    """
    way = end - q
    s = np.where(way - rates * np.abs(rates) / (2.0 * most) >= 0.0, 1.0, -1.0)
    between = s * np.sqrt(np.maximum(0.5 * rates * rates + s * most * way, 0.0))
    first, then = np.maximum(s * (between - rates) / most, 0.0), np.abs(between) / most
    times = dt * np.arange(np.ceil(max(float((first + then).max()), least) / dt - 1e-9) + 1)[:, None]
    one, two = np.minimum(times, first), np.clip(times - first, 0.0, then)
    rows: Array = q + rates * one + 0.5 * s * most * one**2 + between * two - 0.5 * s * most * two**2
    return rows


def kept(limb: BodyLimb, frames: Array, posture: Array, place: Array, axis: Array) -> Array | None:
    """Postures of an arm whose hand stays at a place along its axis, as its base goes ``[k, 4, 4]``; None where it
    would be pulled out of its reach, or where the posture is not one of the hand.

    Args:
        posture: at the first frame [rad]. place, axis: of the hand, where the frames are.
    """
    turns = frames[:, :3, :3]
    points, axes = np.einsum("kji,kj->ki", turns, place - frames[:, :3, 3]), np.einsum("kji,j->ki", turns, axis)
    found, solved = limb.held(points, axes)
    branch = int(np.abs(found[0, :, :-1] - posture[:-1]).max(axis=1).argmin())
    rows = np.unwrap(found[:, branch], axis=0)
    rows[:, -1] = posture[-1]
    if not solved[:, branch].all() or np.abs(rows[0] - posture).max() > KNOWN or (limb.elbow_bend(rows) <= 0.0).any():
        return None
    return np.asarray(rows)
