"""Free gait by search: which limb goes to which foothold next, with the body's pose found for every stance.

A node is a stance: contacts, and a posture in which they hold. From it every limb may go to every foothold that the
robot could have at once with its other contacts; a move is looked at when it is the most promising one left, by

    steps so far + WEIGHT (sum over limbs of D(foothold) / stride) + DEAR stretch

with D the length of the shortest way over footholds from there to the goal, and the stretch the sum of squared
distances of contacts from where they are at rest relative to the body. Nothing is left out for good: where no plan is
found and no limit was hit, every stance that moves of the kinds here come to was seen.
"""

from __future__ import annotations

import heapq
import itertools
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbc import validation
from wbc.climb.balance import Equilibrium
from wbc.climb.clear import TOLERANCE
from wbc.climb.climber import Climber
from wbc.climb.foothold_graph import ways_over_footholds
from wbc.climb.goal import BodyPlace, Goal, LimbAt, Route
from wbc.climb.reach import LIMIT_MARGIN
from wbc.climb.scene import ClimbScene
from wbc.climb.separation import Separation
from wbc.climb.stance import FREE_LIMB, Stance, StancePath
from wbc.climb.watch import PlanWatch
from wbc.climb.world import SPARE, ClimbWorld, PostureOutcome
from wbc.errors import RangeError, ShapeError, WbcError
from wbc.multibody import pin
from wbc.symbolic.joint_steps import place
from wbc.validation import Array

#: Of margins: what two linear programs differ by [weights]
ROUNDING = 1e-6
#: Of a limb's length: how far a step goes, as the search guesses
STRIDE = 0.5
#: Of a limb's length: how far from where it is at rest a contact is as good
COMFORTABLE = 0.25
#: How much dearer the way that is left is than the steps so far
WEIGHT = 2.5
#: Squared distance of a foothold from where a limb is at rest from which on it is tried last [squared lengths of limb]
NEAR = 1.0
#: What a stretch of 1 costs [steps]
DEAR = 6.0
#: Other beginnings from which postures of refused moves are sought
ATTEMPTS = 3
#: What each of them costs more [steps]
AGAIN = 16.0
#: What a move costs more whose like could not be made, once [steps]
LATE = 5.0
#: Of the robot's length, and of directions: moves that differ by less are alike [1]
ALIKE = 0.05
#: What a limb in the air costs [steps]
IN_THE_AIR = 2.0
#: How far a limb may be from its foothold at the start [m]
AT_START = 1e-4
#: Weight by which the body is drawn to the goal: beside those of contacts a hundredth, of rest ten thousand times
DRAWN = 1e2


#: Moves from a stance, with what they promise to cost
_Moves = Iterator[tuple[float, NDArray[np.int32]]]
#: Moves of a limb: to a foothold, () before it, or all those from a stance with contacts, -1 after it
LateMove = tuple[tuple[int, ...], int, int]


class NoStancesError(WbcError):
    """No way over stances was found; ``value`` and the text say why in numbers.

    Attributes:
        cause: ``"start"``: the first stance is none; ``"goal"``: no stance can be at the goal; ``"reach"``: every
            stance that can be reached was seen; ``"limit"``: a limit of moves or time ended the search.
        nearest: distance from the goal of the nearest stance [m].
    """

    cause: str = ""
    nearest: float = np.inf


#: What became of postures, in words
_WORDS = {
    PostureOutcome.NOT_REACHED: "out of reach",
    PostureOutcome.NOT_BORNE: "not borne",
    PostureOutcome.TOUCHES: "links touch",
    PostureOutcome.BREAKS: "a limb that holds comes to its limits on the way",
}


def counted(outcomes: Mapping[PostureOutcome, int]) -> str:
    """How many postures became what, where they do not stand."""
    return ", ".join(f"{outcomes[how]} {text}" for how, text in _WORDS.items() if outcomes.get(how))


def counted_words(outcomes: Mapping[str, int]) -> str:
    """How many of what was looked at became what, the most frequent first."""
    return ", ".join(f"{outcomes[how]} {how}" for how in sorted(outcomes, key=lambda how: -outcomes[how]))


def no_stances(field: str, value: Any, reason: str, cause: str, nearest: float = np.inf) -> NoStancesError:
    """The error with its attributes."""
    error = NoStancesError(field, value, reason)
    error.cause, error.nearest = cause, nearest
    return error


@dataclass(frozen=True)
class StanceOptions:
    """How stances are sought.

    Attributes:
        margin: least slack of equilibrium of the limbs that stay, in shares of the weight, at both ends of a move.
        limits: distance from limits of joints [m, rad].
        clearance: distance of links from bodies [m]. apart: of links from each other [m].
        moves: how many moves are looked at, at most.
        gait: sets of limbs, by name, that go at once where that can be.
        forbidden: moves (contacts before, contacts after) that may not be, as rows of footholds.
        effort: share of the joints' efforts within which torques at rest stay [1]; inf: efforts do not count.
        friction: share of the coefficients of friction that counts, and its square of soles [1].
    """

    margin: float = 0.02
    limits: float = LIMIT_MARGIN
    clearance: float = 0.01
    apart: float = 0.0
    moves: int = 20000
    gait: tuple[tuple[str, ...], ...] = ()
    forbidden: frozenset[tuple[tuple[int, ...], tuple[int, ...]]] = frozenset()
    effort: float = np.inf
    friction: float = 1.0

    def __post_init__(self) -> None:
        for name in ("margin", "limits", "clearance", "apart"):
            validation.scalar(f"StanceOptions.{name}", getattr(self, name), low=0.0)
        validation.scalar("StanceOptions.friction", self.friction, low=0.0, high=1.0, open_low=True)
        if not self.effort > 0.0:
            raise RangeError("StanceOptions.effort", self.effort, "expected a share above 0")
        validation.integer("StanceOptions.moves", self.moves, 1)


@dataclass(frozen=True, eq=False)
class _Node:
    """A stance that was found, and the move that led to it; lifts that were looked at, by the contacts that stay, with
    the attempt; and limbs that cannot be lifted, as far as was looked.
    """

    contacts: NDArray[np.int32]
    state: Array
    steps: int
    slack: float
    before: _Node | None = None
    cost: float = 0.0
    lift: Array | None = None
    lifts: dict[bytes, tuple[tuple[PostureOutcome, Array, float, bool], int]] = field(default_factory=dict)
    stuck: set[int] = field(default_factory=set)


def find_stances(
    climber: Climber, scene: ClimbScene, start: Stance, goal: Goal, options: StanceOptions | None = None
) -> StancePath:
    """Stances from the start to the goal, each of which differs from the one before by the place of the body, or by
    the contacts of some limbs too. In both stances of a move the limbs that keep their foothold bear the robot with the
    margin asked for; every stance keeps joint limits and clearances, and limbs that hold reach along the body's
    straight way from one to the next.

    Raises:
        NoStancesError: there is no such way, or none was found within the limits; why, in numbers. ShapeError,
            RangeError, UnknownNameError: start, goal or options that do not fit climber and scene.
    """
    return StanceWay(climber, scene, start, goal, options).found()


class StanceWay:
    """The way over stances that :func:`find_stances` gives, which is found again without moves that cannot be made.

    What was seen on the way to other stances is kept for that.

    Args:
        watch: the clock of the plan that it is for; None: there is none.

    Raises:
        as :func:`find_stances`.
    """

    def __init__(
        self, climber: Climber, scene: ClimbScene, start: Stance, goal: Goal, options: StanceOptions | None = None,
        watch: PlanWatch | None = None,
    ) -> None:  # fmt: skip
        self._options = validation.instance("options", options or StanceOptions(), StanceOptions, "options")
        self._climber, self._scene, self._start = climber, scene, start
        self._watch = watch or PlanWatch()
        self._places: Sequence[Any] = goal.places if isinstance(goal, Route) else [goal]
        self._searches: list[StanceSearch] = []
        self._legs: list[StancePath] = []

    def found(self) -> StancePath:
        """The way.

        Raises:
            NoStancesError: there is none, or none was found within the limits.
        """
        while len(self._legs) < len(self._places):
            leg = len(self._legs)
            if leg == len(self._searches):
                start = self._legs[-1].stances[-1] if self._legs else self._start
                target = self._places[leg]
                self._searches.append(StanceSearch(self._climber, self._scene, start, target, self._options))
            self._legs.append(self._searches[leg].run(self._watch))
        stances = [self._start, *itertools.chain.from_iterable(leg.stances[1:] for leg in self._legs)]
        least = min(float(leg.margins[0]) for leg in self._legs)
        margins = [least, *itertools.chain.from_iterable(leg.margins[1:] for leg in self._legs)]
        if len(stances) == 1:
            stances, margins = stances * 2, margins * 2
        return StancePath(tuple(stances), np.array(margins))

    def forbid(self, row: int, late: Iterable[LateMove] = ()) -> None:
        """The move from a stance of the way to the next one cannot be made; the way is another one from there on.

        Args:
            late: moves that are dearer than they look, from now on.
        """
        leg = 0
        while row >= len(self._legs[leg].stances) - 1:
            row -= len(self._legs[leg].stances) - 1
            leg += 1
        before, after = (tuple(stance.contacts) for stance in self._legs[leg].stances[row : row + 2])
        del self._legs[leg:], self._searches[leg + 1 :]
        forbidden = self._options.forbidden | {(before, after)}
        self._options = replace(self._options, forbidden=forbidden)
        self._searches[leg].forbid(before, after, late)


class StanceSearch:
    """One search.

    Attributes:
        seen: how many stances there are so far. tried: how many moves were looked at, by outcome.
    """

    def __init__(
        self, climber: Climber, scene: ClimbScene, start: Stance, goal: BodyPlace | LimbAt, options: StanceOptions
    ) -> None:
        if len(start.contacts) != len(climber.limbs):
            raise ShapeError("start.contacts", start.contacts, f"expected {len(climber.limbs)}, one for each limb")
        for row in start.contacts:
            if not FREE_LIMB <= row < len(scene.footholds):
                raise RangeError("start.contacts", row, f"expected rows from 0 to {len(scene.footholds) - 1}, or -1")
        self.climber, self.scene, self.options, self.goal = climber, scene, options, goal
        kept = options.limits, options.clearance, options.apart
        self.world = ClimbWorld(climber, scene, start, *kept, friction=options.friction)
        q = climber.robot.configuration("start.q", start.q)
        self.given = start
        self.first = _Node(self.world.contacts(self.world.start), self.world.state_of(q), 0, np.inf)
        self.tried: Counter[PostureOutcome] = Counter()
        self.seen = 0
        self._known: dict[bytes, _Node] = {}
        self._nearest = self.first
        self._count = itertools.count()
        #: (cost, number, stance, moves from it that are dearer, contacts after the move, attempt)
        self._queue = list[tuple[float, int, _Node, _Moves, NDArray[np.int32], int]]()
        self._late: set[LateMove] = set()
        #: By how much moves were put off [steps]
        self._delays = dict[tuple[int, bytes], float]()
        #: How often the like of a move was out of reach, or not borne, since one was neither
        self._misses = Counter[tuple[Any, ...]]()
        #: Limbs that could not be lifted from the like of a stance
        self._stuck = dict[tuple[Any, ...], set[int]]()
        self._known_apart: dict[tuple[int, int], bytes] = {}
        #: Of each place where it is, in lengths of the robot, its axes, and which way is down
        axes, down = self.world.places[:, :9].reshape(-1, 3, 3), np.asarray(self.world.numbers.down)
        at = self.world.places[:, 9:, None] / self.world.length
        self._columns = np.concatenate([at, axes, np.broadcast_to(down[:, None], at.shape)], axis=2)
        #: Stances that are come to by a forbidden move, and other moves to known stances
        self._removed: dict[int, _Node] = {}
        self._other: defaultdict[bytes, list[tuple[float, _Node, NDArray[np.int32]]]] = defaultdict(list)
        self._names = [limb.name for limb in climber.limbs]
        #: Contacts are this far from the body's origin at rest [m]
        self._spread = float(np.linalg.norm(self.world.touch[:, 9:], axis=1).max())
        self._far, self._goal_body, self._limb = self._distances()
        self._sets = [tuple(climber.row(name) for name in names) for names in options.gait]
        counted = options.effort < np.inf and np.any(scene.gravity)
        self._balance = Equilibrium(climber, scene, options.friction) if counted else None
        self._separation = Separation(self.world, self.goal)

    def run(self, watch: PlanWatch) -> StancePath:
        """The way found, see :func:`find_stances`; called again, one without the moves that were forbidden since."""
        if not self._known:
            first = self.first = self._nearest = self._checked_start()
            self._known[first.contacts.tobytes()] = first
            if path := self._at_goal(first):
                return path
            self.seen = 1
            if self._separation.cannot_be():
                raise self._refusal("goal")
            if gap := self._separation.gap(first.contacts):
                raise no_stances("goal", self._told_goal(), gap, "goal", self._distance(first))
            self._push(first, self._moves(first))
        most = self.options.moves + sum(self.tried.values())
        while self._queue:
            cost, _, node, moves, after, attempt = heapq.heappop(self._queue)
            if id(node) in self._removed:
                continue
            self._push(node, moves)
            watch.look(self._so_far)
            tried = sum(self.tried.values())
            if tried >= most or watch.passed:
                raise self._refusal("limit")
            if self._forbidden(node.contacts, after):
                continue
            if attempt == 0 and (delay := self._put_off(node, after)):
                self._push(node, iter([(cost + delay, after)]))
                continue
            if after.tobytes() in self._known:
                self._other[after.tobytes()].append((cost, node, after))
                continue
            stuck = len(node.stuck)
            found = self._moved(node, after, attempt, cost)
            if len(node.stuck) < stuck:
                self._push(node, self._moves(node))
            if found is None:
                if attempt < ATTEMPTS:
                    self._push(node, iter([(cost + AGAIN, after)]), attempt + 1)
                continue
            self._known[after.tobytes()] = found
            self.seen = len(self._known)
            if self._distance(found) < self._distance(self._nearest):
                self._nearest = found
            if path := self._at_goal(found):
                return path
            self._push(found, self._moves(found))
        raise self._refusal("reach")

    def _push(self, node: _Node, moves: _Moves, attempt: int = 0) -> None:
        """The next of the moves from a stance."""
        for cost, after in moves:
            heapq.heappush(self._queue, (cost, next(self._count), node, moves, after, attempt))
            return

    def forbid(self, before: Sequence[int], after: Sequence[int], late: Iterable[LateMove] = ()) -> None:
        """A move may not be, as rows of footholds: stances that were come to by it are sought by others.

        Args:
            late: moves that are dearer than they look, from now on.
        """
        self.options = replace(self.options, forbidden=self.options.forbidden | {(tuple(before), tuple(after))})
        self._late.update(late)
        lost = list[bytes]()
        for key, node in self._known.items():
            if node.before is None:
                continue
            delay = self._put_off(node.before, node.contacts) if self._is_late(node.before, node.contacts) else 0.0
            if delay or id(node.before) in self._removed or self._forbidden(node.before.contacts, node.contacts):
                self._removed[id(node)] = node
                lost.append(key)
                if delay:
                    self._push(node.before, iter([(node.cost + delay, node.contacts)]))
        for key in lost:
            del self._known[key]
        for key in lost:
            for cost, node, contacts in self._other.pop(key, ()):
                self._push(node, iter([(cost, contacts)]))

    def _is_late(self, node: _Node, after: NDArray[np.int32]) -> bool:
        """Whether a move is dearer than it looks."""
        if not self._late:
            return False
        before, there = self._rows(node.contacts), self._rows(after)
        moved = np.flatnonzero(node.contacts != after).tolist()
        return not self._late.isdisjoint(move for k in moved for move in (((), k, there[k]), (before, k, FREE_LIMB)))

    def _put_off(self, node: _Node, after: NDArray[np.int32]) -> float:
        """What a move costs beyond what it was put off by so far: as one that is late, for each time that its like was
        out of reach or not borne since one was neither, and where nothing could be lifted from its like [steps].
        """
        key = id(node), after.tobytes()
        misses = self._misses.get(self._alike(node.contacts, after), 0)
        due = LATE * (self._is_late(node, after) + misses + self._leads_nowhere(node, after))
        more = due - self._delays.get(key, 0.0)
        if more <= 0.0:
            return 0.0
        self._delays[key] = due
        return more

    def _leads_nowhere(self, node: _Node, after: NDArray[np.int32]) -> bool:
        """Whether no limb that stays could be lifted next from a stance like that after a move."""
        stuck = self._stuck.get(self._alike(after, after))
        return stuck is not None and stuck.issuperset(np.flatnonzero((node.contacts == after) & (after >= 0)).tolist())

    def _alike(self, contacts: NDArray[np.int32], after: NDArray[np.int32]) -> tuple[Any, ...]:
        """What moves are told apart by in how far limbs reach: which limbs move, and where they and those that stay are
        from the first that stays.
        """
        rows = list(zip(contacts.tolist(), after.tolist(), strict=True))
        first = next((at for was, at in rows if was == at >= 0), FREE_LIMB)
        return tuple((was == at, self._apart(first, at)) for was, at in rows)

    def _apart(self, first: int, other: int) -> bytes:
        """How one place is from another, in its axes and in steps of ``ALIKE``, with which way is down there."""
        if min(first, other) < 0:
            return b""
        if (first, other) not in self._known_apart:
            columns = self._columns[other].copy()
            columns[:, 0] -= self._columns[first, :, 0]
            numbers = self._columns[first, :, 1:4].T @ columns / ALIKE
            self._known_apart[first, other] = numbers.round().astype(np.int16).tobytes()
        return self._known_apart[first, other]

    def _moved(self, node: _Node, after: NDArray[np.int32], attempt: int, cost: float) -> _Node | None:
        """The stance after a move, if there is one."""
        kept = np.where(node.contacts == after, after, FREE_LIMB).astype(np.int32)
        key, margin = kept.tobytes(), self.options.margin
        known = node.lifts.get(key)
        if known is None or (known[1] < attempt and known[0][0] != PostureOutcome.STANDS):
            # What lifts next depends on it: other beginnings cost less than other stances
            for beginning in range(attempt, max(attempt + 1, ATTEMPTS)):
                lifted = self.world.lift(node.contacts, kept, margin, node.state, beginning)
                if lifted[0] == PostureOutcome.STANDS and self._driven(kept, lifted[1]):
                    break
                if lifted[0] == PostureOutcome.STANDS:
                    lifted = PostureOutcome.NOT_BORNE, *lifted[1:]
            node.lifts[key] = lifted, beginning
            self.tried[lifted[0]] += lifted[0] != PostureOutcome.STANDS
        how, lift, before, moves = node.lifts[key][0]
        if how != PostureOutcome.STANDS:
            moved = np.flatnonzero(node.contacts != after)
            node.stuck.update(moved.tolist() if len(moved) == 1 else [])
            self._stuck.setdefault(self._alike(node.contacts, node.contacts), set()).update(node.stuck)
            return None
        node.stuck.difference_update(np.flatnonzero(node.contacts != after).tolist())
        how, land, slack = self.world.land(after, kept, margin, lift, attempt)
        if how == PostureOutcome.STANDS and not self._driven(kept, land):
            how = PostureOutcome.NOT_BORNE
        self.tried[how] += 1
        if attempt == 0:
            like = self._alike(node.contacts, after)
            missed = how in (PostureOutcome.NOT_REACHED, PostureOutcome.NOT_BORNE)
            self._misses[like] = self._misses[like] + 1 if missed else 0
        if how != PostureOutcome.STANDS:
            return None
        return _Node(after, land, node.steps + 1, min(before, slack), node, cost, lift if moves else None)

    def _driven(self, kept: NDArray[np.int32], state: Array) -> bool:
        """Whether motors hold a posture on contacts, with the margin asked for."""
        if self._balance is None:
            return True
        q, least = self.world.q_of(state), self.options.margin - ROUNDING
        return self._balance.margin(self._rows(kept), q, motors=True, effort=self.options.effort) >= least

    def _moves(self, node: _Node) -> _Moves:
        """Moves from a stance, with what they promise to cost, the least first; far ones come last."""
        held = {limb: float(self._far[limb, at]) for limb, at in enumerate(node.contacts.tolist()) if at >= 0}
        aloft = sum(held.values()) / max(len(held), 1) + IN_THE_AIR
        each = np.array([held.get(limb, aloft) for limb in range(len(self._names))])
        done, total = node.steps + 1.0, float(each.sum())
        out, stretch = self.world.candidates(node.contacts, node.state, 0.0, NEAR)
        left = total - each[out[:, 0]] + self._far[out[:, 0], out[:, 1]]
        cost = done + WEIGHT * (left + self._body_left(stretch[:, 1:])) + DEAR * stretch[:, 0]

        def ordered(out: NDArray[np.int32], cost: Array) -> _Moves:
            for k in np.argsort(cost, kind="stable").tolist():
                limb = int(out[k, 0])
                if limb not in node.stuck:
                    after = node.contacts.copy()
                    after[limb] = out[k, 1]
                    yield float(cost[k]), after

        def singles() -> _Moves:
            yield from ordered(out, cost)
            later, far = self.world.candidates(node.contacts, node.state, NEAR, np.inf, guesses=False)
            left = total - each[later[:, 0]] + self._far[later[:, 0], later[:, 1]] + self._body_left(far[:, 1:])
            worth = done + WEIGHT * left + DEAR * far[:, 0]
            yield from ordered(later, np.maximum(worth, cost.max(initial=done)))

        free = np.flatnonzero(node.contacts >= 0)
        letting_go = np.column_stack([free, np.full(len(free), FREE_LIMB)]).astype(np.int32)
        here = self._body_left(node.state[None, 9:12])
        worth = done + WEIGHT * (total - each[free] + aloft + here)
        worth = worth + DEAR * self.world.stretch(node.contacts, node.state)
        sets = self._set_moves(node, out, cost, left, total)
        return heapq.merge(singles(), ordered(letting_go, worth), iter(sets), key=lambda entry: entry[0])

    def _set_moves(
        self, node: _Node, out: NDArray[np.int32], cost: Array, left: Array, total: float
    ) -> list[tuple[float, NDArray[np.int32]]]:
        """Moves of the gait's sets: each limb of a set to its most promising foothold."""
        found = []
        for limbs in self._sets:
            after, worth = node.contacts.copy(), node.steps + 1.0 + WEIGHT * total
            for limb in limbs:
                rows = np.flatnonzero(out[:, 0] == limb)
                taken = {self._hold(at) for at in after if at >= 0}
                for row in rows[np.argsort(cost[rows], kind="stable")]:
                    if self._hold(out[row, 1]) not in taken:
                        after[limb] = out[row, 1]
                        worth += WEIGHT * (left[row] - total)
                        break
            if (after != node.contacts).sum() > 1:
                found.append((worth, after))
        return sorted(found, key=lambda entry: entry[0])

    def _body_left(self, places: Array) -> Array:
        """Steps that bodies are away from the goal, where that is nearer than contacts are from the body ``(n)``."""
        if self._goal_body is None:
            return np.zeros(len(places))
        away = np.minimum(np.linalg.norm(places - self._goal_body[9:], axis=1), self._spread)
        return np.asarray(len(self._names) * away / (STRIDE * self.world.length))

    def _hold(self, at: int) -> int:
        return int(self.world.hold[at])

    def _rows(self, contacts: NDArray[np.int32]) -> tuple[int, ...]:
        """Rows of footholds of contacts."""
        return tuple(self._hold(at) if at >= 0 else FREE_LIMB for at in contacts)

    def _forbidden(self, contacts: NDArray[np.int32], after: NDArray[np.int32]) -> bool:
        forbidden = self.options.forbidden
        return bool(forbidden) and (self._rows(contacts), self._rows(after)) in forbidden

    def _distances(self) -> tuple[Array, Array | None, int]:
        """Steps that each limb is away from the goal at each place ``(limbs, places)``; the body's pose at the goal,
        and the limb that is to hold.
        """
        world, goal, scene = self.world, self.goal, self.scene
        body, limb = None, -1
        if isinstance(goal, BodyPlace):
            ahead = np.linalg.norm(scene.positions - goal.position, axis=1)
            reach = self._spread + world.length
            seeds = np.where(ahead <= max(reach, float(ahead.min())), np.maximum(ahead - self._spread, 0.0), np.inf)
            rotation = np.eye(3) if goal.rotation is None else goal.rotation
            body, aside = place(pin.SE3(rotation, goal.position)), 0.0
        else:
            validation.instance("goal", goal, LimbAt, "a BodyPlace, LimbAt or Route")
            limb = self.climber.row(goal.limb)
            row = scene.row(goal.foothold)
            allowed = scene.footholds[row].limbs
            if allowed and goal.limb not in allowed:
                raise RangeError(
                    "goal.limb", goal.limb, f"foothold {goal.foothold} is held by {', '.join(allowed)} only"
                )
            seeds, aside = np.full(len(scene.footholds), np.inf), 2.0 * self._spread
            seeds[row] = 0.0
        ways = ways_over_footholds(scene.positions, seeds, world.length)[world.hold]
        far = np.tile(ways / (STRIDE * world.length), (len(self._names), 1))
        if isinstance(goal, BodyPlace) and goal.rotation is not None:
            # Where contacts are to be with the body at the goal
            rests = goal.position + world.touch[:, 9:] @ goal.rotation.T
            away = np.linalg.norm(world.places[:, 9:] - rests[:, None], axis=2)
            far = np.maximum(far, (away - COMFORTABLE * world.length) / (STRIDE * world.length))
        if limb >= 0:
            others = np.arange(len(far)) != limb
            far[others] = np.maximum(far[others] - aside / (STRIDE * world.length), 0.0)
        return far, body, limb

    def _distance(self, node: _Node) -> float:
        """From the goal, of the body or the limb [m]."""
        if self._goal_body is not None:
            return float(np.linalg.norm(node.state[9:12] - self._goal_body[9:]))
        at = node.contacts[self._limb]
        return float(self._far[self._limb, at] * STRIDE * self.world.length) if at >= 0 else np.inf

    def _checked_start(self) -> _Node:
        """The first stance, if it is one."""
        world, first = self.world, self.first
        numbers, nearest = world.look(first.contacts, first.state)
        for limb, off in enumerate(numbers[2:]):
            if off > AT_START:
                at = self.scene.footholds[self._hold(first.contacts[limb])].id
                reason = f"{self._names[limb]} is {off:.3g} m away from foothold {at}, that it holds"
                raise no_stances("start.q", off, reason, "start")
        for limb, (low, high) in enumerate(self.climber.limits):
            angles = first.state[12 + world.offsets[limb] : 12 + world.offsets[limb + 1]]
            beyond = np.maximum(low - angles, angles - high)
            if (beyond > AT_START).any():
                k = int(np.argmax(beyond))
                reason = f"angle {k + 1} of {self._names[limb]} is {beyond[k]:.3g} beyond its limit"
                raise no_stances("start.q", float(angles[k]), reason, "start")
        if not numbers[0] >= 0.0:
            raise no_stances("start", float(numbers[0]), self._why_not_borne(first, numbers[0]), "start")
        if self._balance is not None:
            # By all of the efforts: the body may still shift to where a share of them is enough
            held = self._rows(first.contacts)
            if lacks := self._balance.lacking(held, world.q_of(first.state), max(self.options.effort, 1.0)):
                reason = f"{self._balance.told(held, lacks)}, by all that its motors give"
                raise no_stances("start", lacks[0][1], reason, "start")
        if numbers[1] < -SPARE - TOLERANCE:
            reason = f"{nearest} are {-numbers[1]:.3g} m nearer to each other than they may be"
            raise no_stances("start.q", float(numbers[1]), reason, "start")
        return _Node(first.contacts, first.state, 0, float(numbers[0]))

    def _why_not_borne(self, node: _Node, slack: float) -> str:
        held = [name for name, at in zip(self._names, node.contacts, strict=True) if at >= 0]
        on = " and ".join(held) or "no limb"
        if slack == -np.inf:
            return f"it cannot stand on {on}: their contacts bear no wrench of every direction"
        short = -slack * self.world.weight
        return f"it cannot stand on {on}: the contacts lack {-slack:.3g} of the weight, {short:.3g} N each"

    def _at_goal(self, node: _Node) -> StancePath | None:
        """The whole way, if a posture of this stance is at the goal."""
        if self._goal_body is None:
            return self._path(node, None) if self._hold_of(node) else None
        goal = self.goal
        assert isinstance(goal, BodyPlace)
        near = self._distance(node)
        if near > 0.5 * self.world.length + goal.within:
            return None
        turned = goal.rotation is not None
        if near <= goal.within and not turned:
            return self._path(node, None)
        body = self._goal_body if turned else np.concatenate([node.state[:9], self._goal_body[9:]])
        how, state, _ = self.world.stand(
            node.contacts, node.contacts, self.options.margin, node.state, body=body,
            weights=(DRAWN, DRAWN if turned else 0.0),
        )  # fmt: skip
        off = np.linalg.norm(state[9:12] - body[9:])
        turn = np.linalg.norm(pin.log3(body[:9].reshape(3, 3).T @ state[:9].reshape(3, 3))) if turned else 0.0
        if how != PostureOutcome.STANDS or off > goal.within or turn > goal.within:
            return None
        return self._path(node, state)

    def _hold_of(self, node: _Node) -> bool:
        at = node.contacts[self._limb]
        assert isinstance(self.goal, LimbAt)
        return bool(at >= 0 and self._hold(at) == self.scene.row(self.goal.foothold))

    def _path(self, node: _Node, last: Array | None) -> StancePath:
        """From the first stance to this one; body shifts are stances of the same contacts."""
        chain = [node]
        while chain[-1].before is not None:
            chain.append(chain[-1].before)
        rows: list[tuple[NDArray[np.int32], Array]] = []
        for one in reversed(chain):
            if one.lift is not None and one.before is not None:
                rows.append((one.before.contacts, one.lift))
            rows.append((one.contacts, one.state))
        if last is not None:
            rows.append((node.contacts, last))
        margins = [self.first.slack]
        stances = [Stance(self._rows(contacts), self.world.q_of(state)) for contacts, state in rows]
        centers = [self.climber.center_of_mass(stance.q) for stance in stances]
        for k, ((contacts, _), (after, _)) in enumerate(itertools.pairwise(rows)):
            kept = np.where(contacts == after, after, FREE_LIMB).tolist()
            margins.append(min(self.world.slack(kept, at)[0] for at in centers[k : k + 2]))
        return StancePath((self.given, *stances[1:]), np.array(margins))

    def _crossing(self) -> str:
        """The first step that no stance has made."""
        borne = [node.contacts for node in self._known.values()]
        if len(self._names) == 2:
            lifts = [lift for node in self._known.values() for lift in node.lifts.items()]
            borne = [
                np.frombuffer(kept, dtype=np.int32) for kept, (lift, _) in lifts if lift[0] == PostureOutcome.STANDS
            ]
        rows = {row for contacts in borne for row in self._rows(contacts)} - {FREE_LIMB}
        return self._separation.crossing(rows, self._far.min(axis=0), self.options.margin, self.first.state)

    def _refusal(self, cause: str) -> NoStancesError:
        tried, best = sum(self.tried.values()), self._nearest
        nearest = self._distance(best)
        parts = counted(self.tried)
        saw = f"{self.seen} stances were reached and {tried} moves looked at" + (f" ({parts})" if parts else "")
        which = f"the nearest is {nearest:.3g} m from the goal, on {self._told(best)}"
        goal = self._told_goal()
        if cause == "limit":
            reason = f"a limit of moves or time ended the search, which proves nothing: {saw}; {which}"
            told = self._crossing()
            return no_stances("goal", goal, f"{reason}; {told}" if told else reason, cause, nearest)
        if lacking := "; ".join(self._separation.lacking().values()):
            reason = f"no stance there is within reach: {lacking}; {saw}; {which}"
            return no_stances("goal", goal, reason, "goal", nearest)
        return no_stances("goal", goal, f"every stance that can be come to was seen: {saw}; {which}", cause, nearest)

    def _told_goal(self) -> Any:
        return self.goal.position.round(3).tolist() if isinstance(self.goal, BodyPlace) else self.goal

    def _so_far(self) -> str:
        away, tried = self._distance(self._nearest), sum(self.tried.values())
        return f"{self.seen} stances, {tried} moves looked at, {away:.3g} m to go"

    def _told(self, node: _Node) -> str:
        held = zip(self._names, self._rows(node.contacts), strict=True)
        return ", ".join(f"{name} at {self.scene.footholds[row].id if row >= 0 else 'none'}" for name, row in held)
