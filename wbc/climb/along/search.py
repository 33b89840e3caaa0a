"""Which limb goes to which foothold when, while the body goes its way."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wbc.climb.along.spans import SpanTable
from wbc.climb.along.swings import Swings
from wbc.climb.first import cheapest_first
from wbc.climb.stance import FREE_LIMB
from wbc.validation import Array

#: Standings that are kept of each number of swings, where few do not lead there, more; and whether joints may go evenly
#: where no contact goes straight over
WIDTHS = ((6, False), (24, False), (24, True))
#: How many times more are looked at
MORE_LOOKED_AT = 10
#: First stances that are tried at most
STARTS = 300
#: How much longer than it should be a swing may be too short for: the whole motion is slowed there
SHORT = 1.05
#: How often a swing is made longer
LONGER = 3
#: How many times longer each time at most
LONGEST = 1.5
#: Instants between those at which links are looked at while all limbs hold
LOOKS = 8
#: The same while a limb swings
SWING_LOOKS = 2
#: Instants for which a limb is in the air at most, as the search guesses how many swings are left
FLIGHT = 40
#: How many instants before its span begins a limb lifts, as the search guesses at first
EARLY = 30
#: Part of a swing in which a limb counts as being at what it leaves or comes to
NEAR = 0.3
#: What time until limbs have to lift is worth, as a part of the way's, beside a swing
ROOM = 1.0
#: What time that has passed costs beside that
PASSED = 0.5


@dataclass(frozen=True, eq=False)
class Swing:
    """A limb leaves a span and comes to another.

    Attributes:
        limb: which. rows: of its spans. lift, land: instants. angles: from lift to land ``(n, k)``.
    """

    limb: int
    rows: tuple[int, int]
    lift: int
    land: int
    angles: Array


@dataclass(frozen=True, eq=False)
class Standing:
    """All limbs hold, from an instant on.

    Attributes:
        rows: of the spans of the limbs. now: instant.
        before: from which it came. limb: that swings; -1 at the beginning. lift: when.
        swing: once it was looked at. until: instant to which all can hold, links being clear.
    """

    rows: tuple[int, ...]
    now: int
    before: Standing | None = None
    limb: int = -1
    lift: int = 0
    swing: Swing | None = None
    until: int = 0


class AlongSearch:
    """A beam over standings, swing by swing: by the swings that each limb needs at least were it alone, and by the time
    that is left until limbs have to lift.

    Args:
        table: spans of all limbs. swings: of them. margin: least slack of equilibrium of limbs that hold.
        most: standings that are looked at, at most.

    Attributes:
        looked: how many were. outcomes: what became of those that are none. furthest: the last instant to which all
            limbs could hold.
    """

    def __init__(self, table: SpanTable, swings: Swings, margin: float, most: int) -> None:
        self.table, self.world, self.swings = table, table.world, swings
        self.margin, self.most = margin, most
        self.end = len(table.track.instants) - 1
        self._evenly = False
        self.looked, self.furthest, self.outcomes = 0, 0, Counter[str]()
        #: Swings that may not be, as (limb, rows, lift): no motion was found for them
        self.forbidden = set[tuple[int, tuple[int, int], int]]()
        #: Spans of all limbs that may not be at once: links are not proven clear
        self.barred = set[tuple[int, ...]]()
        self._ends = [table.coarse[spans.last] for spans in table.limbs]
        self._begins = [table.coarse[spans.first] for spans in table.limbs]
        self._left = [self._alone(limb) for limb in range(len(table.limbs))]
        self._borne: dict[bytes, bool] = {}
        #: What is known already to wider beams: to which instant links are clear from one on, and whether in a swing
        self._until: dict[tuple[tuple[int, ...], int], int] = {}
        self._passed: dict[tuple[tuple[int, ...], int, tuple[int, int], int, int, bool], bool] = {}

    def run(self, start: tuple[int, ...] | None) -> Standing | None:
        """The last standing of the way found; None: there is none, or none within the limit.

        Args:
            start: spans of the limbs at the beginning; None: any.
        """
        for width, self._evenly in WIDTHS:
            if (last := self._beam(start, width)) is not None:
                return last
        return None

    def _beam(self, start: tuple[int, ...] | None, width: int) -> Standing | None:
        """Swing by swing the most promising standings, so many at most."""
        known = dict[tuple[int, ...], int]()
        some = self._accepted(self._starts() if start is None else iter([Standing(start, 0)]), width, known)
        while some:
            for standing in some:
                self.furthest = max(self.furthest, standing.until)
                if standing.until >= self.end:
                    return standing
            if self.looked >= self.most:
                return None
            next_ = [(self._cost(after), k, after) for one in some for k, after in enumerate(self._after(one))]
            next_.sort(key=lambda entry: entry[:2])
            some = self._accepted((entry[2] for entry in next_ if np.isfinite(entry[0])), width, known)
        return None

    def _accepted(self, standings: Iterator[Standing], width: int, known: dict[tuple[int, ...], int]) -> list[Standing]:
        """The first that can be, of so many at most; of each one before, half of them at most."""
        out, tries, following = list[Standing](), 0, Counter[int]()
        for standing in standings:
            if len(out) >= width or tries >= MORE_LOOKED_AT * width:
                break
            before = id(standing.before) if standing.before is not None else 0
            if known.get(standing.rows, self.end + 1) <= standing.now or (before and following[before] > width // 2):
                continue
            tries += 1
            self.looked += 1
            checked = self._checked(standing)
            if checked is None or known.get(checked.rows, self.end + 1) <= checked.now:
                continue
            known[checked.rows] = checked.now
            following[before] += 1
            out.append(checked)
        return out

    def _alone(self, limb: int) -> Array:
        """Swings that a limb needs at least from each of its spans on."""
        begins, ends = self._begins[limb], self._ends[limb]
        left = np.full(len(ends), np.inf)
        left[ends >= self.end] = 0.0
        for count in range(1, len(ends) + 1):
            known = left == count - 1
            if not known.any():
                break
            left[np.isinf(left) & (ends + FLIGHT >= begins[known].min())] = count
        return left

    def _cost(self, standing: Standing) -> float:
        left = sum(float(self._left[limb][row]) for limb, row in enumerate(standing.rows))
        ends = sorted(float(self._ends[limb][row]) for limb, row in enumerate(standing.rows))
        room = sum(end / (k + 1.0) for k, end in enumerate(ends)) - PASSED * standing.now
        return left - ROOM * room / max(self.end, 1)

    def _starts(self) -> Iterator[Standing]:
        choices = []
        for limb, left in enumerate(self._left):
            rows = np.flatnonzero((self._begins[limb] == 0) & np.isfinite(left))
            worth = left[rows] - 0.5 * self._ends[limb][rows] / max(self.end, 1)
            order = np.argsort(worth, kind="stable")
            choices.append([(float(worth[k]), int(rows[k])) for k in order])
        if not all(choices):
            return
        for starts in itertools.islice(cheapest_first(choices), STARTS):
            held = [self._hold(limb, row) for limb, row in enumerate(starts)]
            if len(set(held)) == len(held):
                yield Standing(tuple(starts), 0)

    def _hold(self, limb: int, row: int) -> int:
        return int(self.world.hold[self.table.limbs[limb].place[row]])

    def _after(self, standing: Standing) -> Iterator[Standing]:
        """What may come next: one limb goes to another span."""
        ends = [int(self._ends[limb][row]) for limb, row in enumerate(standing.rows)]
        holds = [self._hold(limb, row) for limb, row in enumerate(standing.rows)]
        # At first it is at rest, and a limb may lift at once
        soonest, coarse = standing.now + (standing.before is not None), self.table.coarse
        for limb, row in enumerate(standing.rows):
            spans, others = self.table.limbs[limb], min(end for k, end in enumerate(ends) if k != limb)
            begins, lasts = self._begins[limb], self._ends[limb]
            latest = min(ends[limb], standing.until)
            lift = np.minimum(np.maximum(soonest, begins - EARLY), latest)
            taken = np.isin(self.world.hold[spans.place], [hold for k, hold in enumerate(holds) if k != limb])
            able = np.flatnonzero(
                (lasts > ends[limb]) & ~taken & np.isfinite(self._left[limb]) & (lift >= soonest) & (begins <= others)
            )
            able = able[able != row]
            if not len(able):
                continue
            lifts = lift[able]
            at = np.clip(np.searchsorted(coarse, lifts), spans.first[row], spans.last[row])
            leaves, lands = spans.angles[row, at], np.maximum(lifts + EARLY, begins[able])
            for _ in range(2):
                at = np.clip(np.searchsorted(coarse, lands), spans.first[able], spans.last[able])
                takes = np.ceil(self.swings.shortest(limb, spans.angles[able, at] - leaves)).astype(int)
                lands = np.maximum(lifts + takes, begins[able])
                lifts = np.minimum(np.maximum(soonest, lands - takes), latest)
            for k in np.flatnonzero((lands < others) & (lands < lasts[able])).tolist():
                if (limb, (row, int(able[k])), int(lifts[k])) in self.forbidden:
                    continue
                rows = (*standing.rows[:limb], int(able[k]), *standing.rows[limb + 1 :])
                yield Standing(rows, int(lands[k]), standing, limb, int(lifts[k]))

    def _checked(self, standing: Standing) -> Standing | None:
        """With its swing, and perhaps a later landing; None where there is none, or links touch."""
        before, limb, lift = standing.before, standing.limb, standing.lift
        if before is None:
            return self._held(standing) if self._bears(standing.rows, -1, 0) else None
        rows = before.rows[limb], standing.rows[limb]
        others = [int(self._ends[k][row]) for k, row in enumerate(before.rows) if k != limb]
        latest = min(*others, int(self._ends[limb][rows[1]])) - 1
        if not self._bears(before.rows, limb, lift) or not self._bears(before.rows, limb, standing.now):
            self.outcomes["not borne"] += 1
            return None
        for straight in (True, False) if self._evenly else (True,):
            swing = self._swing(limb, rows, lift, standing.now, latest, straight)
            if swing is None:
                continue
            key = before.rows, limb, rows, swing.lift, swing.land, straight
            if key not in self._passed:
                self._passed[key] = self._clear(before, swing)
            if self._passed[key]:
                return self._held(replace(standing, now=swing.land, swing=swing))
            self.outcomes["links touch"] += 1
        return None

    def _swing(
        self, limb: int, rows: tuple[int, int], lift: int, land: int, latest: int, straight: bool
    ) -> Swing | None:
        """The swing, as long as its joints need; None where there is none."""
        for _ in range(LONGER):
            angles = self.swings.swung(limb, rows, lift, land, straight)
            if angles is None:
                self.outcomes["no swing"] += 1
                return None
            used = self.swings.used(limb, angles)
            if used <= SHORT:
                return Swing(limb, rows, lift, land, angles)
            land = lift + int(np.ceil((land - lift) * min(used, LONGEST)))
            if land > latest:
                break
        self.outcomes["too slow"] += 1
        return None

    def _bears(self, rows: tuple[int, ...], swinging: int, instant: int) -> bool:
        """Whether the limbs that stay bear the robot."""
        contacts = [
            int(self.table.limbs[limb].place[row]) if limb != swinging else FREE_LIMB for limb, row in enumerate(rows)
        ]
        weightless = bool(self.world.numbers.weightless)
        key = np.array([*contacts, 0 if weightless else instant]).tobytes()
        if key not in self._borne:
            state = self.states(rows, np.array([instant]))[0]
            known = bool(weightless or np.isfinite(state).all())
            center = np.zeros(3) if weightless or not known else self.world.center(state)
            self._borne[key] = known and self.world.slack(contacts, center)[0] >= self.margin
        return self._borne[key]

    def states(self, rows: tuple[int, ...], instants: NDArray[np.intp]) -> Array:
        """Of :class:`ClimbWorld` while all hold ``(n, ...)``, NaN where they do not."""
        offsets = self.world.offsets
        out = np.empty((len(instants), 12 + offsets[-1]))
        out[:, :12] = self.table.track.places[instants]
        for limb, row in enumerate(rows):
            some = self.table.held(limb, row, int(instants[0]), int(instants[-1]))
            out[:, 12 + offsets[limb] : 12 + offsets[limb + 1]] = some[instants - instants[0]]
        return out

    def places(self, rows: tuple[int, ...]) -> list[int]:
        """Of the limbs."""
        return [int(self.table.limbs[limb].place[row]) for limb, row in enumerate(rows)]

    def _held(self, standing: Standing) -> Standing | None:
        """With the instant to which all can hold; None where links touch at once."""
        if standing.rows in self.barred:
            return None
        key = standing.rows, standing.now
        if key not in self._until:
            self._until[key] = self._clear_until(*key)
        if self._until[key] < 0:
            self.outcomes["links touch"] += 1
            return None
        return replace(standing, until=self._until[key])

    def _clear_until(self, rows: tuple[int, ...], now: int) -> int:
        """The instant to which links are clear while all hold; -1: not at once."""
        ends = min(int(self._ends[limb][row]) for limb, row in enumerate(rows))
        instants = np.unique(np.append(np.arange(now, ends, LOOKS), ends))
        states = self.states(rows, instants)
        states = states[np.isfinite(states).all(axis=1).cumprod().astype(bool)]
        if not len(states):
            return -1
        contacts = np.tile(np.array(self.places(rows), dtype=np.int32), (len(states), 1))
        touch = self.world.first_touch(contacts, states)
        last = len(states) - 1 if touch is None else touch[0] - 1
        return int(instants[last]) if last >= 0 else -1

    def _clear(self, before: Standing, swing: Swing) -> bool:
        """Whether links are clear while a limb swings."""
        offsets, limb = self.world.offsets, swing.limb
        instants = np.arange(swing.lift, swing.land + 1)
        states = self.states(before.rows, instants)
        states[:, 12 + offsets[limb] : 12 + offsets[limb + 1]] = swing.angles
        if not np.isfinite(states).all():
            return False
        contacts = np.tile(np.array(self.places(before.rows), dtype=np.int32), (len(instants), 1))
        near = max(1, int(NEAR * len(instants)))
        contacts[near : len(instants) - near, limb] = FREE_LIMB
        contacts[len(instants) - near :, limb] = self.table.limbs[limb].place[swing.rows[1]]
        return self.world.first_touch(contacts[::SWING_LOOKS], states[::SWING_LOOKS]) is None
