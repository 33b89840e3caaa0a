"""The planner's search over stances, for the two-ended arm: what its grips, conflicts and swings are."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking.body_path import BodyPath
from wbc.walking.holds.structure import Structure
from wbc.walking.planner.grips.conflicts import NEVER
from wbc.walking.planner.grips.table import Grips, Ints
from wbc.walking.planner.slices import Slices
from wbc.walking.planner.stances.candidates import QUANTUM
from wbc.walking.planner.stances.nodes import Node
from wbc.walking.planner.stances.search import INSIDE, StanceSearch
from wbc.walking.planner.swings.move import Chosen, Key, Move, Swing
from wbc.walking.two_ended.postures import Grip, PairPostures
from wbc.walking.two_ended.swing_path import Turn, TurnPaths

#: Samples of the search count re-grasps: no swing takes longer than one [s]
SAMPLE = 1e4
#: Whether the hands have exchanged their order in a swing: before and after, far hand less near hand along it [m]
GAITS: dict[str, Callable[[float, float], bool]] = {
    "any": lambda before, after: True,
    "inchworm": lambda before, after: before * after > 0.0,
    "turnaround": lambda before, after: before * after < 0.0,
}


class Pairs:
    """Which grips of the two hands go together: those with a posture; at the end those that the goal allows.

    It is a :class:`wbc.walking.planner.stances.nodes.Conflicts`.

    Args:
        grips: of the search. last: sample at which the goal counts. goal: of the grips of near and far hand.
    """

    def __init__(self, postures: PairPostures, grips: Grips, last: int, goal: Callable[[Grip, Grip], bool]) -> None:
        self._postures, self._grips, self._last, self._goal = postures, grips, last, goal

    def named(self, grip: int) -> Grip:
        """What a row of the grips stands for."""
        return Grip(int(self._grips.hold[grip]), int(self._grips.roll[grip]))

    def prepare(self, pairs: Iterable[tuple[int, int]]) -> None:
        """Nothing: pairs are looked at on demand."""

    def first_conflict(self, one: int, other: int, sample: int) -> int:
        """The first sample from ``sample`` on at which two grips do not go together."""
        near, far = sorted((one, other), key=lambda grip: int(self._grips.arm[grip]))
        hands = self.named(near), self.named(far)
        if self._postures.between(*hands) is None:
            return sample
        return NEVER if self._goal(*hands) else max(self._last, sample)

    def free_from(self, one: int, other: int, sample: int) -> int:
        """The first sample from ``sample`` on at which two grips go together; those that do not never do."""
        return sample if self.first_conflict(one, other, sample) > sample else NEVER


class Turns:
    """Swings between grips, as the search asks for them, a :class:`wbc.walking.planner.stances.nodes.SwingTable`.

    Args:
        places: of the holds along the route [m]. gait: one of :data:`GAITS`.
    """

    #: A sample is a re-grasp: none passes while a hand closes
    touch = 0

    def __init__(self, paths: TurnPaths, pairs: Pairs, grips: Grips, places: Array, gait: str) -> None:
        self._paths, self._pairs, self._grips, self._places, self._fits = paths, pairs, grips, places, GAITS[gait]

    def turn(self, swing: Swing) -> Turn:
        """What a swing of the search is."""
        source, target, held = (self._pairs.named(g) for g in (swing.source, swing.target, swing.others[0]))
        return Turn(swing.arm, source, target, held)

    def estimate(self, sources: Ints, targets: Ints, lift: Ints, land: Ints) -> Array:
        """Times that no swing is shorter than."""
        return np.zeros(len(targets))

    def soonest(self) -> Ints:
        """Right behind the beginning of grips: no joint has to be bent."""
        out: Ints = self._grips.first + INSIDE
        return out

    def lands(self, targets: Ints, samples: Ints) -> NDArray[np.bool_]:
        """Hands land with all seven joints, none of which has to be bent."""
        return np.ones(len(targets), dtype=bool)

    def correct(self, move: Move, duration: float, possible: bool) -> None:
        """Nothing: swings are looked at as they will be carried out."""

    def slices(self, swings: Iterable[Swing]) -> Slices[None]:
        """Look at swings one by one."""
        for swing in swings:
            self.choose(swing)
            yield None

    def choose(self, swing: Swing) -> Chosen | None:
        """How a hand swings; None where it cannot, or the gait does not allow it."""
        turn = self.turn(swing)
        before, after = (self._places[grip.hold] - self._places[turn.held.hold] for grip in (turn.source, turn.target))
        if not self._fits(before, after) or self._paths.path(turn) is None:
            return None
        return Chosen(0, self._paths.seconds(turn))


class TurnSearch(StanceSearch[Turns]):
    """The fewest re-grasps, then the least time, from a stance to one that the goal allows.

    A sample is a re-grasp, and a grip ends the later the further its hold is along the route, so hands only go on.

    Args:
        towards: positions of the holds along the route [m]. goal: whether grips of near and far hand are an end.
    """

    def __init__(
        self,
        walker: Walker,
        structure: Structure,
        paths: TurnPaths,
        towards: Array,
        goal: Callable[[Grip, Grip], bool],
        gait: str = "any",
        width: int | None = 200,
    ) -> None:
        count = 4 * len(structure) + 8
        standing = BodyPath(np.repeat(np.eye(4)[None], count, axis=0), SAMPLE)
        grips = grips_along(structure, towards, count)
        self.pairs = Pairs(paths.postures, grips, len(standing) - 1, goal)
        turns = Turns(paths, self.pairs, grips, towards, gait)
        super().__init__(standing, grips, self.pairs, turns, hover=walker.margins.hover, width=width, spare=0)

    def _checked(self, level: dict[Key, Node], node: Node, swing: Swing | None) -> Node | None:
        """With the time that the swing takes, as nothing else is late."""
        found = super()._checked(level, node, swing)
        if found is None or found.move is None or found.parent is None:
            return found
        return found._replace(delay=level[found.parent].delay + round(found.move.duration / QUANTUM))


def grips_along(structure: Structure, towards: Array, count: int) -> Grips:
    """Every hand on every hold at each of its rolls, for a search over ``count`` samples."""
    order = np.argsort(np.argsort(np.round(towards, 9), kind="stable"), kind="stable")
    rows: list[Sequence[int]] = [
        (arm, hold, roll, count * (1 + int(order[hold])))
        for arm in range(2)
        for hold, one in enumerate(structure.holds)
        for roll in range(len(one.rolls))
    ]
    arms, holds, rolls, last = np.array(rows, dtype=np.int64).T
    none = np.zeros(len(arms), dtype=np.int64)
    return Grips(arms, holds, none, none, last, none, np.zeros((1, 6)), none, rolls)
