"""A jerk-limited law from rest to rest: ruckig's, made once over the way and the time from 0 to 1."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

from wbc.trajectory.between_states import jerk_limited
from wbc.trajectory.law import Law
from wbc.validation import Array

#: Parts of the time in which it gets up to its speed, and slows down; and those in which its acceleration changes
RAMP, CHANGE = 0.2, 0.06
#: Bounds of the way from 0 to 1 in the time 1: the fastest law under them takes just as long
SPEED = 1.0 / (1.0 - RAMP)
ACCELERATION = SPEED / (RAMP - CHANGE)
JERK = ACCELERATION / CHANGE
#: Points of the table
POINTS = 401


class Profile(NamedTuple):
    """The way from 0 to 1, and its first and second derivative, at n times from 0 to 1 ``[n]``.

    Over a duration T the derivatives are to be divided by T and T^2; the third is at most :data:`JERK` / T^3.
    """

    way: Array
    rate: Array
    acceleration: Array


@cache
def profile() -> Profile:
    """At :data:`POINTS` even times; made once."""
    out = profile_at(np.linspace(0.0, 1.0, POINTS))
    for array in out:
        array.flags.writeable = False
    return out


def profile_at(parts: Array) -> Profile:
    """At parts of the time, 0 to 1."""
    law = _law()
    way, rate, acceleration = (np.array(rows)[:, 0] for rows in law.at(law.duration * parts))
    return Profile(np.clip(way, 0.0, 1.0), rate, acceleration)


@cache
def _law() -> Law:
    """The fastest one under the bounds."""
    return jerk_limited([0.0], [1.0], velocity=SPEED, acceleration=ACCELERATION, jerk=JERK)
