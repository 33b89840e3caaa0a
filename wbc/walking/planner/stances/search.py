"""Which hand goes where, and when: a search over stances along a body path.

A stance is one grip an arm. From a stance whose last hand landed at sample j, an arm can be lifted at l >= j while its
grip lasts and put down on another grip at d, while the grips of the others last. A grip x that begins late makes the
arm wait, as it is never worse to move it as early as possible:

    l = min(max(j, first_x - n), last),    d = max(l + n, first_x),    n = swing time / spacing

(first_x less a few samples inside, and d only where the wrist is bent enough, for the sake of the controller).

If d lies behind the end of another hand's grip, the body slows down so that it is just there when the hand lands, which
delays the walk. All stances that need k re-grasps are made before those that need k + 1, so the first that lasts
to the end of the path needs the fewest; of equal stances the one that is earlier on the path is kept.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations, islice
from math import sin
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from wbc.robots import Walker
from wbc.walking.body_path import BodyPath
from wbc.walking.holds.structure import Structure
from wbc.walking.planner.grips.conflicts import ArmClearance
from wbc.walking.planner.grips.table import Grips, Ints
from wbc.walking.planner.slices import Slices, drained
from wbc.walking.planner.stances.candidates import QUANTUM, Fan, Outlook, following
from wbc.walking.planner.stances.nodes import Found, Node, StanceRooms, way_to
from wbc.walking.planner.swings.move import Key, Move
from wbc.walking.planner.swings.swings import SETTLE, Swing, Swings

__all__ = ["Found", "Node", "StanceSearch"]

#: Hands land at least INSIDE samples inside a grip, wait for it at most HOVER [s], with |sin theta5| of at least BENT
INSIDE, HOVER, BENT = 1, 0.75, 0.08
#: and the elbow bent by at least ELBOW [rad]: joints 2 and 3 of an arm that is nearly straight correct slowly
ELBOW = 0.5
#: Hands land so many samples before a grip of another one ends; the body would slow down before it
SPARE = 2
#: What a swing usually takes, and how much more than enough time for swings is worth something [s]
USUAL, SLACK = 2.1, 0.5
#: Ways to one stance that are looked at, and stances that are checked together, in widths
WAYS, PARTS = 2, 2
#: Stances, and pairs of grips, of one slice of the search
NODES, PAIRS = 16, 96
#: Arm, grips and sample of a swing that was looked at
Asked = tuple[int, int, int, int]


class StanceSearch:
    """A search over the grips of one path.

    Args:
        longest_delay: of one swing [s]; 0: the body never slows down.
        longest_wait: for which a hand may be in the air longer than it needs, until its next grip begins [s].
        width: stances kept of each number of re-grasps, None: all.
        first: row of an arm and of a hold: the first move, whether it is needed or not; None: any.
        known: a search over the same grips, whose swings and distances need not be computed again.
    """

    spare: ClassVar[int] = SPARE
    clearance: ArmClearance
    swings: Swings

    def __init__(
        self,
        walker: Walker,
        structure: Structure,
        path: BodyPath,
        grips: Grips,
        *,
        longest_delay: float = np.inf,
        longest_wait: float = HOVER,
        width: int | None = 200,
        first: tuple[int, int] | None = None,
        known: StanceSearch | None = None,
    ) -> None:
        self.walker, self.structure, self.path, self.grips = walker, structure, path, grips
        if known is None:
            self._equip()
        else:
            self.clearance, self.swings = known.clearance, known.swings
        self._usual = round(USUAL / path.spacing)
        codes = grips.hold * (1 + grips.branch.max(initial=0)) + grips.branch
        self._outlook = Outlook(grips.last, codes, len(path) - 1, self._usual, SLACK / path.spacing, path.spacing)
        # Levels of the last search, and swings (arm, source, target, lift) that each but the first asked for
        self._levels, self._asked = list[dict[Key, Node]](), list[set[Asked]]()
        self.longest_delay, self.longest_wait, self.width, self.first = longest_delay, longest_wait, width, first
        self.expanded = 0
        # The end of the path is no limit of the arm
        lasting = grips.last == len(path) - 1
        self.latest = np.where(lasting, grips.last, grips.last - INSIDE)
        self.rooms = StanceRooms(self.clearance, grips.last, np.where(lasting, grips.last, grips.last - self.spare))
        # The hand is on its hold before it is latched
        self._touch = round((walker.tolerances.latch_time + SETTLE) / path.spacing)
        self.soonest = self._landings()
        self._by_arm = [grips.of_arm(k) for k in range(len(walker.arms))]

    def _landings(self) -> Ints:
        """First samples at which hands land on grips."""
        out: Ints = np.maximum(self.grips.first + INSIDE, self.grips.bent_from(ELBOW) + self._touch)
        return out

    def _equip(self) -> None:
        """What the search asks about conflicts of grips, and about swings."""
        self.clearance = ArmClearance(self.walker, self.grips)
        self.swings = Swings(self.walker, self.structure, self.path, self.grips, self.clearance)

    def run(self, starts: Sequence[Sequence[int]], sample: int = 0, deadline: float | None = None) -> Found:
        """The fewest moves from one of some stances (one grip an arm each) at a sample; after the deadline, of
        ``time.perf_counter``, the best of what is known.
        """
        return drained(self.slices(starts, sample, deadline))

    def slices(self, starts: Sequence[Sequence[int]], sample: int = 0, deadline: float | None = None) -> Slices[Found]:
        """As :meth:`run`, in slices of :data:`NODES` stances looked at, or :data:`PAIRS` of grips or swings."""
        level: dict[Key, Node] = {tuple(int(g) for g in start): Node(sample, 0, None, None) for start in starts}
        if not self._levels or self._levels[0] != level:
            self._levels, self._asked = [level], []
        levels, end = [level], len(self.path) - 1
        while True:
            done = [(n.delay, self.order(k), k) for k, n in level.items() if self.until(k, n.sample) >= end]
            if done and not (self.first and len(levels) == 1):
                return self._result(levels, min(done)[2], True)
            if deadline is not None and time.perf_counter() > deadline:
                break
            if len(levels) == len(self._levels):
                following_level, asked = yield from self._next(level)
                self._levels.append(following_level)
                self._asked.append(asked)
            level = self._levels[len(levels)]
            if not level:
                break
            levels.append(level)
        return self._result(levels, None, False)

    def correct(self, move: Move, duration: float, possible: bool) -> None:
        """A move takes another time [s], or is not possible; what was searched without looking at it is kept."""
        self.swings.correct(move.arm, move.source, move.target, move.lift, move.way, duration, possible)
        for depth, asked in enumerate(self._asked):
            if (move.arm, move.source, move.target, move.lift) in asked:
                self._levels, self._asked = self._levels[: depth + 1], self._asked[:depth]

    def _next(self, level: dict[Key, Node]) -> Slices[tuple[dict[Key, Node], set[Asked]]]:
        """Stances with one more re-grasp, the promising ones first, until there are enough; and swings looked at."""
        whole, parts, asked = list(level.items()), list[Fan](), set[Asked]()
        for begin in range(0, len(whole), NODES):
            parts += self._moves(whole, range(begin, min(begin + NODES, len(whole))))
            yield None
        self.expanded += len(whole)
        order = following(Fan.joined(parts), whole, self._outlook, WAYS if self.width else None) if parts else iter(())
        kept: dict[Key, Node] = {}
        while part := list(islice(order, PARTS * self.width if self.width else None)):
            found = yield from self._prepare(level, part)
            for (key, nodes), swings in zip(part, found, strict=True):
                asked.update((s.arm, s.source, s.target, s.lift) for s in swings if s is not None)
                checked = [
                    b for one in zip(nodes, swings, strict=True) if (b := self._checked(level, *one)) is not None
                ]
                if checked:
                    kept[key] = min(checked, key=lambda n: (n.sample, n.delay))
            if self.width and len(kept) >= self.width:
                break
        return self._best(kept), asked

    def _best(self, kept: dict[Key, Node]) -> dict[Key, Node]:
        """The promising ones of checked stances: arms that get in each other's way end them."""
        if not kept:
            return {}
        keys = np.array(list(kept), dtype=np.int64)
        samples, delays = np.array([(node.sample, node.delay) for node in kept.values()], dtype=np.int64).T
        until = np.array([self.until(key, node.sample) for key, node in kept.items()])
        promise = self._outlook.promise(keys, samples, delays) + 2.0 * (self.grips.last[keys].min(axis=1) - until)
        whole = list(kept.items())
        return dict(whole[k] for k in self._outlook.order(keys, samples, promise).tolist()[: self.width])

    def _prepare(
        self, level: dict[Key, Node], part: Sequence[tuple[Key, list[Node]]]
    ) -> Slices[list[list[Swing | None]]]:
        """The swings that lead to some stances, and what their check needs, computed together."""
        pairs = [pair for key, _ in part for pair in combinations(key, 2)]
        for begin in range(0, len(pairs), PAIRS):
            self.clearance.prepare(pairs[begin : begin + PAIRS])
            yield None
        found = [[self._swing(level, key, node) for node in nodes] for key, nodes in part]
        yield from self.swings.slices(swing for swings in found for swing in swings if swing is not None)
        return found

    def _swing(self, level: dict[Key, Node], key: Key, node: Node) -> Swing | None:
        """The swing that leads to a stance; None where the arms are in each other's way when it lands."""
        move, parent = node.move, node.parent
        if move is None or parent is None:
            return None
        others = tuple(g for k, g in enumerate(key) if k != move.arm)
        room, soonest = self.rooms.among(others, level[parent].sample), int(self.soonest[move.target])
        free = self.rooms.clear_from(move.target, others, move.land)
        if free > move.land:
            # Only a hand that may wait long lands when the others are out of its way
            soonest = free + self._touch
            if self.longest_wait <= HOVER or soonest > min(room, int(self.latest[move.target])):
                return None
        return Swing(move.arm, move.source, move.target, move.lift, room, others, soonest)

    def _moves(self, level: Sequence[tuple[Key, Node]], rows: range) -> list[Fan]:
        """Moves that estimates allow from some stances of a level, arm by arm."""
        grips, spacing, some = self.grips, self.path.spacing, [level[k] for k in rows]
        keys, samples = np.array([key for key, _ in some]), np.array([node.sample for _, node in some])
        rooms, ends = (
            np.array(x) for x in zip(*(self.rooms.limits(key, node.sample) for key, node in some), strict=True)
        )
        out, first = [], self.first if level[0][1].parent is None else None
        for arm, targets in enumerate(self._by_arm):
            room, end, source = rooms[:, arm], ends[:, arm], keys[:, arm]
            useful = grips.last[targets] > grips.last[source][:, None]
            if first:
                useful = np.repeat(((grips.hold[targets] == first[1]) & (arm == first[0]))[None], len(some), axis=0)
            useful &= (grips.first[targets] < room[:, None]) & (samples <= np.minimum(room, end))[:, None]
            for other in np.delete(keys, arm, axis=1).T:
                useful &= grips.hold[targets] != grips.hold[other][:, None]
            row, column = np.nonzero(useful)
            if not len(row):
                continue
            source, target, sample, room = source[row], targets[column], samples[row], room[row]
            stop, soonest = np.minimum(end[row], room), self.soonest[target]
            about = np.minimum(np.maximum(sample, soonest - self._usual), stop)
            duration = self.swings.estimate(source, target, about, np.maximum(about + self._usual, soonest))
            count = np.ceil(duration / spacing).astype(np.int64)
            lift = np.minimum(np.maximum(sample, soonest - count), stop)
            land = np.maximum(lift + count, soonest)
            hovers, delay = (land - lift - count) * spacing, np.maximum(land - room, 0) * spacing
            land = np.minimum(land, room)
            fits = (land <= self.latest[target]) & (land >= soonest) & (delay <= self.longest_delay)
            fits &= (hovers <= self.longest_wait) & self._bent(target, land)
            fan = Fan(row + rows.start, np.full_like(row, arm), source, target, lift, land, duration, delay)
            out.append(fan.of(np.nonzero(fits)[0]))
        return out

    def _checked(self, level: dict[Key, Node], node: Node, swing: Swing | None) -> Node | None:
        """The node with its swing computed along its way, None where it is not possible."""
        move, parent = node.move, node.parent
        if move is None or parent is None:
            return node
        before = level[parent]
        chosen = None if swing is None else self.swings.choose(swing)
        if swing is None or chosen is None:
            return None
        duration, room, first, last = chosen.duration, swing.room, swing.soonest, int(self.latest[move.target])
        land = max(move.lift + int(np.ceil(duration / self.path.spacing)), first)
        late = max(land - room, 0) * self.path.spacing
        land = min(land, room)
        if late > self.longest_delay or not first <= land <= last or not self.bent_at(move.target, land):
            return None
        better = Move(move.arm, move.source, move.target, move.lift, land, duration, late, chosen.way)
        return Node(land, before.delay + round(late / QUANTUM), parent, better)

    def _bent(self, targets: Ints, samples: Ints) -> NDArray[np.bool_]:
        """Whether the wrist is bent enough to land: joint 4 turns the hand's axis only then."""
        out: NDArray[np.bool_] = np.abs(np.sin(self.grips.posture(targets, samples - self._touch)[..., 4])) >= BENT
        return out

    def bent_at(self, target: int, sample: int) -> bool:
        """The same of one."""
        return abs(sin(self.grips.posture_at(target, sample - self._touch).item(4))) >= BENT

    def until(self, key: Sequence[int], sample: int) -> int:
        """Last sample that a stance can hold, from a sample on."""
        return self.rooms.until(key, sample)

    def shortened(self, found: Found, count: int) -> Found:
        """What was found up to so many moves."""
        key = list(found.start)
        for move in found.moves[:count]:
            key[move.arm] = move.target
        last, end = self.until(key, found.moves[count - 1].land if count else 0), len(self.path) - 1
        stuck = tuple(g for g in key if self.grips.last[g] == last)
        return replace(found, moves=found.moves[:count], complete=last >= end, reached=min(last, end), blocking=stuck)

    def order(self, key: Sequence[int]) -> tuple[tuple[int, int], ...]:
        """What breaks ties: holds and branches, whichever arms they are of."""
        return tuple(sorted((int(self.grips.hold[g]), int(self.grips.branch[g])) for g in key))

    def _result(self, levels: list[dict[Key, Node]], key: Key | None, complete: bool) -> Found:
        depth = len(levels) - 1
        if key is None:
            reached = [
                (self.until(k, node.sample), -d, k) for d, level in enumerate(levels) for k, node in level.items()
            ]
            _, depth, key = max(reached)
            depth = -depth
        last = self.until(key, levels[depth][key].sample)
        blocking = tuple(g for g in key if self.grips.last[g] == last)
        start, moves = way_to(levels[: depth + 1], key)
        return Found(start, moves, complete, min(last, len(self.path) - 1), self.expanded, blocking)
