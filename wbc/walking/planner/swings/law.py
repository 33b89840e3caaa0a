"""A swing as the controller follows it: where the hand is to be at each time, from lifting to landing."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking.body_path import BodyPath
from wbc.walking.planner.grips.table import Ints
from wbc.walking.planner.swings.curve import ALTERNATIVES, Curves
from wbc.walking.planner.swings.joints import Guide, blend, guide_between
from wbc.walking.planner.swings.least_time import speeds
from wbc.walking.planner.swings.move import Move
from wbc.walking.planner.swings.swings import COARSE, FINE, Swings
from wbc.walking.planner.swings.tracks import PASSES
from wbc.walking.planner.swings.waiting import HALFWAY, SLOWLY

#: Rows of the table are this far apart [s]
SPACING = 0.005


class Aim(NamedTuple):
    """What a swinging hand is to do: position [m], velocity [m/s], the part of the guided joints' change, and that of
    the time, 0 to 1 each.
    """

    position: Array
    velocity: Array
    blend: float
    part: float


class SwingLaw:
    """A table of a hand's motion from lifting to landing; between its rows straight lines.

    Rows are 5 ms apart, so that they miss a curve by a hundredth of a millimetre.

    Args:
        times: of the rows, evenly from 0 ``[n]`` [s]. places: positions of the hand ``[n, 3]`` [m].
        parts: of the guided joints' change ``[n]``, 0 to 1.

    Attributes:
        possible: within reach and limits. duration: [s]. fastest: the least time along this curve [s].
        jerk_limited: whether its acceleration does not jump, see :mod:`wbc.walking.planner.eased`.
    """

    def __init__(
        self,
        times: Array,
        places: Array,
        parts: Array,
        *,
        possible: bool = True,
        fastest: float | None = None,
        jerk_limited: bool = False,
    ) -> None:
        self.duration = float(times[-1])
        self.possible, self.jerk_limited = possible, jerk_limited
        self.fastest = self.duration if fastest is None else fastest
        # From the table itself, so that position and velocity agree
        speed = np.gradient(places, times, axis=0)
        speed[0] = speed[-1] = 0.0
        self._rows = np.concatenate([places, speed, parts[:, None]], axis=1)

    @property
    def places(self) -> Array:
        """Of the hand at the rows ``[n, 3]`` [m]."""
        return self._rows[:, :3]

    @property
    def parts(self) -> Array:
        """Of the guided joints' change at the rows ``[n]``."""
        return self._rows[:, 6]

    @property
    def times(self) -> Array:
        """Of the rows ``[n]`` [s]."""
        return rows_over(self.duration, len(self._rows))

    @property
    def spacing(self) -> float:
        """From row to row [s]."""
        return self.duration / (len(self._rows) - 1)

    def at(self, time: float) -> Aim:
        """The aim at a time since lifting, clipped to the swing."""
        rows, between, part = self.rows_at(time)
        row = rows[:7] + between * (rows[7:] - rows[:7])
        return Aim(row[:3], row[3:6], float(row[6]), part)

    def along(self, times: Array) -> tuple[Array, Array]:
        """Positions ``[k, 3]`` [m] and parts of the guided joints' change ``[k]`` at times ``[k]``, clipped."""
        place = np.clip(times / self.duration, 0.0, 1.0) * (len(self._rows) - 1)
        low = np.minimum(place.astype(np.int64), len(self._rows) - 2)
        rows = self._rows[low] + (place - low)[:, None] * (self._rows[low + 1] - self._rows[low])
        return rows[:, :3], rows[:, 6]

    def rows_at(self, time: float) -> tuple[Array, float, float]:
        """The rows before and after a time, clipped to the swing: position, velocity and part of the guided joints'
        change of each ``[14]``; how far it is between them, and the part of the whole time.
        """
        part = min(max(time / self.duration, 0.0), 1.0)
        place = part * (len(self._rows) - 1)
        low = min(int(place), len(self._rows) - 2)
        return self._rows[low : low + 2].reshape(14), place - low, part


def rows_over(duration: float, count: int | None = None) -> Array:
    """Even times of the rows of a law [s]."""
    return np.linspace(0.0, duration, int(np.ceil(duration / SPACING)) + 1 if count is None else count)


def least_time_law(
    walker: Walker, arm: int, path: BodyPath, curve: Curves, samples: Array, guide: Guide, least: float = 0.0
) -> SwingLaw:
    """The least-time law of an arm along one curve, stretched where it has to take longer.

    Args:
        walker, arm, path: whose hand moves while the body is at ``samples`` ``[FINE]`` of the path.
        guide: of the guided joints. least: duration that it takes at least [s].
    """
    x = np.linspace(0.0, 1.0, FINE)
    found = speeds(walker, np.array([arm]), path, curve, samples[None], guide)
    fastest = float(found.duration[0])
    duration = max(fastest, least)
    slower = duration / fastest
    times, rate = found.time[0] * slower, found.rate[0] / slower
    # One that is not possible may take minutes; only its duration counts
    rows = rows_over(duration, None if found.possible[0] else FINE)
    # Between points of the law the acceleration is constant
    low = np.clip(np.searchsorted(times, rows, side="right") - 1, 0, FINE - 2)
    since = rows - times[low]
    push = (rate[low + 1] - rate[low]) / (times[low + 1] - times[low])
    along = np.clip(x[low] + since * (rate[low] + 0.5 * push * since), 0.0, 1.0)
    return SwingLaw(rows, curve.at(along)[0], blend(along), possible=bool(found.possible[0]), fastest=fastest)


def law_of(swings: Swings, move: Move) -> SwingLaw:
    """The law of a planned move, as long as the plan says, with the body where it is at these times."""
    arms, source, target = np.array([move.arm]), np.array([move.source]), np.array([move.target])
    # It comes when the next grip begins, if it does not hold the body up
    whole = max(move.duration, 0.0 if move.delay else (move.land - move.lift) * swings.path.spacing)
    least = whole - swings.extra
    if move.curve >= len(ALTERNATIVES):
        return _waiting_law(swings, move, (arms, source, target), least)
    curve = swings.curve(arms, source, target, np.array([move.lift]), move.curve)
    part = np.linspace(0.0, 1.0, COARSE)
    guide = guide_between(swings.limb, swings.grips, source, target, COARSE)
    for _ in range(PASSES):
        # While the hand opens and closes the body moves on
        samples = (move.lift + (move.land - move.lift) * (swings.latch + part * least) / whole)[None]
        found = speeds(swings.walker, arms, swings.path, curve, samples, guide)
        part = found.time[0] / found.duration[0]
    fine = np.interp(np.linspace(0.0, 1.0, FINE), np.linspace(0.0, 1.0, COARSE), samples[0])
    guide = guide_between(swings.limb, swings.grips, source, target, FINE)
    return least_time_law(swings.walker, move.arm, swings.path, curve, fine, guide, least)


def _waiting_law(swings: Swings, move: Move, ends: tuple[Ints, Ints, Ints], whole: float) -> SwingLaw:
    """The law of a move whose hand waits: off the hold, the ride, and onto the next one."""
    spacing, begin = swings.path.spacing, np.array([move.lift + swings.latch / swings.path.spacing])
    found = swings.waiting(ends, (begin, begin + whole / spacing), move.curve, FINE)
    slow = SLOWLY * float(found.onto.law.duration[0])
    away, onto = (
        least_time_law(swings.walker, move.arm, swings.path, half.curve, half.samples[0], half.guide, least)
        for half, least in ((found.away, 0.0), (found.onto, slow))
    )
    rides, since = slice(1, FINE - 1), (found.samples[0] - begin) * spacing
    times = np.concatenate([away.times, since[rides], whole - onto.duration + onto.times])
    places = np.concatenate([away.places, found.places[0, rides], onto.places])
    parts = HALFWAY * away.parts, np.full(FINE - 2, HALFWAY), HALFWAY + (1 - HALFWAY) * onto.parts
    rows = rows_over(whole)
    columns = [*places.T, np.concatenate(parts)]
    x, y, z, part = (np.interp(rows, times, column) for column in columns)
    fastest, possible = away.fastest, bool(found.possible[0])
    return SwingLaw(rows, np.stack([x, y, z], axis=1), part, possible=possible, fastest=fastest)
