"""Where to begin: a configuration at which no pair is near the loss of its rank."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc.coordinates.control.conditioning import Conditioning
from wbc.coordinates.pair import CoordinatePair, pairs_of
from wbc.coordinates.samples import ROUNDING, states_of
from wbc.robot import Robot
from wbc.robot.robot import checked_robot
from wbc.validation import Array

#: Configurations that are looked at
START_STATES = 200
#: The neutral configuration will do where each pair has this part of what is usual for it
ENOUGH = 0.5
#: Part of a joint's range that a start stays away from its ends
MARGIN = 0.1


def regular_start(robot: Robot, pairs: Sequence[CoordinatePair]) -> Array:
    """A configuration away from singular ones: the neutral one, or else the best of 200 within the joints' limits.

    Best is where the smallest of sigma / (median sigma of the pair) is largest, sigma being the least singular value
    of a pair's scaled rows. Pairs that are singular almost everywhere do not count.

    Raises:
        ShapeError: no pairs.
    """
    pairs, neutral = pairs_of(pairs), checked_robot(robot).neutral
    states = [neutral, *(q for q in states_of(robot, START_STATES) if _inside(robot, q))]
    found = Conditioning(robot, [pair.rows for pair in pairs], backend="vm").many(np.array(states))
    shares = []
    for J in found:
        every = np.linalg.svd(J, compute_uv=False)
        sigma, most = every[:, -1], every[:, 0]
        usual = float(np.median(sigma))
        if usual > ROUNDING * float(np.median(most)):
            shares.append(sigma / usual)
    if not shares:
        return neutral.copy()
    least = np.min(shares, axis=0)
    if least[0] >= ENOUGH and _inside(robot, neutral):
        return neutral.copy()
    return np.array(states[int(np.argmax(least))])


def _inside(robot: Robot, q: Array) -> bool:
    """A configuration keeps away from the ends of the joints' ranges."""
    where = robot.position_index
    known = where >= 0
    x = q[where[known]]
    low, high = robot.limits.position_lower[known], robot.limits.position_upper[known]
    both = np.isfinite(low) & np.isfinite(high)
    margin = np.where(both, MARGIN * (np.where(both, high, 0.0) - np.where(both, low, 0.0)), 0.0)
    free = np.arange(robot.nv)[known] >= robot.base_nv
    return bool(((x >= low + margin) & (x <= high - margin) | ~free).all())
