"""Which limb goes to which foothold when, while the body goes its way."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wbc.climb.along.spans import SpanTable
from wbc.climb.along.swings import SwingKey, Swings
from wbc.climb.along.touches import Touches
from wbc.climb.first import cheapest_first
from wbc.climb.stance import FREE_LIMB
from wbc.validation import Array

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
#: Instants between those at which swings are looked at
LOOKS = 3
#: Instants for which a limb is in the air at most, as the search guesses how many swings are left
FLIGHT = 40
#: How many instants before its span begins a limb lifts, as the search guesses at first
EARLY = 30
#: What time until limbs have to lift is worth, as a part of the way's, beside a swing
ROOM = 1.0
#: What time that has passed costs beside that
PASSED = 0.5


@dataclass(frozen=True, eq=False)
class Standing:
    """All limbs hold, from an instant on.

    Attributes:
        rows: of the spans of the limbs. now: instant.
        before: from which it came. limb: that swings; -1 at the beginning. lift: when.
        until: instant to which all can hold, links being clear. straight: whether the limb went straight over.
    """

    rows: tuple[int, ...]
    now: int
    before: Standing | None = None
    limb: int = -1
    lift: int = 0
    until: int = 0
    straight: bool = False

    @property
    def chain(self) -> list[Standing]:
        """All from the first on."""
        out = [self]
        while out[-1].before is not None:
            out.append(out[-1].before)
        return out[::-1]

    @property
    def swing(self) -> SwingKey:
        """That led here."""
        assert self.before is not None
        return self.limb, (self.before.rows[self.limb], self.rows[self.limb]), self.straight, self.lift, self.now


class AlongSearch:
    """A beam over standings, swing by swing: by the swings that each limb needs at least were it alone, and by the time
    that is left until limbs have to lift. Swings, and which limbs touch, are known limb by limb and pair by pair.

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
        self.looked, self.furthest, self.outcomes = 0, 0, Counter[str]()
        #: Swings that may not be, as (limb, rows, straight): their motion was not proven clear
        self.forbidden = set[tuple[int, tuple[int, int], bool]]()
        #: Spans of all limbs that may not be at once: links are not proven clear
        self.barred = set[tuple[int, ...]]()
        self._begins, self._ends = table.begins, table.ends
        self._left = [self._alone(limb) for limb in range(len(table.limbs))]
        self._borne: dict[bytes, bool] = {}
        self._touches = Touches(table)
        self._swung: dict[SwingKey, tuple[float, NDArray[np.int32], Array]] = {}

    def run(self, start: tuple[int, ...] | None, width: int) -> Standing | None:
        """The last standing of the way found, swing by swing by the most promising standings; None: there is none, or
        none within the limit.

        Args:
            start: spans of the limbs at the beginning; None: any. width: standings that are kept of each number of
                swings, at most.
        """
        known, end = dict[tuple[int, ...], int](), self.looked + self.most
        some = self._accepted(self._starts() if start is None else iter([Standing(start, 0)]), width, known)
        while some:
            for standing in some:
                self.furthest = max(self.furthest, standing.until)
                if standing.until >= self.end:
                    return standing
            if self.looked >= end:
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
            spans, others = self.table.limbs[limb], self._touches.until(standing.rows, standing.now, limb)
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
                rows = (*standing.rows[:limb], int(able[k]), *standing.rows[limb + 1 :])
                yield Standing(rows, int(lands[k]), standing, limb, int(lifts[k]))

    def _checked(self, standing: Standing) -> Standing | None:
        """With its swing, and perhaps a later landing; None where there is none, or links touch."""
        before, limb, lift = standing.before, standing.limb, standing.lift
        if before is None:
            return self._held(standing) if self._bears(standing.rows, -1, 0) else None
        if not self._bears(before.rows, limb, lift) or not self._bears(before.rows, limb, standing.now):
            self.outcomes["not borne"] += 1
            return None
        others = self._touches.until(before.rows, before.now, limb)
        latest = min(others, int(self._ends[limb][standing.rows[limb]])) - 1
        why = ""
        for straight in (False, True):
            if (limb, (before.rows[limb], standing.rows[limb]), straight) in self.forbidden:
                continue
            swinging = self._long_enough(replace(standing, straight=straight), latest)
            if isinstance(swinging, str):
                why = why or swinging
                continue
            if self._touches.clear(swinging.swing, *self._swing(swinging.swing)[1:], before.rows):
                return self._held(swinging)
            why = why or "links touch"
        self.outcomes[why or "no swing"] += 1
        return None

    def _long_enough(self, standing: Standing, latest: int) -> Standing | str:
        """With the landing that its swing's joints need; or why there is none."""
        for _ in range(LONGER):
            used = self._swing(standing.swing)[0]
            if used <= SHORT:
                return standing
            if used == np.inf:
                return "no swing"
            land = standing.lift + int(np.ceil((standing.now - standing.lift) * min(used, LONGEST)))
            if land > latest:
                break
            standing = replace(standing, now=land)
        return "too slow"

    def _swing(self, key: SwingKey) -> tuple[float, NDArray[np.int32], Array]:
        """As :meth:`Swings.swung`, at some instants."""
        if key not in self._swung:
            limb, rows, _, lift, land = key
            ends = np.vstack([self._ended(limb, rows[0], lift, -1), self._ended(limb, rows[1], land, 1)])
            self._swung[key] = self.swings.swung(key, ends, min(land - lift, max(6, (land - lift) // LOOKS)))
        return self._swung[key]

    def swung(self, standing: Standing) -> Array | None:
        """The angles of its swing at all instants ``(n, k)``; None where there is none, which is kept in mind."""
        limb, rows, straight, lift, land = standing.swing
        begun = self.table.held(limb, rows[0], max(lift - 1, 0), lift)
        done = self.table.held(limb, rows[1], land, min(land + 1, self.end))
        # A span that begins or ends there has no rate
        rates = [np.nan_to_num(some[-1] - some[0]) for some in (begun, done)]
        ends = np.array([begun[-1], rates[0], done[0], rates[1]])
        if np.isnan(ends[2]).any():
            self.table.cut(limb, rows[1])
            return None
        used, _, angles = self.swings.swung(standing.swing, ends, land - lift)
        if used < np.inf:
            return angles
        self.forbidden.add((limb, rows, straight))
        return None

    def _ended(self, limb: int, row: int, instant: int, way: int) -> Array:
        """Angles of a span at an instant, and their rates there by the instant before or after ``(2, k)``."""
        begin, angles = self.table.near(limb, row)
        k = instant - begin
        beside = min(max(k + way, 0), len(angles) - 1)
        return np.array([angles[k], way * (angles[beside] - angles[k])])

    def _bears(self, rows: tuple[int, ...], swinging: int, instant: int) -> bool:
        """Whether the limbs that stay bear the robot."""
        contacts = [
            int(self.table.limbs[limb].place[row]) if limb != swinging else FREE_LIMB for limb, row in enumerate(rows)
        ]
        weightless = bool(self.world.numbers.weightless)
        key = np.array([*contacts, 0 if weightless else instant]).tobytes()
        if key not in self._borne:
            state = self._state(rows, instant)
            center = np.zeros(3) if weightless or state is None else self.world.center(state)
            self._borne[key] = state is not None and self.world.slack(contacts, center)[0] >= self.margin
        return self._borne[key]

    def _state(self, rows: tuple[int, ...], instant: int) -> Array | None:
        """Of :class:`ClimbWorld` while all hold; None where they do not."""
        offsets = self.world.offsets
        out = np.empty(12 + offsets[-1])
        out[:12] = self.table.track.places[instant]
        for limb, row in enumerate(rows):
            begin, angles = self.table.near(limb, row)
            if not 0 <= instant - begin < len(angles):
                return None
            out[12 + offsets[limb] : 12 + offsets[limb + 1]] = angles[instant - begin]
        return out

    def places(self, rows: tuple[int, ...]) -> list[int]:
        """Of the limbs."""
        return [int(self.table.limbs[limb].place[row]) for limb, row in enumerate(rows)]

    def _held(self, standing: Standing) -> Standing | None:
        """With the instant to which all can hold; None where links touch at once."""
        until = -1 if standing.rows in self.barred else self._touches.until(standing.rows, standing.now)
        if until < standing.now:
            self.outcomes["links touch"] += 1
            return None
        return replace(standing, until=until)
