"""The swings of one plan: an estimate of their durations for many at once, and for each a curve that is clear, with the
least time along it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking.body_path import BodyPath
from wbc.walking.holds.structure import Structure
from wbc.walking.planner.around import around
from wbc.walking.planner.grips.conflicts import ArmClearance
from wbc.walking.planner.grips.table import Grips, Ints
from wbc.walking.planner.slices import Slices, drained
from wbc.walking.planner.swings.compiled_choice import CompiledChoice, Name
from wbc.walking.planner.swings.curve import ALTERNATIVES, Curves, Pivots, curves
from wbc.walking.planner.swings.move import Chosen, Move, Swing
from wbc.walking.planner.swings.tracks import TrackRequests, Tracks, points_along, tracks
from wbc.walking.planner.swings.waiting import Waiting, WaitRequests, waiting

#: Points of a curve: enough for the search, and for carrying it out
COARSE, FINE = 25, 97
#: A law at FINE points takes so many times as long as one at COARSE points, at most
FINER = 1.04
#: Time to settle on the hold before the hand closes, besides the latch twice [s]
SETTLE = 0.06
#: Swings that are computed together, curve by curve and with all curves at once
TOGETHER, QUICKLY = 24, 12
#: No swing lasts so many samples: that other arms hold for longer makes no difference
LONG = 60
#: Parts of the estimate: of every swing [s], of the slowest joint's least time, of the distance [s/m]. It is low, so
#: that the search drops no swing that would do: of ten swings between all grips of the published courses, eight last
#: from 0.02 s less to 0.56 s more
ESTIMATE = (1.11, 0.64, 0.59)
#: Samples after lifting at which the body stands that curves go by: before a swing is half over
HALFWAY = 14
#: Hands land at least so many samples inside a grip
INSIDE = 1


@dataclass(frozen=True, eq=False)
class _Track:
    """A swing along one curve: duration [s], points of the arm ``[n, points, 3]``, samples ``[n]``."""

    duration: float
    points: Array
    samples: Array


class HandLaw(Protocol):
    """Where a swinging hand is when."""

    def along(self, times: Array, /) -> tuple[Array, Array]:
        """Positions [m] and parts of the guided joints' change at times since the hand is open [s]."""


class Swings:
    """Swings of a body's arms between grips over one path; results are cached.

    It is a :class:`wbc.walking.planner.stances.search.SwingTable`.
    """

    def __init__(
        self, walker: Walker, structure: Structure, path: BodyPath, grips: Grips, arms: ArmClearance | None = None
    ) -> None:
        self.walker, self.structure, self.path, self.grips = walker, structure, path, grips
        self.arms = arms or ArmClearance(walker, grips)
        self.shapes, self.limb, self.margins = self.arms.shapes, self.arms.shapes.limb, walker.margins
        self.latch = walker.arm_data.latch_time
        self.extra = 2 * self.latch + SETTLE
        # The hand is on its hold before it is latched
        self.touch = round((self.latch + SETTLE) / path.spacing)
        # Hands that swing keep less of the others than hands that hold
        self._less = self.margins.held_clearance - self.margins.swing_clearance
        self._rates = np.array(self.limb.joint_rates)[:-1]
        self.around = around(walker, structure)
        self._quick: CompiledChoice | None = None
        if self.around.world is not None:
            apart, times = self.shapes.least - self._less, (self.extra, self.latch)
            self._quick = CompiledChoice(
                walker, structure, path, grips, self.shapes, self.around.world, apart, COARSE, HALFWAY, *times
            )
        self._tracks: dict[tuple[Name, int], _Track | None] = {}
        self._apart: dict[tuple[Name, int, int], bool] = {}
        self._chosen: dict[Swing, Chosen | None] = {}
        self._known: dict[tuple[int, int, int, int, int], float | None] = {}

    @property
    def curves(self) -> int:
        """That are tried for a swing, those with a wait included."""
        return len(ALTERNATIVES) + len(self.limb.waiting)

    def estimate(self, sources: Ints, targets: Ints, lift: Ints, land: Ints) -> Array:
        """About how long swings from grips take, lifted and landed at about these samples; latches included [s].

        c + r max_k |dq_k| / rate_k + d |p_target - p_source|, see :data:`ESTIMATE`.
        """
        places, grips = self.structure.positions, self.grips
        far = np.linalg.norm(places[grips.hold[targets]] - places[grips.hold[sources]], axis=1)
        turn = np.abs(grips.posture(targets, land) - grips.posture(sources, lift))[:, :-1]
        constant, turning, going = ESTIMATE
        out: Array = constant + turning * (turn / self._rates).max(axis=1) + going * far
        return np.round(out, 6)

    def soonest(self) -> Ints:
        """First samples at which hands land on grips: inside them, and with the elbow bent."""
        bent = self.limb.elbow_bend(self.grips.postures) >= self.margins.landing_elbow
        out: Ints = np.maximum(self.grips.first + INSIDE, self.grips.first_where(bent) + self.touch)
        return out

    def lands(self, targets: Ints, samples: Ints) -> NDArray[np.bool_]:
        """Whether the wrist is bent enough to land: only then joints turn the hand's axis."""
        postures = self.grips.posture(targets, samples - self.touch)
        return np.asarray(self.limb.wrist_bend(postures) >= self.margins.landing_wrist)

    def prepare(self, swings: Iterable[Swing]) -> None:
        """Find curves for swings together: the first that is possible and clear."""
        drained(self.slices(swings))

    def slices(self, swings: Iterable[Swing]) -> Slices[None]:
        """As :meth:`prepare`, curve by curve."""
        left = list(dict.fromkeys(s for s in swings if s not in self._chosen))
        quick = self._quick is not None
        for begin in range(0, len(left) if quick else 0, QUICKLY):
            self._choose(left[begin : begin + QUICKLY])
            yield None
        left = [swing for swing in left if self._chosen.get(swing) is None]
        for which in range(len(ALTERNATIVES) if quick else 0, len(ALTERNATIVES) + len(self.limb.waiting)):
            if not left:
                return
            if which == len(ALTERNATIVES):
                self._chosen.update(dict.fromkeys(left))
                long = self.extra + self.margins.long_wait
                left = [s for s in left if (s.soonest - s.lift) * self.path.spacing >= long]
            for begin in range(0, len(left), TOGETHER):
                self._track(left[begin : begin + TOGETHER], which)
                yield None
                self._check(left[begin : begin + TOGETHER], which)
                yield None
            rest = []
            for swing in left:
                track = self._tracks[_name(swing), which]
                # A time that was corrected for other ends says nothing where there is no curve for these
                known = None if track is None else self._known.get((*_name(swing)[:4], which), track.duration)
                if known is not None and all(self._apart[_name(swing), which, g] for g in swing.others):
                    self._chosen[swing] = Chosen(which, known)
                else:
                    rest.append(swing)
            left = rest
        self._chosen.update(dict.fromkeys(left))

    def _choose(self, swings: Sequence[Swing]) -> None:
        """As :meth:`slices`, all curves at once, by compiled code."""
        assert self._quick is not None
        names, others = [_name(swing) for swing in swings], [swing.others for swing in swings]
        count = len(ALTERNATIVES)
        barred = np.zeros((len(swings), count), dtype=np.bool_)
        for row, name in enumerate(names) if self._known else ():
            barred[row] = [self._known.get((*name[:4], which), 0.0) is None for which in range(count)]
        for swing, name, which, law in zip(swings, names, *self._quick.choose(names, others, barred), strict=True):
            known = self._known.get((*name[:4], which))
            duration = FINER * law + self.extra if known is None else known
            self._chosen[swing] = None if which < 0 else Chosen(which, duration)

    def choose(self, swing: Swing) -> Chosen | None:
        """The curve of a swing; None where it is not possible, or none is clear."""
        if swing not in self._chosen:
            self.prepare([swing])
        return self._chosen[swing]

    def clear(self, swing: Swing, which: int) -> bool:
        """Whether a swing along one of the curves is possible, and clear of the structure and of the other arms."""
        self._track([swing], which)
        self._check([swing], which)
        name = _name(swing)
        return self._tracks[name, which] is not None and all(self._apart[name, which, g] for g in swing.others)

    def clear_along(self, move: Move, others: Sequence[int], angles: Array, samples: Array) -> bool:
        """Whether the arm of a move is clear as :meth:`clear` says, at joints ``[1, n, joints]`` [rad], the last of
        which may be left out, and samples of the path ``[1, n]``.

        Args:
            others: grips of the other arms.
        """
        points = points_along(self.shapes, np.array([move.arm]), angles)
        ends = self.grips.hold[[[move.source, move.target]]]
        if not self.around.swings(np.array([move.arm]), points, self.path.blended(samples), ends)[0]:
            return False
        points, samples = (np.repeat(array, len(others), axis=0) for array in (points, samples))
        return bool(self.arms.stay_clear(points, samples, np.array(others, dtype=np.int64), self._less).all())

    def posture_along(self, move: Move, law: HandLaw, samples: Array, since: Array) -> Array:
        """Joints of the arm of a move ``[k, joints]`` [rad], with the body at samples of the path, at times since the
        hand is open ``[k]`` [s].
        """
        limb, grips = self.limb, self.grips
        places, part = law.along(since)
        frames = self.path.blended(samples) @ self.shapes.bases[move.arm]
        first, last = (grips.between(np.array(grip), samples)[:, limb.guided :] for grip in (move.source, move.target))
        guide = first + part[:, None] * (last - first)
        angles, _ = limb.follow(frames[None], places[None], guide[None], self.margins)
        out: Array = angles[0]
        return out

    def correct(self, move: Move, duration: float, possible: bool) -> None:
        """A swing along the curve of a move takes another time [s], or is not possible after all."""
        name = move.arm, move.source, move.target, move.lift
        self._known[*name, move.curve] = duration if possible else None
        for swing in [s for s in self._chosen if _name(s)[:4] == name]:
            del self._chosen[swing]

    def curve(self, arms: Ints, source: Ints, target: Ints, lift: Ints, which: int) -> Curves:
        """Curves of the hands of arms from grips to grips, lifted at samples of the path; ``[m]`` each."""
        grips, later = self.grips, np.minimum(lift + HALFWAY, len(self.path) - 1)
        turn = grips.posture(target, later + HALFWAY)[:, 0] - grips.posture(source, lift)[:, 0]
        pivots = Pivots(self.path.poses[later] @ self.shapes.bases[arms], turn)
        return curves(self.walker, self.structure, grips.hold[source], grips.hold[target], pivots, which)

    def _track(self, swings: Sequence[Swing], which: int) -> None:
        """Angles, times and clearance of the structure along one of the curves."""
        names = list(dict.fromkeys(_name(s) for s in swings if (_name(s), which) not in self._tracks))
        if not names:
            return
        arms, source, target, lift, last, soonest = np.ascontiguousarray(np.array(names, dtype=np.int64).T)
        # The body moves on while the hand opens
        begin, least = lift + self.latch / self.path.spacing, (soonest - lift) * self.path.spacing - self.extra
        if which < len(ALTERNATIVES):
            curve = self.curve(arms, source, target, lift, which)
            asked = TrackRequests(arms, source, target, begin, last, least)
            found = tracks(self.walker, self.shapes, self.path, self.grips, curve, asked, COARSE)
        else:
            whole = begin, begin + least / self.path.spacing
            found = Tracks.of(self.waiting((arms, source, target), whole, which, COARSE), arms, self.shapes)
        ends = self.grips.hold[np.stack([source, target], axis=1)]
        bodies = self.path.blended(found.samples)
        possible = found.possible & self.around.swings(arms, found.points, bodies, ends)
        for k, name in enumerate(names):
            duration = FINER * float(found.duration[k]) + self.extra
            track = _Track(duration, found.points[k], found.samples[k])
            self._tracks[name, which] = track if possible[k] else None

    def waiting(self, ends: tuple[Ints, Ints, Ints], times: tuple[Array, Array], which: int, n: int) -> Waiting:
        """Swings of arms from grips to grips, between samples, that wait in the air."""
        asked = WaitRequests(*ends, *times)
        return waiting(self.walker, self.structure, self.path, self.grips, asked, which - len(ALTERNATIVES), n)

    def _check(self, swings: Sequence[Swing], which: int) -> None:
        """Clearance of the other arms."""
        asked = [(_name(s), which, g) for s in swings for g in s.others if self._tracks[_name(s), which] is not None]
        todo = [key for key in dict.fromkeys(asked) if key not in self._apart]
        found = [track for key in todo if (track := self._tracks[key[0], which]) is not None]
        if not found:
            return
        points, samples = np.array([t.points for t in found]), np.array([t.samples for t in found])
        clear = self.arms.stay_clear(points, samples, np.array([key[2] for key in todo], dtype=np.int64), self._less)
        self._apart.update(zip(todo, clear.tolist(), strict=True))


def _name(swing: Swing) -> Name:
    last = min(swing.until, max(swing.lift + LONG, swing.soonest))
    return swing.arm, swing.source, swing.target, swing.lift, last, swing.soonest
