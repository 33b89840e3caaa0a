"""Where the body is to go: the two modes of walking. Units: grid units, radian, second.

Each gives the rates of T and A [grid units/s] and the spin [rad/s] in every cycle, or None once it has arrived.
Source: M. R. Patterson's thesis, 3.3, 5.2 and the listing MAIN.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from wbc.published.three_arm_walker.machine.motion import CYCLE
from wbc.validation import Array

#: Largest rates of destination control: T and A [grid units/s], heading [rad/s]
RATES = np.array([0.25, 0.25, np.radians(1.0)])

#: Counts of the joystick: dead bands and counts per unit, of T, A and the spin. The second number of the scale is
#: damaged in print ("/16000"); 100000 makes full scale the published 3 in/s, 16000 would make it 18.6 in/s
DEAD_BAND = np.array([640.0, 640.0, 1280.0])
SCALE = np.array([100000.0, 100000.0, 640000.0])


class WalkCommand(Protocol):
    """A mode of walking."""

    def rates(self, time: float, place: Array) -> Array | None:
        """(T, A, spin) rates at a time of the mode [s], the body being at (T, A, heading); None at the end."""


class VelocityCommand:
    """Robot velocity control: rates as they are given, until a key is pressed.

    Args:
        given: of the time [s]: rates of T and A [grid units/s], spin [rad/s].
    """

    def __init__(self, given: Callable[[float], Array]) -> None:
        self.given = given

    def rates(self, time: float, place: Array) -> Array:
        return self.given(time)


class DestinationCommand:
    """Robot destination control: straight lines in (T, A, heading), each at constant rates, none above its largest.

        rate + (desired - actual) / dt,        duration = max_i |step_i| / RATES_i

    It ends when every rate behind the last point is below ``end``. The thesis's printed bound is damaged: 1 (0.1 grid
    units, 0.1 rad) or 0.1. Headings are compared within half a turn.

    Args:
        points: (T, A, heading [rad]) each. end: [grid units/s, rad/s].
    """

    def __init__(self, points: Sequence[Sequence[float]], end: float = 1.0) -> None:
        self.points, self.end = points, end
        self.line: Waypoints | None = None

    def rates(self, time: float, place: Array) -> Array | None:
        if self.line is None:
            self.line = Waypoints(np.vstack([place, self.points]))
        desired, rate = self.line.at(time)
        off = desired - place
        off[2] = (off[2] + np.pi) % (2.0 * np.pi) - np.pi
        if time < self.line.times[-1]:
            return np.asarray(rate + off / CYCLE)
        rates = off / CYCLE
        return None if (np.abs(rates) <= self.end).all() else np.asarray(rates)


class Waypoints:
    """Points (T, A, heading), m + 1 x 3, passed at constant rates.

    Attributes:
        times: at which they are passed, m + 1 [s].
    """

    def __init__(self, points: Array) -> None:
        self.points = points
        self.times = np.concatenate([[0.0], np.cumsum((np.abs(np.diff(points, axis=0)) / RATES).max(axis=1))])

    def at(self, time: float) -> tuple[Array, Array]:
        """(place, rates) at a time; the last place at rest from the end on."""
        if time >= self.times[-1]:
            return self.points[-1].copy(), np.zeros(3)
        i = int(np.searchsorted(self.times, time, side="right")) - 1
        rates = (self.points[i + 1] - self.points[i]) / (self.times[i + 1] - self.times[i])
        return self.points[i] + (time - self.times[i]) * rates, rates


def joystick(counts: Sequence[float], scale: Sequence[float] = tuple(SCALE)) -> Array:
    """Rates of T and A [grid units/s] and spin [rad/s] of three axes of -32768 to 32767 counts:

    rate = sign(J) max(|J + 1| - DEAD_BAND, 0) / scale
    """
    j = np.asarray(counts, dtype=float)
    return np.asarray(np.sign(j) * np.maximum(np.abs(j + 1.0) - DEAD_BAND, 0.0) / np.asarray(scale))
