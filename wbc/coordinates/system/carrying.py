"""From one configuration to another by pairs of coordinates: which pair carries the motion over which interval."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from wbc import validation
from wbc.analysis.rows import BodyRows
from wbc.coordinates import expressions
from wbc.coordinates.pair import CoordinatePair, pairs_of
from wbc.coordinates.rows import Coordinate
from wbc.coordinates.scales import scales
from wbc.coordinates.system.system_motion import system_coordinates
from wbc.errors import RangeError
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.robot.robot import checked_robot
from wbc.symbolic.evaluation import SingleState
from wbc.symbolic.kinematics import WORLD
from wbc.validation import Array

#: Intervals of the first look
FIRST = 64
#: Rounds of setting samples closer, at most
ROUNDS = 40
#: Samples closer than this part of the path are not set closer for a given pair that is lost between them [1]
FINEST = 1.0 / 1024.0
#: A joint goes this far at most [rad, m]: the path is sampled closely all along
FARTHEST = 1e3
#: Functions of rows that are cached
KEPT = 64
#: A pair is regular between two samples if its rows change by less than this part of its least singular value there
SAFE = 0.5
#: A pair is regular where it has this part of the least singular value of the system Jacobian
FLOOR = 0.01
Flags: TypeAlias = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Leg:
    """One pair that carries a part of a motion.

    Attributes:
        pair: the coordinates. start, end: interval [s]. sigma: least of the least singular values of its scaled rows.
        made: the pair is one of single system coordinates, none of those that were given being regular there.
    """

    pair: CoordinatePair
    start: float
    end: float
    sigma: float
    made: bool


@dataclass(frozen=True, eq=False)
class CarriedMotion:
    """A motion q(t) from q0 to q1 on the straight path, and the legs that carry it one after another.

    Attributes:
        robot, q0, q1, seconds: as given. velocity: constant rates of the joints [nv]. legs: in order of time.
    """

    robot: Robot
    q0: Array
    q1: Array
    seconds: float
    velocity: Array
    legs: tuple[Leg, ...]

    def at(self, time: float) -> Array:
        """q(t) [nq].

        Raises:
            RangeError: a time outside the motion.
        """
        t = validation.scalar("time", time, low=0.0, high=self.seconds, unit="s")
        return np.asarray(pin.integrate(self.robot.model, self.q0, t * self.velocity))

    def leg(self, time: float) -> Leg:
        """The leg at a time; where one ends and another begins, the later one.

        Raises:
            RangeError: a time outside the motion.
        """
        t = validation.scalar("time", time, low=0.0, high=self.seconds, unit="s")
        return next(leg for leg in reversed(self.legs) if leg.start <= t)

    def rates(self, time: float) -> tuple[Array, Array]:
        """(x_T', x_C'): rates of the leg's task and of its constraint coordinates that make the motion [m/s, rad/s].

        Raises:
            RangeError: a time outside the motion.
        """
        pair, q = self.leg(time).pair, self.at(time)
        task, held = (
            _rates(self.robot, side)(q)[0] @ self.velocity if side else np.zeros(0)
            for side in (pair.task, pair.constraint)
        )
        return task, held


@lru_cache(maxsize=KEPT)
def _rates(robot: Robot, rows: tuple[Coordinate, ...]) -> SingleState:
    return SingleState(expressions.rate_function(robot, rows))


def carry(
    robot: Robot,
    q0: Any,
    q1: Any,
    pairs: Iterable[CoordinatePair] = (),
    *,
    seconds: float = 1.0,
    share: float = 0.25,
) -> CarriedMotion:
    """The list of (pair, interval) that carries the straight motion from ``q0`` to ``q1``, each regular on its own:

        q(t) = q0 (+) t/T (q1 (-) q0),    rank [J_T; J_C](q(t)) = nv  for t in the interval of each pair

    By the generality theorem there always is such a list, with finitely many changes: the system Jacobian has rank nv
    at every q, so some of its rows make a regular pair there and, being continuous, round about. Intervals are as long
    as they can be, so changes are as few as the pairs allow. Where no given pair is regular, one is made of single
    system coordinates, of the last body's first.

    A pair counts between two samples of the path if its scaled rows change by less than half of its least singular
    value at both (from one matrix to another no singular value changes by more than the norm of the difference, H.
    Weyl, 1912); if that is at least ``share`` of the best given pair's; and at least 0.01 of that of the system
    Jacobian, which is never zero. Samples are set closer until one does.

    Args:
        pairs: to choose from, such as :func:`mode_pairs`; none: only made ones. seconds: how long the motion takes.
        share: part of the best given pair's least singular value that a given pair must have to be used.

    Source: E. Dupuis, PhD thesis, McGill University, 2001, chapter 2, conditions 2.1 and 2.6 and their proof.

    Raises:
        ShapeError, NotFiniteError, RotationError, RangeError: bad configurations, pairs or numbers.
        MissingPartError: a body without a frame.
    """
    checked_robot(robot)
    start, end = robot.configuration("q0", q0), robot.configuration("q1", q1)
    given = pairs_of(pairs, some=False)
    for pair in given:
        if pair.under_determined(robot):
            n, p = pair.counts(robot)
            reason = f"{n} task and {p} constraint rows leave some of {robot.nv} joints undetermined on the way"
            raise RangeError("pairs", pair.name, reason)
    total = validation.scalar("seconds", seconds, low=0.0, open_low=True, unit="s")
    part = validation.scalar("share", share, low=0.0, high=1.0)
    step = np.asarray(pin.difference(robot.model, start, end))
    if not np.abs(step).max(initial=0.0) <= FARTHEST:
        raise RangeError("q1", q1, f"expected joints that go {FARTHEST:g} rad or m at most")
    search = _SampleSearch(robot, start, step, given, part)
    legs = tuple(Leg(p, a * total, b * total, s, k >= len(given)) for p, k, a, b, s in search.legs())
    return CarriedMotion(robot, start, end, total, search.step / total, legs)


class _SampleSearch:
    """Candidates along the path; rows of all of them come from one function."""

    def __init__(self, robot: Robot, q0: Array, step: Array, pairs: Sequence[CoordinatePair], share: float) -> None:
        self._robot, self._q0, self.step, self._share = robot, q0, step, share
        bodies = system_coordinates(robot)
        every = tuple(dict.fromkeys([*(one for pair in pairs for one in pair.rows), *bodies]))
        counts = [len(expressions.labels(robot, one)) for one in every]
        starts = dict(zip(every, np.cumsum([0, *counts]).tolist(), strict=False))
        sizes = dict(zip(every, counts, strict=True))
        self._rates = SingleState(expressions.rate_function(robot, every))
        self._rows, self._columns = scales(robot, every)
        self._system = [(one, starts[one] + k, k) for one in reversed(bodies) for k in range(6)]
        self._pairs, self._given = list(pairs), len(pairs)
        self._rows_of_pairs = [[starts[one] + k for one in pair.rows for k in range(sizes[one])] for pair in pairs]
        self._kept: dict[float, Array] = {}

    def legs(self) -> list[tuple[CoordinatePair, int, float, float, float]]:
        """(pair, its number, start, end, least singular value) in order, on [0, 1]."""
        grid = np.linspace(0.0, 1.0, FIRST + 1).tolist() if np.abs(self.step).max(initial=0.0) > 0.0 else [0.0, 1.0]
        for _ in range(ROUNDS):
            good, high, sigma = self._table(grid)
            served = np.asarray(high[: self._given].any(axis=0))
            # Given pairs whose rows change too much from one sample to the next, or that are nearly lost at one of them
            coarse = (served[:-1] & served[1:]) | ((served[:-1] | served[1:]) & (np.diff(grid) > FINEST))
            bare = ~good.any(axis=0) | (coarse & ~good[: self._given].any(axis=0))
            if not bare.any():
                return self._joined(grid, good, sigma)
            middles = {k: 0.5 * (grid[k] + grid[k + 1]) for k in np.flatnonzero(bare).tolist()}
            # Where all pairs are nearly lost one is made, elsewhere samples are set closer
            low = [k for k in middles if not coarse[k] and not (high[:, k] & high[:, k + 1]).any()]
            if low:
                self._make(middles[low[len(low) // 2]])
            grid = sorted({*grid, *middles.values()})
        raise RangeError("q1", self._q0.tolist(), "the path is too long, or changes too fast, to be examined")

    def _matrix(self, s: float) -> Array:
        found = self._kept.get(s)
        if found is None:
            q = pin.integrate(self._robot.model, self._q0, s * self.step)
            found = self._rows[:, None] * self._rates(q)[0] * self._columns
            self._kept[s] = found
        return found

    def _table(self, grid: list[float]) -> tuple[Flags, Flags, Array]:
        """(pair is regular between samples [pairs, intervals], its least singular value is high enough at the samples,
        that value [pairs, samples]).
        """
        whole = np.array([self._matrix(s) for s in grid])
        count = len(self._rows_of_pairs)
        sigma, change = np.zeros((count, len(grid))), np.zeros((count, len(grid) - 1))
        for k, rows in enumerate(self._rows_of_pairs):
            J = whole[:, rows]
            sigma[k] = np.linalg.svd(J, compute_uv=False)[:, -1]
            change[k] = np.linalg.norm(np.diff(J, axis=0), axis=(1, 2))
        least = np.minimum(sigma[:, :-1], sigma[:, 1:])
        system = np.linalg.svd(whole[:, [row for _, row, _ in self._system]], compute_uv=False)[:, -1]
        high = sigma >= FLOOR * system
        high[: self._given] &= sigma[: self._given] >= self._share * sigma[: self._given].max(axis=0, initial=0.0)
        return np.asarray(high[:, :-1] & high[:, 1:] & (change < SAFE * least)), np.asarray(high), sigma

    def _joined(
        self, grid: list[float], good: Flags, sigma: Array
    ) -> list[tuple[CoordinatePair, int, float, float, float]]:
        """As few legs as can be: at the end of each one the pair that goes on for longest, a given one if there is."""
        out, k, last = [], 0, len(grid) - 1
        good = good.copy()
        good[self._given :] &= ~good[: self._given].any(axis=0)
        while k < last:
            runs = [last - k if row.all() else int(np.argmin(row)) for row in good[:, k:]]
            n = int(np.argmax(runs))
            end = k + runs[n]
            out.append((self._pairs[n], n, grid[k], grid[end], float(sigma[n, k : end + 1].min())))
            k = end
        return out

    def _make(self, s: float) -> None:
        """A pair of single system coordinates that is regular at ``s``: rows of the last body first, then of the others
        the one that is the farthest from those that are taken.
        """
        J = self._matrix(s)
        chosen: list[tuple[BodyRows, int, int]] = []
        left = np.eye(self._robot.nv)
        tip = [item for item in self._system if item[0] == self._system[0][0]]
        for pool, enough in ((tip, 0.05), (self._system, 0.0)):
            while len(chosen) < min(self._robot.nv, 6 if enough else self._robot.nv):
                free = [item for item in pool if item not in chosen]
                far = [float(np.linalg.norm(J[row] @ left)) for _, row, _ in free]
                if not free or max(far) <= enough:
                    break
                item = free[int(np.argmax(far))]
                along = left @ (J[item[1]] @ left)
                along = along / np.linalg.norm(along)
                left = left - np.outer(along, along @ left)
                chosen.append(item)
        split = min(6, len(chosen) - 1) if len(chosen) > 1 else 1
        singles = [_single(one, k) for one, _, k in chosen]
        number = len(self._pairs) - self._given + 1
        self._pairs.append(CoordinatePair(singles[:split], singles[split:], f"system coordinates {number}"))
        self._rows_of_pairs.append([row for _, row, _ in chosen])


def _single(one: BodyRows, k: int) -> BodyRows:
    """One of the six rows of a body's pose."""
    moved, turned = ((k,), ()) if k < 3 else ((), (k - 3,))
    text = f"{one.frame} {'xyz'[k]}" if k < 3 else f"{one.frame} r{'xyz'[k - 3]}"
    return BodyRows(one.frame, expressed=WORLD, translation=moved, rotation=turned, name=text)
