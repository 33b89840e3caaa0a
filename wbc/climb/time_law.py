"""When a path is where: least time under limits of joints and of the body's speed and turn rate, from rest to rest."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wbc import validation
from wbc.climb.chain import address_of, library
from wbc.climb.climber import Climber
from wbc.climb.move_path import MovePath
from wbc.climb.path_loads import PathLoads
from wbc.errors import InfeasibleError, RangeError
from wbc.validation import Array

#: Longest time between knots of a motion [s]
KNOTS = 0.02
#: Intervals of the path on which least time is sought, finer towards its ends, where it is slow
INTERVALS = 64
GRID = (1.0 - np.cos(np.linspace(0.0, np.pi, INTERVALS + 1))) / 2.0
#: How often a law is slowed by what its cubics need beyond the limits at most: each time is exact for the one before
SLOWED = 3
#: How often a law is sought with rows for what contacts lacked in the one before
CUTS = 5
#: By which factor a law may be slowed for what they lack instead
NEARLY = 1.02


@dataclass(frozen=True)
class MotionSpeeds:
    """How fast a climber goes.

    Attributes:
        speed: largest speed of the body's origin [m/s].
        turn_rate: largest turn rate of the body [rad/s].
        share: of the joints' velocity limits that is used, the rest is left to feedback [1].
        acceleration_share: of their acceleration limits [1].
        dwell: how long it rests in every stance [s].

    Raises:
        RangeError, NotFiniteError: a number that is none of these.
    """

    speed: float = np.inf
    turn_rate: float = np.inf
    share: float = 0.9
    acceleration_share: float = 0.7
    dwell: float = 0.0

    def __post_init__(self) -> None:
        validation.own_scalars(self, "speed", "turn_rate", low=0.0, open_low=True, infinite=True)
        validation.own_scalars(self, "share", "acceleration_share", low=0.0, high=1.0, open_low=True)
        validation.own_scalars(self, "dwell", low=0.0, unit="s")


@dataclass(frozen=True, eq=False)
class TimedMove:
    """Knots of a motion from rest to rest.

    Attributes:
        times: from 0 on ``(n)`` [s], at most 20 ms apart. q: ``(n, nq)``. v: ``(n, nv)``.
    """

    times: Array
    q: Array
    v: Array


@dataclass(frozen=True, eq=False)
class PathTiming:
    """The least-time law of the paths of one climber.

    Attributes:
        climber: whose joints' limits count. speeds: as given.
        effort: share of the joints' efforts that motors give on the way, where something weighs [1]; inf: any torque.

    Raises:
        RangeError: a joint of a limb has no limit of velocity or acceleration.
    """

    climber: Climber
    speeds: MotionSpeeds
    effort: float = np.inf

    def __post_init__(self) -> None:
        limits = self.climber.robot.limits
        for limb in range(len(self.climber.limbs)):
            for dof in self.climber.joints(limb):
                for what, value in (("acceleration", limits.acceleration[dof]), ("velocity", limits.velocity[dof])):
                    if not np.isfinite(value):
                        name = f"limit of {what} of {self.climber.robot.dof_names[dof]}"
                        raise RangeError(name, float(value), "expected a finite one, or least time has no bound")

    def timed(self, path: MovePath, loads: PathLoads | None = None) -> TimedMove:
        """Knots of the fastest motion along a path.

        Args:
            loads: what contacts have to bear on a grid, then also that of the law; None: they bear all.

        Raises:
            InfeasibleError: nothing moves.
        """
        s = GRID if loads is None else loads.s
        speed = self._speeds(path, s, loads)
        span = 2.0 * np.diff(s) / np.maximum(speed[1:] + speed[:-1], 1e-12)
        # Between points of the grid the path acceleration is constant; long intervals get knots inside
        parts = np.maximum(np.ceil(span / KNOTS), 1.0).astype(int)
        t, x, sd = law_knots(s, speed, span, parts)
        x[-1], sd[[0, -1]] = 1.0, 0.0
        coordinates, slopes = path.at(x), path.at(x, 1)
        rates = slopes * sd[:, None]
        for _ in range(SLOWED):
            used = self._used(t, coordinates, rates)
            if used <= 1.0 + 1e-9:
                break
            t, rates = t * used, rates / used
        gaps = np.ceil(np.diff(t) / KNOTS - 1e-6)
        if gaps.max() > 1.0:
            t, coordinates, rates = _denser(t, coordinates, rates, gaps.astype(int))
        q = path.configurations(coordinates)
        q[0], q[-1] = path.q[0], path.q[-1]
        return TimedMove(t, q, path.velocities(coordinates, rates))

    def _speeds(self, path: MovePath, s: Array, loads: PathLoads | None) -> Array:
        """ds/dt at the points of a grid."""
        first, second = path.at(s, 1), path.at(s, 2)
        velocity, acceleration = self._limits
        moves = np.isfinite(acceleration) & (np.abs(first).max(axis=0) > 0.0)
        if not moves.any():
            raise InfeasibleError("path", 0.0, "no joint moves from this stance to the next one")
        a, b = first[:, moves] / acceleration[moves], second[:, moves] / acceleration[moves]
        squared = self._squared(first, velocity)
        if loads is None:
            return fastest(s, a, b, squared)
        for _ in range(CUTS):
            speed = fastest(s, a, b, squared, loads.rows)
            slower = loads.lacking(np.diff(speed**2) / (2.0 * np.diff(s)), speed**2)
            if slower <= NEARLY:
                break
        speed = speed / slower
        if self.effort < np.inf:
            speed = speed / loads.overdriven(np.diff(speed**2) / (2.0 * np.diff(s)), speed**2, self.effort)
        return speed

    def _squared(self, slopes: Array, velocity: Array) -> Array:
        """Bounds of (ds/dt)^2 of joints' velocities and of the body's speed and turn rate."""
        body = np.stack([np.linalg.norm(slopes[:, part], axis=1) for part in (slice(3), slice(3, 6))], axis=1)
        used = np.abs(np.hstack([slopes[:, 6:], body])) / [*velocity[6:], self.speeds.speed, self.speeds.turn_rate]
        return np.asarray(1.0 / np.maximum(used.max(axis=1), 1e-9) ** 2)

    @property
    def _limits(self) -> tuple[Array, Array]:
        limits = self.climber.robot.limits
        return self.speeds.share * limits.velocity, self.speeds.acceleration_share * limits.acceleration

    def _used(self, times: Array, coordinates: Array, rates: Array) -> float:
        """By which factor the cubics between knots have to be slowed to keep all limits."""
        velocity, acceleration = self._limits
        speeds = _hull(times, coordinates[:, :6], rates[:, :6])[0]
        body = [np.linalg.norm(speeds[..., part], axis=-1).max() for part in (slice(3), slice(3, 6))]
        needs = cubics_need(times, coordinates[:, 6:], rates[:, 6:], velocity[6:], acceleration[6:])
        ratio = max(float(needs.max()), float(body[0] / self.speeds.speed), float(body[1] / self.speeds.turn_rate))
        return ratio * (1.0 + 1e-6) if ratio > 1.0 else 1.0


def cubics_need(times: Array, values: Array, rates: Array, velocity: Array, acceleration: Array) -> Array:
    """By which factor the cubic of each interval has to be slowed to keep limits, at least ``(n - 1)``.

    Args:
        values, rates: at the knots ``(n, k)``. velocity, acceleration: limits ``(k)``.
    """
    speeds, pulls = _hull(times, values, rates)
    parts = (np.abs(speeds) / velocity).max(axis=(0, 2)), np.sqrt((np.abs(pulls) / acceleration).max(axis=(0, 2)))
    return np.asarray(np.maximum(*parts))


def _hull(times: Array, values: Array, rates: Array) -> tuple[Array, Array]:
    """Rates ``(3, n - 1, k)`` and accelerations ``(2, n - 1, k)`` between which those of cubics between knots are."""
    h, step = np.diff(times)[:, None], np.diff(values, axis=0)
    a, b = rates[:-1], rates[1:]
    pulls = (6.0 * step / h - 4.0 * a - 2.0 * b) / h, (-6.0 * step / h + 2.0 * a + 4.0 * b) / h
    return np.stack([a, 3.0 * step / h - a - b, b]), np.stack(pulls)


def fastest(s: Array, a: Array, b: Array, squared: Array, sided: tuple[Array, Array] | None = None) -> Array:
    """Path speeds ds/dt of the fastest motion from rest to rest, at the points of a grid ``(n)``.

        |a u + b x| <= 1,   c u + d x <= 1,   x <= squared,   x' = x + 2 u (s' - s)      u = d2s/dt2, x = (ds/dt)^2

    with rows at both ends of each interval (TOPP-RA: Pham and Pham, IEEE T-RO 34, 2018). Rest keeps all rows, so that
    it is always possible, and the largest x from which the end can be reached has a closed form: rows bound
    u + r x by -p and p', and two rows leave a u while (r - r') x <= p + p'.

    Args:
        a, b: ``(n, rows)``. squared: bounds ``(n)``. sided: c and d ``(n, rows)``, or none.
    """
    count = 0
    if sided is not None:
        a, b, count = np.hstack([a, sided[0]]), np.hstack([b, sided[1]]), sided[0].shape[1]
    given = [np.ascontiguousarray(part, dtype=np.float64) for part in (s, a, b, squared)]
    x = np.empty(len(s))
    if not library().wbc_fastest(ctypes.c_long(len(s)), a.shape[1], count, *map(address_of, (*given, x))):
        raise MemoryError(f"a law of {len(s)} points and {a.shape[1]} rows")
    return np.sqrt(x)


def law_knots(x: Array, speed: Array, span: Array, parts: NDArray[np.intp]) -> list[Array]:
    """Knots at places of a way and between them, so many to an interval, of an even change of speed in each: times,
    places and speeds along the way.

    Args:
        x, speed: places and the speeds there ``(n)``. span: times of the intervals ``(n - 1)`` [s]. parts: of each.
    """
    row = np.repeat(np.arange(len(span)), parts)
    long, part = span[row], np.arange(1, len(row) + 1) - np.repeat(np.cumsum(parts) - parts, parts)
    gain, t = (speed[row + 1] - speed[row]) / long, long * part / parts[row]
    begun = np.concatenate([[0.0], np.cumsum(span)])
    places = np.minimum(x[row] + t * (speed[row] + 0.5 * gain * t), x[row + 1])
    times = np.where(part == parts[row], begun[row + 1], begun[row] + t)
    rates = speed[row] + gain * t
    return [np.insert(some, 0, first) for some, first in ((times, 0.0), (places, x[0]), (rates, speed[0]))]


def _denser(times: Array, q: Array, v: Array, parts: Array) -> tuple[Array, Array, Array]:
    """Knots of the same cubics, with some intervals divided evenly."""
    from scipy.interpolate import CubicHermiteSpline

    inner = [np.linspace(a, b, n + 1)[:-1] for a, b, n in zip(times[:-1], times[1:], parts, strict=True)]
    more = np.concatenate([*inner, times[-1:]])
    curve = CubicHermiteSpline(times, q, v, axis=0)
    values, rates = np.asarray(curve(more)), np.asarray(curve(more, 1))
    # Rest is rest to the bit
    values[-1], rates[-1] = q[-1], v[-1]
    return more, values, rates
