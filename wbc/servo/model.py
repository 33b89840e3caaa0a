"""What is known of a servo: its lag and its delay, and how both are found from a recording."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import RangeError
from wbc.validation import Array

#: A joint that moves less than this between its extremes says nothing of its lag [rad or m]
LEAST_MOTION = 1e-3


@dataclass(frozen=True)
class Response:
    """A position servo as a lag and a delay, joint by joint:

        T dq/dt + q = u(t - D) + sag

    Attributes:
        lag: T [s]. delay: D, of command and measurement together [s].
    """

    lag: Array
    delay: float


def identify(commands: Any, positions: Any, dt: float, longest_delay: float = 0.05) -> Response:
    """Lag and delay of a position servo from what it was commanded and what it did.

        min over D, T, sag of  sum_k |q_k + T (q_k+1 - q_k-1) / (2 dt) - u(k - D / dt) - sag|^2,   T >= 0

    Args:
        commands: u ``[n, joints]``, positions: q ``[n, joints]`` [rad or m], measured as each command was sent.
        dt: time between two of them [s]. longest_delay: no delay is longer [s].

    Raises:
        ShapeError, NotFiniteError: other arrays. RangeError: a joint that hardly moves, or too few samples.
    """
    u, q = (validation.real_array(name, x) for name, x in (("commands", commands), ("positions", positions)))
    validation.real_array("positions", q, u.shape)
    dt = validation.scalar("dt", dt, low=0.0, open_low=True, unit="s")
    most = round(validation.scalar("longest_delay", longest_delay, low=0.0, unit="s") / dt)
    if u.ndim != 2 or len(u) < 4 * most + 20:
        raise RangeError("commands", u.shape, f"expected at least {4 * most + 20} samples of some joints")
    moved = np.ptp(u, axis=0)
    if moved.min() < LEAST_MOTION:
        raise RangeError("commands", float(moved.min()), f"joint {int(moved.argmin())} hardly moves")
    rate, here = (q[2:] - q[:-2])[most:] / (2.0 * dt), q[1:-1][most:]
    best, found = np.inf, (0, np.zeros(u.shape[1]))
    for late in range(most + 1):
        error = u[1:-1][most - late : len(u) - 2 - late] - here
        centred, slope = error - error.mean(axis=0), rate - rate.mean(axis=0)
        lag = np.maximum((centred * slope).sum(axis=0) / (slope * slope).sum(axis=0), 0.0)
        left = float((((centred - lag * slope) / moved) ** 2).sum())
        if left < best:
            best, found = left, (late, lag)
    return Response(found[1], found[0] * dt)
