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
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain, combinations, islice
from typing import Generic, TypeVar

import numpy as np

from wbc.walking.body_path import BodyPath
from wbc.walking.planner.grips.table import Grips
from wbc.walking.planner.slices import Allowance, Slices, drained
from wbc.walking.planner.stances.candidates import QUANTUM, Candidate, Fan, Outlook, following
from wbc.walking.planner.stances.nodes import Conflicts, Found, Node, StanceEnds, SwingTable, moves_to
from wbc.walking.planner.swings.move import Key, Move, Swing

__all__ = ["Found", "Node", "StanceSearch"]

#: Hands land so many samples before a grip of another one ends; the body would slow down before it
SPARE = 2
#: Hands land so many samples before the end of a grip at least
INSIDE = 1
#: What a swing usually takes (the median over all grips, and not those of plans, is 2.4 s), and how
#: much more than enough time for swings is worth something [s]
USUAL, SLACK = 2.1, 0.5
#: Moves to one stance that are looked at, and stances that are checked together, in widths
MOVES, PARTS = 2, 2
#: Of more arms than FEW_ARMS so many widths of stances are put in order by their conflicts before they are checked
FEW_ARMS, AHEAD = 3, 12
#: Of these, searches end where so many re-grasps led no further; with six arms plans were found after at most two such
STUCK = 6
#: Stances, and pairs of grips, of one slice of the search
NODES, PAIRS = 16, 96
#: Arm, grips and sample of a swing that was looked at
SwingKey = tuple[int, int, int, int]
S = TypeVar("S", bound=SwingTable)


class StanceSearch(Generic[S]):
    """A search over the grips of one path; it knows grips, their conflicts and their swings, and no robot.

    Args:
        path, grips: of the body, and what can be held along it. conflicts: of the grips. swings: between them.
        hover: how long a hand may be in the air longer than it needs, until its next grip begins [s].
        patient: hands may wait in the air for any time, also for others to let them land.
        longest_delay: of one swing [s]; 0: the body never slows down.
        width: stances stored for each number of re-grasps, None: all.
        first: row of an arm and of a hold: the first move, whether it is needed or not; None: any.
        spare: samples before the end of a grip until which other hands land.
        allowance: slices of work; where they are spent the search ends with the best of what is known.
    """

    def __init__(
        self,
        path: BodyPath,
        grips: Grips,
        conflicts: Conflicts,
        swings: S,
        *,
        hover: float,
        patient: bool = False,
        longest_delay: float = np.inf,
        width: int | None = 200,
        first: tuple[int, int] | None = None,
        spare: int = SPARE,
        allowance: Allowance | None = None,
    ) -> None:
        self.path, self.grips, self.conflicts, self.swings = path, grips, conflicts, swings
        self._usual = round(USUAL / path.spacing)
        codes = grips.hold * (1 + grips.branch.max(initial=0)) + grips.branch
        self._outlook = Outlook(grips.last, codes, len(path) - 1, self._usual, SLACK / path.spacing, path.spacing)
        # Levels of the last search, and swings (arm, source, target, lift) that each but the first needed
        self._levels, self._asked = list[dict[Key, Node]](), list[set[SwingKey]]()
        self.patient, self._longest_wait = patient, np.inf if patient else hover
        self.longest_delay, self.width, self.first = longest_delay, width, first
        self.allowance = allowance
        self.expanded = 0
        # The end of the path is no limit of the arm
        lasting = grips.last == len(path) - 1
        self.latest = np.where(lasting, grips.last, grips.last - INSIDE)
        self.ends = StanceEnds(conflicts, grips.last, np.where(lasting, grips.last, grips.last - spare))
        self.soonest = swings.soonest()
        self._by_arm = [grips.of_arm(k) for k in range(int(grips.arm.max(initial=-1)) + 1)]

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
                if self.allowance is not None and self.allowance.spent:
                    break
                following_level, asked = yield from self._next(level)
                self._levels.append(following_level)
                self._asked.append(asked)
            level = self._levels[len(levels)]
            if not level or self._stuck(levels):
                break
            levels.append(level)
        return self._result(levels, None, False)

    def _stuck(self, levels: Sequence[dict[Key, Node]]) -> bool:
        """Whether so many re-grasps of many arms led to no stance that lasts longer."""
        if len(self._by_arm) <= FEW_ARMS or len(levels) <= STUCK:
            return False
        furthest = [max(self.until(k, n.sample) for k, n in level.items()) for level in levels[-1 - STUCK :]]
        return max(furthest[1:]) <= furthest[0]

    def correct(self, move: Move, duration: float, possible: bool) -> None:
        """A move takes another time [s], or is not possible; what was searched without it stays."""
        self.swings.correct(move, duration, possible)
        for depth, asked in enumerate(self._asked):
            if (move.arm, move.source, move.target, move.lift) in asked:
                self._levels, self._asked = self._levels[: depth + 1], self._asked[:depth]

    def _next(self, level: dict[Key, Node]) -> Slices[tuple[dict[Key, Node], set[SwingKey]]]:
        """Stances with one more re-grasp, the promising ones first, until there are enough; and swings looked at."""
        whole, parts, asked = list(level.items()), list[Fan](), set[SwingKey]()
        for begin in range(0, len(whole), NODES):
            parts += self._moves(whole, range(begin, min(begin + NODES, len(whole))))
            yield None
        self.expanded += len(whole)
        order = following(Fan.joined(parts), whole, self._outlook, MOVES if self.width else None) if parts else iter(())
        if self.width and len(self._by_arm) > FEW_ARMS:
            order = yield from self._reordered(order, AHEAD * self.width)
        kept: dict[Key, Node] = {}
        while some := list(islice(order, PARTS * self.width if self.width else None)):
            part = [(one.key, one.nodes()) for one in some]
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

    def _reordered(self, order: Iterator[Candidate], most: int) -> Slices[Iterator[Candidate]]:
        """The first stances of an order by their promise as conflicts end them, then the others."""
        some = list(islice(order, most))
        if not some:
            return order
        yield from self._compared([one.key for one in some])
        keys = np.array([one.key for one in some], dtype=np.int64)
        samples, delays = np.array([(one.sample, one.delay) for one in some], dtype=np.int64).T
        promise = self._outlook.promise(self.ends.by_arm(keys, samples), samples, delays)
        return chain((some[k] for k in self._outlook.order(keys, samples, promise).tolist()), order)

    def _compared(self, keys: Sequence[Key]) -> Slices[None]:
        """Look at all pairs of grips of some stances together, each once."""
        pairs = sorted({pair for key in keys for pair in combinations(key, 2)})
        for begin in range(0, len(pairs), PAIRS):
            self.conflicts.prepare(pairs[begin : begin + PAIRS])
            yield None

    def _best(self, kept: dict[Key, Node]) -> dict[Key, Node]:
        """The promising ones of checked stances: arms that conflict end them."""
        if not kept:
            return {}
        keys = np.array(list(kept), dtype=np.int64)
        samples, delays = np.array([(node.sample, node.delay) for node in kept.values()], dtype=np.int64).T
        if keys.shape[1] > FEW_ARMS:
            promise = self._outlook.promise(self.ends.by_arm(keys, samples), samples, delays)
        else:
            until = np.array([self.until(key, node.sample) for key, node in kept.items()])
            promise = self._outlook.promise(self.grips.last[keys], samples, delays)
            promise += 2.0 * (self.grips.last[keys].min(axis=1) - until)
        whole = list(kept.items())
        return dict(whole[k] for k in self._outlook.order(keys, samples, promise).tolist()[: self.width])

    def _prepare(
        self, level: dict[Key, Node], part: Sequence[tuple[Key, list[Node]]]
    ) -> Slices[list[list[Swing | None]]]:
        """The swings that lead to some stances, and what their check needs, computed together."""
        yield from self._compared([key for key, _ in part])
        found = [[self._swing(level, key, node) for node in nodes] for key, nodes in part]
        yield from self.swings.slices(swing for swings in found for swing in swings if swing is not None)
        return found

    def _swing(self, level: dict[Key, Node], key: Key, node: Node) -> Swing | None:
        """The swing that leads to a stance; None where the arms conflict when it lands."""
        move, parent = node.move, node.parent
        if move is None or parent is None:
            return None
        others = tuple(g for k, g in enumerate(key) if k != move.arm)
        until, soonest = self.ends.among(others, level[parent].sample), int(self.soonest[move.target])
        free = self.ends.clear_from(move.target, others, move.land)
        if free > move.land:
            # Only a hand that may wait long lands when the others let it
            soonest = free + self.swings.touch
            if not self.patient or soonest > min(until, int(self.latest[move.target])):
                return None
        return Swing(move.arm, move.source, move.target, move.lift, until, others, soonest)

    def _moves(self, level: Sequence[tuple[Key, Node]], rows: range) -> list[Fan]:
        """Moves that estimates allow from some stances of a level, arm by arm."""
        grips, spacing, some = self.grips, self.path.spacing, [level[k] for k in rows]
        keys, samples = np.array([key for key, _ in some]), np.array([node.sample for _, node in some])
        latest, ends = (
            np.array(x) for x in zip(*(self.ends.limits(key, node.sample) for key, node in some), strict=True)
        )
        out, first = [], self.first if level[0][1].parent is None else None
        for arm, targets in enumerate(self._by_arm):
            until, end, source = latest[:, arm], ends[:, arm], keys[:, arm]
            # Of many arms one may have to make way for another long before its own grip ends
            useful = grips.last[targets] > (end if len(self._by_arm) > FEW_ARMS else grips.last[source])[:, None]
            if first:
                useful = np.repeat(((grips.hold[targets] == first[1]) & (arm == first[0]))[None], len(some), axis=0)
            useful &= (grips.first[targets] < until[:, None]) & (samples <= np.minimum(until, end))[:, None]
            for other in np.delete(keys, arm, axis=1).T:
                useful &= grips.hold[targets] != grips.hold[other][:, None]
            row, column = np.nonzero(useful)
            if not len(row):
                continue
            source, target, sample, until = source[row], targets[column], samples[row], until[row]
            stop, soonest = np.minimum(end[row], until), self.soonest[target]
            about = np.minimum(np.maximum(sample, soonest - self._usual), stop)
            duration = self.swings.estimate(source, target, about, np.maximum(about + self._usual, soonest))
            count = np.ceil(duration / spacing).astype(np.int64)
            lift = np.minimum(np.maximum(sample, soonest - count), stop)
            land = np.maximum(lift + count, soonest)
            hovers, delay = (land - lift - count) * spacing, np.maximum(land - until, 0) * spacing
            land = np.minimum(land, until)
            fits = (land <= self.latest[target]) & (land >= soonest) & (delay <= self.longest_delay)
            fits &= (hovers <= self._longest_wait) & self.swings.lands(target, land)
            fan = Fan(row + rows.start, np.full_like(row, arm), source, target, lift, land, duration, delay)
            out.append(fan.of(np.nonzero(fits)[0]))
        return out

    def _checked(self, level: dict[Key, Node], node: Node, swing: Swing | None) -> Node | None:
        """The node with its swing computed, None where it is not possible."""
        move, parent = node.move, node.parent
        if move is None or parent is None:
            return node
        before = level[parent]
        chosen = None if swing is None else self.swings.choose(swing)
        if swing is None or chosen is None:
            return None
        duration, until, first, last = chosen.duration, swing.until, swing.soonest, int(self.latest[move.target])
        land = max(move.lift + int(np.ceil(duration / self.path.spacing)), first)
        late = max(land - until, 0) * self.path.spacing
        land = min(land, until)
        if late > self.longest_delay or not first <= land <= last or not self.lands_at(move.target, land):
            return None
        better = Move(move.arm, move.source, move.target, move.lift, land, duration, late, chosen.curve)
        return Node(land, before.delay + round(late / QUANTUM), parent, better)

    def lands_at(self, target: int, sample: int) -> bool:
        """Whether a hand can land on one grip at one sample."""
        return bool(self.swings.lands(np.array([target]), np.array([sample]))[0])

    def until(self, key: Sequence[int], sample: int) -> int:
        """Last sample that a stance can hold, from a sample on."""
        return self.ends.until(key, sample)

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
        start, moves = moves_to(levels[: depth + 1], key)
        return Found(start, moves, complete, min(last, len(self.path) - 1), self.expanded, blocking)
