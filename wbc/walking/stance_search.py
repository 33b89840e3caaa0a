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
from itertools import combinations
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from wbc.robots import Walker
from wbc.walking.arm_clearance import ArmClearance
from wbc.walking.body_path import BodyPath
from wbc.walking.grips import Grips, Ints
from wbc.walking.slices import Slices, drained
from wbc.walking.stance_moves import Found, Key, Move, Node, Worth
from wbc.walking.structure import Structure
from wbc.walking.swings import SETTLE, Swing, Swings

__all__ = ["Found", "Key", "Move", "Node", "StanceSearch"]

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
NODES, PAIRS = 3, 24
#: Delays are counted in steps of this [s], so that rounding decides nothing
QUANTUM = 1e-6


class StanceSearch:
    """A search over the grips of one path.

    Args:
        longest_delay: of one swing [s]; 0: the body never slows down.
        width: stances kept of each number of re-grasps, None: all.
        first: row of an arm and of a hold: the first move, whether it is needed or not; None: any.
        known: a search over the same grips, whose swings and distances need not be computed again.
    """

    #: Hands land so many samples before a grip of another one ends
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
        width: int | None = 200,
        first: tuple[int, int] | None = None,
        known: StanceSearch | None = None,
    ) -> None:
        self.walker, self.structure, self.path, self.grips = walker, structure, path, grips
        if known is None:
            self._equip()
        else:
            self.clearance, self.swings = known.clearance, known.swings
        self._usual, self._slack = round(USUAL / path.spacing), SLACK / path.spacing
        self.longest_delay, self.width, self.first = longest_delay, width, first
        self.expanded = 0
        # The end of the path is no limit of the arm
        lasting = grips.last == len(path) - 1
        self._latest = np.where(lasting, grips.last, grips.last - INSIDE)
        self._ends = np.where(lasting, grips.last, grips.last - self.spare)
        # The hand is on its hold before it is latched
        self._touch = round((walker.tolerances.latch_time + SETTLE) / path.spacing)
        self._soonest = self._landings()
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
        """The fewest moves from one of some stances (one grip an arm each) at a sample.

        Args:
            deadline: of ``time.perf_counter``; after it the best of what is known is returned.
        """
        return drained(self.slices(starts, sample, deadline))

    def slices(self, starts: Sequence[Sequence[int]], sample: int = 0, deadline: float | None = None) -> Slices[Found]:
        """As :meth:`run`, in slices of :data:`NODES` stances looked at, or :data:`PAIRS` of grips or swings."""
        level: dict[Key, Node] = {tuple(int(g) for g in start): Node(sample, 0, None, None) for start in starts}
        levels = [level]
        while True:
            done = [
                (node.delay, self.order(key), key)
                for key, node in level.items()
                if self.until(key, node.sample) >= len(self.path) - 1
            ]
            if done and not (self.first and len(levels) == 1):
                return self._result(levels, min(done)[2], True)
            if deadline is not None and time.perf_counter() > deadline:
                break
            level = yield from self._next(level)
            if not level:
                break
            levels.append(level)
        return self._result(levels, None, False)

    def _next(self, level: dict[Key, Node]) -> Slices[dict[Key, Node]]:
        """Stances with one more re-grasp; the promising ones first, until there are enough."""
        candidates: dict[Key, list[Node]] = {}
        for key, node in level.items():
            if self.expanded % NODES == 0:
                yield None
            self.expanded += 1
            for target, move in self._moves(key, node):
                child = tuple(target if k == move.arm else g for k, g in enumerate(key))
                delay = node.delay + round(move.delay / QUANTUM)
                candidates.setdefault(child, []).append(Node(move.land, delay, key, move))
        most = WAYS if self.width else None
        ranked = {key: sorted(nodes, key=lambda n: (n.sample, n.delay))[:most] for key, nodes in candidates.items()}
        order = sorted(ranked.items(), key=lambda item: self._promise(item[0], item[1][0]))
        kept: dict[Key, Node] = {}
        size = PARTS * self.width if self.width else max(len(order), 1)
        for begin in range(0, len(order), size):
            part = order[begin : begin + size]
            yield from self._prepare(level, part)
            for key, nodes in part:
                checked = [better for node in nodes if (better := self._checked(level, key, node)) is not None]
                if checked:
                    kept[key] = min(checked, key=lambda n: (n.sample, n.delay))
            if self.width and len(kept) >= self.width:
                break
        best = sorted(kept.items(), key=lambda item: self._worth(*item))
        return dict(best[: self.width])

    def _prepare(self, level: dict[Key, Node], part: Sequence[tuple[Key, list[Node]]]) -> Slices[None]:
        """What the check of some stances needs, computed together."""
        pairs = [pair for key, _ in part for pair in combinations(key, 2)]
        for begin in range(0, len(pairs), PAIRS):
            self.clearance.prepare(pairs[begin : begin + PAIRS])
            yield None
        found = [self._swing(level, key, node) for key, nodes in part for node in nodes]
        swings = [swing for swing in found if swing is not None]
        yield from self.swings.slices(swings)

    def _swing(self, level: dict[Key, Node], key: Key, node: Node) -> Swing | None:
        """The swing that leads to a stance; None where the arms are in each other's way when it lands."""
        move, parent = node.move, node.parent
        if move is None or parent is None:
            return None
        others = tuple(g for k, g in enumerate(key) if k != move.arm)
        if min(self._conflict(move.target, g, move.land) for g in others) <= move.land:
            return None
        return Swing(move.arm, move.source, move.target, move.lift, self._room(others, level[parent].sample), others)

    def _moves(self, key: Key, node: Node) -> Iterator[tuple[int, Move]]:
        """Moves that estimates allow: (target, move)."""
        grips, spacing = self.grips, self.path.spacing
        for arm, source in enumerate(key):
            others = [g for k, g in enumerate(key) if k != arm]
            room = self._room(others, node.sample)
            end = min(int(grips.last[source]), min(self._conflict(source, g, node.sample) for g in others) - 1)
            targets = self._by_arm[arm]
            useful = grips.last[targets] > grips.last[source]
            if self.first and node.parent is None:
                useful = (grips.hold[targets] == self.first[1]) & (arm == self.first[0])
            targets = targets[useful & (grips.first[targets] < room)]
            for g in others:
                targets = targets[grips.hold[targets] != grips.hold[g]]
            if not len(targets) or node.sample > min(room, end):
                continue
            soonest = self._soonest[targets]
            about = np.minimum(np.maximum(node.sample, soonest - self._usual), min(end, room))
            duration = self.swings.estimate(source, targets, about, np.maximum(about + self._usual, soonest))
            count = np.ceil(duration / spacing).astype(np.int64)
            lift = np.minimum(np.maximum(node.sample, soonest - count), min(end, room))
            land = np.maximum(lift + count, soonest)
            hovers = land - lift - count
            late = np.maximum(land - room, 0)
            land = np.minimum(land, room)
            delay = late * spacing
            fits = (land <= self._latest[targets]) & (land >= soonest) & (delay <= self.longest_delay)
            fits &= (hovers * spacing <= HOVER) & self._bent(targets, land)
            for target, begin, finish, need, lost in zip(
                targets[fits].tolist(),
                lift[fits].tolist(),
                land[fits].tolist(),
                duration[fits].tolist(),
                delay[fits].tolist(),
                strict=True,
            ):
                yield target, Move(arm, source, target, begin, finish, need, lost)

    def _checked(self, level: dict[Key, Node], key: Key, node: Node) -> Node | None:
        """The node with its swing computed along its way, None where it is not possible."""
        move, parent = node.move, node.parent
        if move is None or parent is None:
            return node
        before, swing = level[parent], self._swing(level, key, node)
        chosen = None if swing is None else self.swings.choose(swing)
        if swing is None or chosen is None:
            return None
        duration, room = chosen.duration, swing.room
        first, last = int(self._soonest[move.target]), int(self._latest[move.target])
        land = max(move.lift + int(np.ceil(duration / self.path.spacing)), first)
        late = max(land - room, 0) * self.path.spacing
        land = min(land, room)
        if late > self.longest_delay or not first <= land <= last:
            return None
        if not self._bent(np.array([move.target]), np.array([land]))[0]:
            return None
        better = Move(move.arm, move.source, move.target, move.lift, land, duration, late, chosen.way)
        return Node(land, before.delay + round(late / QUANTUM), parent, better)

    def _bent(self, targets: Ints, samples: Ints) -> NDArray[np.bool_]:
        """Whether the wrist is bent enough to land: joint 4 turns the hand's axis only then."""
        out: NDArray[np.bool_] = np.abs(np.sin(self.grips.posture(targets, samples - self._touch)[..., 4])) >= BENT
        return out

    def _room(self, others: Sequence[int], sample: int) -> int:
        """Last sample that the grips of some arms can hold together, less what is spared."""
        end = min(int(self._ends[g]) for g in others)
        pairs = [self._conflict(a, b, sample) - 1 for a, b in combinations(others, 2)]
        return min([end, *pairs])

    def until(self, key: Sequence[int], sample: int) -> int:
        """Last sample that a stance can hold, from a sample on."""
        pairs = [self._conflict(a, b, sample) - 1 for a, b in combinations(key, 2)]
        return min([int(self.grips.last[g]) for g in key] + pairs)

    def shortened(self, found: Found, count: int) -> Found:
        """What was found up to so many moves."""
        key = list(found.start)
        for move in found.moves[:count]:
            key[move.arm] = move.target
        last, end = self.until(key, found.moves[count - 1].land if count else 0), len(self.path) - 1
        stuck = tuple(g for g in key if self.grips.last[g] == last)
        return replace(found, moves=found.moves[:count], complete=last >= end, reached=min(last, end), blocking=stuck)

    def _conflict(self, one: int, other: int, sample: int) -> int:
        return self.clearance.first_conflict(one, other, sample)

    def order(self, key: Sequence[int]) -> tuple[tuple[int, int], ...]:
        """What breaks ties: holds and branches, whichever arms they are of."""
        return tuple(sorted((int(self.grips.hold[g]), int(self.grips.branch[g])) for g in key))

    def _promise(self, key: Key, node: Node) -> Worth:
        """Long grips, and time for the swings that must follow, first.

        With the ends e_1 <= e_2 <= ... of its grips a stance that begins at j has the slack
        min_k (e_k - j - (k - 1) n), as hands swing one after the other for n samples. What is more than :data:`SLACK`
        is worth nothing.
        """
        finish, usual = len(self.path) - 1, self._usual
        ends = sorted(int(self.grips.last[g]) for g in key)
        # A grip that lasts to the end of the path needs no other
        ends = [end if end < finish else finish + usual for end in ends]
        slack = min(end - node.sample - k * usual for k, end in enumerate(ends))
        worth = sum(ends) / len(ends) + min(slack, self._slack)
        return -worth + node.delay * QUANTUM / self.path.spacing, node.sample, self.order(key), key

    def _worth(self, key: Key, node: Node) -> Worth:
        """As the promise, of a checked stance: arms that get in each other's way end it."""
        until = self.until(key, node.sample)
        promise, sample, order, _ = self._promise(key, node)
        return promise + 2.0 * (min(int(self.grips.last[g]) for g in key) - until), sample, order, key

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
        moves: list[Move] = []
        for level in levels[depth:0:-1]:
            node = level[key]
            if node.move is None or node.parent is None:
                break
            moves.append(node.move)
            key = node.parent
        return Found(key, tuple(reversed(moves)), complete, min(last, len(self.path) - 1), self.expanded, blocking)
