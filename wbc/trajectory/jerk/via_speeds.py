"""Speeds at the corners of a polygon that is followed with parabolic blends: what the published generator settles
before it lays out the pieces.

Symbols: segment i has length d_i and unit direction u_i; corner k lies between segments k - 1 and k, U_k = |u_k -
u_(k-1)| is its change of direction, v_k the speed at which its blend begins and ends, r_k = v_k^2 U_k / (2 a) the
distance from the corner at which it does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.validation import Array

#: Squared speeds are settled to this share of them
SETTLED = 1e-13


@dataclass(frozen=True)
class SpeedBounds:
    """Limits of the generator: largest speed [m/s], acceleration [m/s^2], distance from a corner [m]."""

    speed: float
    acceleration: float
    deviation: float


@dataclass(frozen=True, eq=False)
class ViaCorners:
    """Corners and segments of a polygon of n segments.

    Attributes:
        lengths: n [m]. deflections: n + 1. squares: squared speeds at the n + 1 corners, 0 at both ends [m^2/s^2].
        reaches: r at the n + 1 corners [m].
    """

    lengths: Array
    deflections: Array
    squares: Array
    acceleration: float

    @property
    def reaches(self) -> Array:
        return np.asarray(self.squares * self.deflections / (2.0 * self.acceleration))

    @property
    def straight(self) -> Array:
        """What the blends leave of each segment [m]."""
        r = self.reaches
        return np.asarray(self.lengths - r[:-1] - r[1:])

    @property
    def match(self) -> Array:
        """Distance in which the speed at one end of a segment becomes that at the other [m]."""
        return np.asarray(np.abs(np.diff(self.squares)) / (2.0 * self.acceleration))

    @property
    def free(self) -> Array:
        """What is left of the straight parts when speeds are matched; never negative once settled [m]."""
        return np.maximum(self.straight - self.match, 0.0)

    @property
    def slow(self) -> Array:
        """The lower speed of both ends of each segment [m/s]."""
        return np.sqrt(np.minimum(self.squares[:-1], self.squares[1:]))

    @property
    def fast(self) -> Array:
        """The higher one [m/s]."""
        return np.sqrt(np.maximum(self.squares[:-1], self.squares[1:]))

    def order(self, segment: int) -> tuple[int, int]:
        """(corner with the lower speed, corner with the higher speed) of a segment."""
        rising = self.squares[segment] <= self.squares[segment + 1]
        return (segment, segment + 1) if rising else (segment + 1, segment)

    def least_times(self, speed: float) -> tuple[Array, Array]:
        """(least time, highest speed) of the straight parts (4-33, 4-34)."""
        a, low, high = self.acceleration, self.slow, self.fast
        top = np.minimum(speed, np.sqrt(a * self.free + high**2))
        # At `top` for what the ramps leave; none where the top is not reached
        cruise = np.maximum(self.free - (top**2 - high**2) / a, 0.0)
        still = top == 0.0
        return (2.0 * top - high - low) / a + np.where(still, 0.0, cruise / np.where(still, 1.0, top)), top

    def most_times(self) -> Array:
        """Longest times of the straight parts, inf where there is length enough to stop (4-46, 4-47)."""
        a, low, high = self.acceleration, self.slow, self.fast
        least = low**2 - a * self.free
        stops = least <= SETTLED * low**2
        return np.where(stops, np.inf, (high + low - 2.0 * np.sqrt(np.where(stops, 0.0, least))) / a)


def corner_speeds(lengths: Array, directions: Array, turns: Array, bounds: SpeedBounds) -> ViaCorners:
    """Steps 1 to 5 and 8(b) of the generator: the speeds at which corners are passed.

    Args:
        lengths: n. directions: n x 3, zero for segments of no length. turns: n, least times of the rotations [s].
    """
    a, count = bounds.acceleration, len(lengths)
    deflections = np.full(count + 1, 2.0)
    deflections[1:-1] = np.linalg.norm(np.diff(directions, axis=0), axis=1)
    inner = deflections[1:-1]
    turned = inner > 0.0
    safe = np.where(turned, inner, 1.0)
    reach = np.minimum(lengths[:-1], lengths[1:]) / 2.0
    reach = np.where(turned, np.minimum(reach, 4.0 * bounds.deviation / safe), reach)
    allowed = np.where(turned, 2.0 * reach * a / safe, np.inf)
    squares = np.zeros(count + 1)
    squares[1:-1] = np.minimum(allowed, bounds.speed**2)
    # A segment of no length has no direction to go through in: it is reached and left at rest
    squares[1:-1][(lengths[:-1] == 0.0) | (lengths[1:] == 0.0)] = 0.0
    corners = ViaCorners(lengths, deflections, squares, a)
    stopping: set[int] = set()
    while True:
        _settle(corners)
        short = np.where(turns > corners.least_times(bounds.speed)[0], turns - corners.most_times(), -np.inf)
        short[list(stopping)] = -np.inf
        worst = int(short.argmax())
        if not short[worst] > 0.0:
            return corners
        _let_stop(corners, worst)
        stopping.add(worst)


def _settle(corners: ViaCorners) -> None:
    """Steps 3 and 4: while a segment is too short for its change of speed, lower the higher one, worst first."""
    a, squares = corners.acceleration, corners.squares
    while True:
        change, length = np.abs(np.diff(squares)), 2.0 * corners.straight
        over = change - a * length > SETTLED * np.maximum(squares[:-1], squares[1:])
        if not over.any():
            return
        needed = np.where(over, np.where(length > 0.0, change / np.where(length > 0.0, length, 1.0), np.inf), -np.inf)
        worst = int(needed.argmax())
        low, high = corners.order(worst)
        rest = corners.lengths[worst] - corners.reaches[low]
        squares[high] = (squares[low] + 2.0 * a * rest) / (1.0 + corners.deflections[high])


def _let_stop(corners: ViaCorners, segment: int) -> None:
    """Step 8(b): lower the speeds at the ends of a segment until one can stop in it.

    Stopping takes v_lo^2 + v_hi^2 <= 2 a (d - r_lo - r_hi). The listing's equal speeds, v^2 = a d / (1 + U_lo + U_hi),
    leave length, 2 a d / (2 + U_lo + U_hi) would leave none; since blends do not turn, the faster is not the shorter.
    """
    a, squares, length = corners.acceleration, corners.squares, float(corners.lengths[segment])
    low, high = corners.order(segment)
    if squares[low] > a * (length - 2.0 * corners.reaches[low]):
        squares[[low, high]] = a * length / (1.0 + corners.deflections[low] + corners.deflections[high])
    else:
        rest = length - corners.reaches[low]
        squares[high] = (2.0 * a * rest - squares[low]) / (1.0 + corners.deflections[high])
