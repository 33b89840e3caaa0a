"""A swing as the controller follows it: where the hand is to be at each time, from lifting to landing."""

from __future__ import annotations

from copy import copy
from typing import NamedTuple

import numpy as np

from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking.arms.puma import ArmKinematics
from wbc.walking.body_path import BodyPath
from wbc.walking.planner.grips.table import Ints
from wbc.walking.planner.swings.curve import WAYS, Curves
from wbc.walking.planner.swings.joints import Wrists, blend, grip_wrists
from wbc.walking.planner.swings.least_time import speeds
from wbc.walking.planner.swings.move import Move
from wbc.walking.planner.swings.parked import HALFWAY, SLOWLY
from wbc.walking.planner.swings.swings import COARSE, FINE, Swings
from wbc.walking.planner.swings.tracks import PASSES

#: Rows of the table are this far apart [s]
SPACING = 0.005


class Aim(NamedTuple):
    """What a swinging hand is to do: position [m], velocity [m/s], the part of the wrist's way, and that of the time,
    0 to 1 each.
    """

    position: Array
    velocity: Array
    blend: float
    part: float


class SwingLaw:
    """A table of the least-time law of an arm along a curve, stretched where it has to take longer.

    Between rows straight lines; rows are 5 ms apart, so that they miss the curve by a hundredth of a millimetre.

    Args:
        walker, arm, path: whose hand moves while the body is at ``samples`` ``[FINE]`` of the path.
        way: one curve. wrists: of joints 4 and 5. least: duration that it takes at least [s].

    Attributes:
        possible: within reach and limits. duration: [s]. fastest: the least time of this law [s].
        jerk_limited: whether its acceleration does not jump, see :mod:`wbc.walking.planner.eased`.
    """

    jerk_limited = False

    def __init__(
        self, walker: Walker, arm: int, path: BodyPath, way: Curves, samples: Array, wrists: Wrists, least: float = 0.0
    ) -> None:
        x = np.linspace(0.0, 1.0, FINE)
        kinematics = ArmKinematics(walker.data)  # type: ignore[arg-type]
        found = speeds(kinematics, walker, np.array([arm]), path, way, samples[None], wrists)
        self.fastest = fastest = float(found.duration[0])
        self.possible = bool(found.possible[0])
        self.duration = max(fastest, least)
        slower = self.duration / fastest
        times, rate = found.time[0] * slower, found.rate[0] / slower
        count = int(np.ceil(self.duration / SPACING)) + 1
        rows = np.linspace(0.0, self.duration, count)
        # Between points of the law the acceleration is constant
        low = np.clip(np.searchsorted(times, rows, side="right") - 1, 0, FINE - 2)
        since = rows - times[low]
        push = (rate[low + 1] - rate[low]) / (times[low + 1] - times[low])
        along = np.clip(x[low] + since * (rate[low] + 0.5 * push * since), 0.0, 1.0)
        self._tabulate(way, rows, along)

    def _tabulate(self, way: Curves, times: Array, along: Array) -> None:
        """The table: at even times parts of the way."""
        self._times, place = times, way.at(along)[0]
        # From the table itself, so that position and velocity agree
        speed = np.gradient(place, times, axis=0)
        speed[0] = speed[-1] = 0.0
        self._rows = np.concatenate([place, speed, blend(along)[:, None]], axis=1)

    @property
    def places(self) -> Array:
        """Of the hand at the rows ``[n, 3]`` [m]."""
        return self._rows[:, :3]

    @property
    def spacing(self) -> float:
        """From row to row [s]."""
        return self.duration / (len(self._rows) - 1)

    @staticmethod
    def of(swings: Swings, move: Move) -> SwingLaw:
        """The law of a planned move, as long as the plan says, with the body where it is at these times."""
        arms, source, target = np.array([move.arm]), np.array([move.source]), np.array([move.target])
        # It comes when the next grip begins, if it does not hold the body up
        whole = max(move.duration, 0.0 if move.delay else (move.land - move.lift) * swings.path.spacing)
        least = whole - swings.extra
        if move.way >= len(WAYS):
            return SwingLaw._waiting(swings, move, (arms, source, target), least)
        way = swings.curve(arms, source, target, np.array([move.lift]), move.way)
        part = np.linspace(0.0, 1.0, COARSE)
        for _ in range(PASSES):
            # While the hand opens and closes the body moves on
            samples = (move.lift + (move.land - move.lift) * (swings.latch + part * least) / whole)[None]
            wrists = grip_wrists(swings.grips, source, target, COARSE)
            found = speeds(swings.kinematics, swings.walker, arms, swings.path, way, samples, wrists)
            part = found.time[0] / found.duration[0]
        fine = np.interp(np.linspace(0.0, 1.0, FINE), np.linspace(0.0, 1.0, COARSE), samples[0])
        wrists = grip_wrists(swings.grips, source, target, FINE)
        return SwingLaw(swings.walker, move.arm, swings.path, way, fine, wrists, least)

    @staticmethod
    def _waiting(swings: Swings, move: Move, ends: tuple[Ints, Ints, Ints], whole: float) -> SwingLaw:
        """The law of a move whose hand waits: of the way off the hold, the ride, and the way onto the next one."""
        spacing, begin = swings.path.spacing, np.array([move.lift + swings.latch / swings.path.spacing])
        found = swings.waiting(ends, (begin, begin + whole / spacing), move.way, FINE)
        slow = SLOWLY * float(found.onto.law.duration[0])
        away, onto = (
            SwingLaw(swings.walker, move.arm, swings.path, half.way, half.samples[0], half.wrists, least)
            for half, least in ((found.away, 0.0), (found.onto, slow))
        )
        rides, since = slice(1, FINE - 1), (found.samples[0] - begin) * spacing
        times = np.concatenate([away._times, since[rides], whole - onto.duration + onto._times])
        place = np.concatenate([away.places, found.places[0, rides], onto.places])
        parts = HALFWAY * away._rows[:, 6], np.full(FINE - 2, HALFWAY), HALFWAY + (1 - HALFWAY) * onto._rows[:, 6]
        out = copy(away)
        out.possible, out.duration = bool(found.possible[0]), whole
        out._times = np.linspace(0.0, whole, int(np.ceil(whole / SPACING)) + 1)
        rows = np.column_stack([place, place, np.concatenate(parts)])
        out._rows = np.stack([np.interp(out._times, times, column) for column in rows.T], axis=1)
        out._rows[:, 3:6] = np.gradient(out.places, out._times, axis=0)
        out._rows[[0, -1], 3:6] = 0.0
        return out

    def at(self, time: float) -> Aim:
        """The aim at a time since lifting, clipped to the swing."""
        rows, between, part = self.rows_at(time)
        row = rows[:7] + between * (rows[7:] - rows[:7])
        return Aim(row[:3], row[3:6], float(row[6]), part)

    def rows_at(self, time: float) -> tuple[Array, float, float]:
        """The rows before and after a time, clipped to the swing: position, velocity and part of the wrist's way of
        each ``[14]``; the part of the way between them, and of the whole time.
        """
        part = min(max(time / self.duration, 0.0), 1.0)
        place = part * (len(self._rows) - 1)
        low = min(int(place), len(self._rows) - 2)
        return self._rows[low : low + 2].reshape(14), place - low, part
