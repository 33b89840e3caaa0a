"""The swings of one plan: an estimate of their durations for many at once, and for each a way that is clear, with the
least time along it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking.arms.puma import ArmKinematics
from wbc.walking.body_path import BodyPath
from wbc.walking.holds.structure import Structure
from wbc.walking.planner.grips.conflicts import ArmClearance
from wbc.walking.planner.grips.table import Grips, Ints
from wbc.walking.planner.slices import Slices, drained
from wbc.walking.planner.swings.clearance import SwingClearance
from wbc.walking.planner.swings.compiled_ways import Name, SwingWays
from wbc.walking.planner.swings.curve import WAYS, Curves, Pivots, curves
from wbc.walking.planner.swings.move import Move
from wbc.walking.planner.swings.parked import PARKS, Parked, parked
from wbc.walking.planner.swings.parked import Asked as Parking
from wbc.walking.planner.swings.tracks import Asked, Tracks, tracks

#: Points of a way: enough for the search, and for carrying it out
COARSE, FINE = 25, 97
#: A law at FINE points takes so many times as long as one at COARSE points, at most
FINER = 1.04
#: Time to settle on the hold before the hand closes, besides the latch twice [s]
SETTLE = 0.06
#: Hands that are on their way for so long, latches not counted, may wait where they go with the body [s]
LONG_WAIT = 3.0
#: Swings that are computed together, way by way and with all ways at once
TOGETHER, QUICKLY = 24, 12
#: No swing lasts so many samples, as far as the room of the others is told apart
LONG = 60
#: Parts of the estimate: of every swing [s], of the slowest joint's least time, of the way [s/m]
ESTIMATE = (1.11, 0.64, 0.59)
#: Samples after lifting at which the body is about where the swing is halfway
HALFWAY = 14


class Swing(NamedTuple):
    """A swing that is asked about.

    Attributes:
        arm: row. source, target: grips. lift: sample of the body's path.
        room: last sample that the other arms can hold; the body waits there for the hand.
        others: grips of the other arms.
        soonest: sample at which the hand may land; a faster one takes until then.
    """

    arm: int
    source: int
    target: int
    lift: int
    room: int
    others: tuple[int, ...]
    soonest: int


class Chosen(NamedTuple):
    """How a hand swings: which of the ways, and how long, latches and settling included [s]."""

    way: int
    duration: float


@dataclass(frozen=True, eq=False)
class _Track:
    """A swing along one way: duration [s], points of the arm ``[n, 6, 3]``, samples ``[n]``."""

    duration: float
    points: Array
    samples: Array


class Swings:
    """Swings between grips over one path; what was computed is kept."""

    def __init__(
        self, walker: Walker, structure: Structure, path: BodyPath, grips: Grips, arms: ArmClearance | None = None
    ) -> None:
        self.walker, self.structure, self.path, self.grips = walker, structure, path, grips
        self.data = walker.data
        self.latch: float = walker.data.latch_time  # type: ignore[union-attr]
        self.extra = 2 * self.latch + SETTLE
        self.kinematics = ArmKinematics(walker.data)  # type: ignore[arg-type]
        self._rates = np.array(self.kinematics.data.joint_rates)[:5]
        self._arms = arms or ArmClearance(walker, grips)
        self._clear = SwingClearance(walker, structure, self._arms)
        self._ways: SwingWays | None = None
        if SwingWays.possible(structure):
            times = self.extra, self.latch
            self._ways = SwingWays(walker, structure, path, grips, self._clear, COARSE, HALFWAY, *times)
        self._tracks: dict[tuple[Name, int], _Track | None] = {}
        self._apart: dict[tuple[Name, int, int], bool] = {}
        self._chosen: dict[Swing, Chosen | None] = {}
        self._known: dict[tuple[int, int, int, int, int], float | None] = {}

    def estimate(self, sources: Ints, targets: Ints, lift: Ints, land: Ints) -> Array:
        """About how long swings from grips take, lifted and landed at about these samples; latches included [s].

        c + r max_k |dq_k| / rate_k + w |way|, fitted to swings of the published courses at 1 to 6 in/s: of ten,
        eight last 0.12 s less to 0.17 s more.
        """
        places, grips = self.structure.positions, self.grips
        way = np.linalg.norm(places[grips.hold[targets]] - places[grips.hold[sources]], axis=1)
        turn = np.abs(grips.posture(targets, land) - grips.posture(sources, lift))[:, :5]
        constant, turning, going = ESTIMATE
        out: Array = constant + turning * (turn / self._rates).max(axis=1) + going * way
        return np.round(out, 6)

    def prepare(self, swings: Iterable[Swing]) -> None:
        """Find ways for swings together: the first that is possible and clear."""
        drained(self.slices(swings))

    def slices(self, swings: Iterable[Swing]) -> Slices[None]:
        """As :meth:`prepare`, way by way."""
        left = list(dict.fromkeys(s for s in swings if s not in self._chosen))
        quick = self._ways is not None
        for begin in range(0, len(left) if quick else 0, QUICKLY):
            self._choose(left[begin : begin + QUICKLY])
            yield None
        left = [swing for swing in left if self._chosen.get(swing) is None]
        for way in range(len(WAYS) if quick else 0, len(WAYS) + len(PARKS)):
            if not left:
                return
            if way == len(WAYS):
                self._chosen.update(dict.fromkeys(left))
                left = [s for s in left if (s.soonest - s.lift) * self.path.spacing >= self.extra + LONG_WAIT]
            for begin in range(0, len(left), TOGETHER):
                self._track(left[begin : begin + TOGETHER], way)
                yield None
                self._check(left[begin : begin + TOGETHER], way)
                yield None
            rest = []
            for swing in left:
                track = self._tracks[_name(swing), way]
                # A time that was corrected in other room tells nothing where there is no way in this one
                known = None if track is None else self._known.get((*_name(swing)[:4], way), track.duration)
                if known is not None and all(self._apart[_name(swing), way, g] for g in swing.others):
                    self._chosen[swing] = Chosen(way, known)
                else:
                    rest.append(swing)
            left = rest
        self._chosen.update(dict.fromkeys(left))

    def _choose(self, swings: Sequence[Swing]) -> None:
        """As :meth:`slices`, all ways at once, by compiled code."""
        assert self._ways is not None
        names, others = [_name(swing) for swing in swings], [swing.others for swing in swings]
        barred = np.zeros((len(swings), len(WAYS)), dtype=np.bool_)
        for row, name in enumerate(names) if self._known else ():
            barred[row] = [self._known.get((*name[:4], way), 0.0) is None for way in range(len(WAYS))]
        for swing, name, way, law in zip(swings, names, *self._ways.choose(names, others, barred), strict=True):
            known = self._known.get((*name[:4], way))
            self._chosen[swing] = None if way < 0 else Chosen(way, FINER * law + self.extra if known is None else known)

    def choose(self, swing: Swing) -> Chosen | None:
        """The way of a swing; None where it is not possible, or none is clear."""
        if swing not in self._chosen:
            self.prepare([swing])
        return self._chosen[swing]

    def clear(self, swing: Swing, way: int) -> bool:
        """Whether a swing along one of the ways is possible, and clear of the structure and of the other arms."""
        self._track([swing], way)
        self._check([swing], way)
        name = _name(swing)
        return self._tracks[name, way] is not None and all(self._apart[name, way, g] for g in swing.others)

    def clear_along(self, move: Move, others: Sequence[int], way: Curves, angles: Array, samples: Array) -> bool:
        """Whether the arm of a move is clear as :meth:`clear` says, at angles ``[1, n, 5 or 6]`` [rad] and samples of
        the path ``[1, n]``.

        Args:
            others: grips of the other arms.
        """
        postures = np.zeros((*samples.shape, 6))
        postures[..., :5] = angles[..., :5]
        points, ends = self._arms.points(move.arm, postures), np.stack([way.begin, way.end], axis=1)
        if not self._clear.structure(points, self.path.blended(samples), ends)[0]:
            return False
        count = len(others)
        grips = np.array(others, dtype=np.int64)
        return bool(
            self._clear.others(np.repeat(points, count, axis=0), np.repeat(samples, count, axis=0), grips).all()
        )

    def correct(self, arm: int, source: int, target: int, lift: int, way: int, duration: float, possible: bool) -> None:
        """A swing along one of the ways takes another time [s], or is not possible after all."""
        name = arm, source, target, lift
        self._known[*name, way] = duration if possible else None
        for swing in [s for s in self._chosen if _name(s)[:4] == name]:
            del self._chosen[swing]

    def curve(self, arms: Ints, source: Ints, target: Ints, lift: Ints, way: int) -> Curves:
        """Ways of the hands of arms from grips to grips, lifted at samples of the path; ``[m]`` each."""
        grips, later = self.grips, np.minimum(lift + HALFWAY, len(self.path) - 1)
        bases = np.array([arm.base.homogeneous for arm in self.walker.arms])[arms]
        turn = grips.posture(target, later + HALFWAY)[:, 0] - grips.posture(source, lift)[:, 0]
        pivots = Pivots(self.path.poses[later] @ bases, turn)
        return curves(self.structure, grips.hold[source], grips.hold[target], pivots, self.data, way)  # type: ignore[arg-type]

    def _track(self, swings: Sequence[Swing], way: int) -> None:
        """Angles, times and clearance of the structure along one of the ways."""
        names = list(dict.fromkeys(_name(s) for s in swings if (_name(s), way) not in self._tracks))
        if not names:
            return
        arms, source, target, lift, last, soonest = np.ascontiguousarray(np.array(names, dtype=np.int64).T)
        # The body moves on while the hand opens
        begin, least = lift + self.latch / self.path.spacing, (soonest - lift) * self.path.spacing - self.extra
        if way < len(WAYS):
            curve = self.curve(arms, source, target, lift, way)
            asked = Asked(arms, source, target, begin, last, least)
            found = tracks(self.walker, self._arms, self.path, self.grips, curve, asked, COARSE)
        else:
            whole = begin, begin + least / self.path.spacing
            found = Tracks.of(self.waiting((arms, source, target), whole, way, COARSE), arms, self._arms)
        ends = self.structure.positions[self.grips.hold[np.stack([source, target], axis=1)]]
        bodies = self.path.blended(found.samples)
        possible = found.possible & self._clear.structure(found.points, bodies, ends)
        for k, name in enumerate(names):
            duration = FINER * float(found.duration[k]) + self.extra
            track = _Track(duration, found.points[k], found.samples[k])
            self._tracks[name, way] = track if possible[k] else None

    def waiting(self, ends: tuple[Ints, Ints, Ints], times: tuple[Array, Array], way: int, n: int) -> Parked:
        """Swings of arms from grips to grips, between samples, that wait in the air."""
        asked = Parking(*ends, *times)
        return parked(self.walker, self.structure, self.path, self.grips, asked, way - len(WAYS), n)

    def _check(self, swings: Sequence[Swing], way: int) -> None:
        """Clearance of the other arms."""
        asked = [(_name(s), way, g) for s in swings for g in s.others if self._tracks[_name(s), way] is not None]
        todo = [key for key in dict.fromkeys(asked) if key not in self._apart]
        tracks = [track for key in todo if (track := self._tracks[key[0], way]) is not None]
        if not tracks:
            return
        points, samples = (np.array([getattr(t, name) for t in tracks]) for name in ("points", "samples"))
        clear = self._clear.others(points, samples, np.array([key[2] for key in todo], dtype=np.int64))
        self._apart.update(zip(todo, clear.tolist(), strict=True))


def _name(swing: Swing) -> Name:
    last = min(swing.room, max(swing.lift + LONG, swing.soonest))
    return swing.arm, swing.source, swing.target, swing.lift, last, swing.soonest
