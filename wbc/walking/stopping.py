"""How far a body and a hand can travel after an abort."""

from __future__ import annotations

import numpy as np

from wbc.validation import Array
from wbc.walking.plan import Plan
from wbc.walking.walk_hands import BEHIND, HAND_STOP

#: A body comes to rest from full pace in [s]
BRAKE = 0.25
#: What a body may be off its way at the end of a stop [m]
OFF = 0.002


def body_stop(places: Array, spacing: float, at: Array, pace: float, dt: float, behind: float) -> Array:
    """Of a body's origin [m]: its way while the pace p falls to 0, which is p^2 BRAKE / 2 of path time, and a tick;
    what it is behind now; and :data:`OFF`.

    Args:
        places: of the body ``[n, 3]`` [m], ``spacing`` [s] of path time apart. at: path times of the abort [s].
        behind: [m].
    """
    return _way(places, spacing, at, 0.5 * pace**2 * BRAKE + pace * dt) + behind + OFF


def hand_stop(places: Array, spacing: float, at: Array, pace: float, dt: float, behind: float) -> Array:
    """Of a hand [m]: as :func:`body_stop` with HAND_STOP for BRAKE, and at the end :data:`BEHIND`, as the arm was
    planned for the way at full pace and not for the stop.
    """
    return _way(places, spacing, at, 0.5 * pace**2 * HAND_STOP + pace * dt) + behind + BEHIND


def longest_stop(plan: Plan, dt: float) -> tuple[float, float]:
    """The most that :func:`body_stop` and :func:`hand_stop` say anywhere in a plan [m], at full pace.

    The body may be :data:`OFF` behind, a hand :data:`BEHIND`. Of a hand that is brought to where a plan begins,
    ``MovingBody.stopping`` knows.
    """
    path = plan.path
    body = body_stop(path.poses[:, :3, 3], path.spacing, _times(path.poses, path.spacing), 1.0, dt, OFF)
    return float(body.max()), max((longest_hand_stop(law.places, law.spacing, dt) for law in plan.laws), default=0.0)


def longest_hand_stop(places: Array, spacing: float, dt: float) -> float:
    """The most that :func:`hand_stop` says anywhere on a hand's way [m], at full pace and :data:`BEHIND` behind."""
    return float(hand_stop(places, spacing, _times(places, spacing), 1.0, dt, BEHIND).max())


def _times(places: Array, spacing: float) -> Array:
    return np.arange(len(places), dtype=np.float64) * spacing


def _way(places: Array, spacing: float, at: Array, left: float) -> Array:
    """Lengths [m] of the ways that are covered in ``left`` [s] from some times on."""
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    times, lengths = _times(places, spacing), np.concatenate([[0.0], np.cumsum(steps)])
    out: Array = np.interp(at + left, times, lengths) - np.interp(at, times, lengths)
    return out
