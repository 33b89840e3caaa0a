"""Plans for the two-ended arm: from a stance to a hold, or to where its elbow is over a point."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import RangeError, ShapeError
from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking.body_path import BodyPath
from wbc.walking.holds.structure import Structure
from wbc.walking.planner.grips.table import END, Grips
from wbc.walking.planner.plan import NoPlanError, Plan, Regrasp
from wbc.walking.planner.stances.nodes import Found
from wbc.walking.two_ended.postures import Grip, PairPostures, from_body_outwards
from wbc.walking.two_ended.search import GAITS, TurnSearch
from wbc.walking.two_ended.swing_path import Turn, TurnLaw, TurnPaths

#: Samples of a plan are this far apart [s]
SPACING = 0.05
#: The arm stands so many samples before and after each swing, while hands open and close
STAND = 6
#: Stances whose elbows are as near to a point as the nearest one, within this [m]
SAME_PLACE = 0.05

Goal = Callable[[Grip, Grip], bool]


@dataclass(frozen=True, eq=False)
class TwoEndedPlan(Plan):
    """A plan of the two-ended arm, and its request.

    Attributes:
        to, gait: of :func:`plan_two_ended`.
    """

    to: str | Sequence[float] = ""
    gait: str = "any"


def plan_two_ended(
    walker: Walker,
    structure: Structure,
    start: Mapping[str, str],
    to: str | Sequence[float],
    *,
    gait: str = "any",
    width: int | None = 200,
    rolls: tuple[int | None, int | None] = (None, None),
) -> TwoEndedPlan:
    """Which hand of the two-ended arm to move where, by the planner's search: the fewest swings, then the least time.

    Args:
        start: hold ids of ``arm1`` and ``arm2``.
        to: id of a hold that a hand is to hold, or a point [m] that the elbow is to be as near to as it can be.
        gait: ``inchworm``: hands keep their order along the route; ``turnaround``: each swing changes it; ``any``.
        width: stances stored for each number of re-grasps; None: all.
        rolls: number of the roll at which each hand holds; None: any.

    Raises:
        UnknownNameError: another arm, hold or gait. ShapeError: another machine, or a start without both hands.
        RangeError: a hold on which a hand may roll or lean: it does not say where the arm is.
        NoPlanError: there is none, or the elbow comes nowhere near to a place.
    """
    rows = _start(structure, start)
    search, paths = _search(walker, structure, structure.positions[list(rows)].mean(axis=0), to, gait, width)
    grips = search.grips
    hands = [
        [grip for grip in grips.of_arm(arm) if grips.hold[grip] == row and roll in (None, grips.roll[grip])]
        for arm, (row, roll) in enumerate(zip(rows, rolls, strict=True))
    ]
    stances = [pair for pair in product(*hands) if search.until(pair, 0) > 0]
    if not stances:
        raise NoPlanError("start", dict(start), "the arm has no posture between these holds", separating=start.values())
    found = search.run(stances)
    if not found.complete:
        raise _refused(structure, search, found, to)
    near, far = (search.pairs.named(grip) for grip in found.start)
    first = paths.postures.between(near, far)
    assert first is not None
    plan = _plan(walker, paths, Turn(0, near, near, far), first, _swings(paths, search, found))
    return replace(plan, to=to, gait=gait)


def plan_from_air(
    walker: Walker,
    structure: Structure,
    held: tuple[int, Grip],
    joints: Array,
    to: str | Sequence[float],
    *,
    gait: str = "any",
    width: int | None = 200,
    left: str = "",
    rates: Array | None = None,
) -> TwoEndedPlan:
    """As :func:`plan_two_ended`, of an arm with one hand in the air, which first goes to any hold: to one from which
    the fewest swings lead to the goal.

    Args:
        held: row of the arm whose hand holds, and its grip. joints: 1 to 7 ``[7]`` [rad].
        left: id of the hold that the hand in the air had.
        rates: of the joints ``[7]``, which first come to rest [rad/s]; None: they are at rest.

    Raises:
        NoPlanError: the hand reaches no other hold, or no swing leads on from there. Else as ``plan_two_ended``.
    """
    arm, grip = held
    free = 1 - arm
    search, paths = _search(walker, structure, structure.positions[grip.hold], to, gait, width)
    pairs, stop = search.pairs, joints[None] if rates is None else paths.stop(joints, rates, SPACING)
    ways = dict[tuple[int, ...], Array]()
    (holding,) = (one for one in search.grips.of_arm(arm) if pairs.named(one) == grip)
    for other in search.grips.of_arm(free):
        stance, target = (holding, other) if arm == 0 else (other, holding), pairs.named(other)
        if target.hold != grip.hold and search.until(stance, 0) > 0:
            way = paths.from_air(Turn(free, target, target, grip), stop)
            if way is not None:
                ways[stance] = way
    if not ways:
        where, name = structure.ids[grip.hold], walker.arms[free].name
        raise NoPlanError("hands", name, f"from where it is in the air it reaches no hold beside {where}")
    found = search.run(list(ways))
    if not found.complete:
        raise _refused(structure, search, found, to)
    target = pairs.named(found.start[free])
    turn, way = Turn(free, target, target, grip), paths.timed(ways[tuple(found.start)], SPACING)
    swings = [(turn, np.concatenate([stop[:-1], way])), *_swings(paths, search, found)]
    stand = STAND if len(stop) == 1 else 0
    return replace(_plan(walker, paths, turn, joints, swings, left, stand), to=to, gait=gait)


def _search(
    walker: Walker, structure: Structure, here: Array, to: str | Sequence[float], gait: str, width: int | None
) -> tuple[TurnSearch, TurnPaths]:
    """From a place to a goal."""
    validation.one_of("gait", gait, tuple(GAITS))
    postures = PairPostures(walker, structure)
    for hold in structure.holds:
        if not hold.rolls or hold.max_tilt > 0.0:
            raise RangeError("structure", hold.id, "one hand must fix the arm: no free roll, no tilt")
    goal, there = _goal(postures, to)
    paths, towards = TurnPaths(postures), (structure.positions - here) @ _unit(there - here)
    return TurnSearch(walker, structure, paths, towards, goal, gait, width), paths


def _start(structure: Structure, start: Mapping[str, str]) -> tuple[int, int]:
    for name in start:
        validation.one_of("start", name, ("arm1", "arm2"))
    if len(start) != 2:
        raise ShapeError("start", dict(start), "expected the holds of arm1 and arm2")
    near, far = (structure.index(start[name]) for name in ("arm1", "arm2"))
    if near == far:
        raise RangeError("start", dict(start), "two hands on one hold")
    return near, far


def _goal(postures: PairPostures, to: str | Sequence[float]) -> tuple[Goal, Array]:
    """What an end is, and where."""
    structure = postures.structure
    if isinstance(to, str):
        row = structure.index(to)
        return (lambda near, far: row in (near.hold, far.hold)), structure.positions[row]
    place = validation.real_array("to", to, (3,))
    hands = [Grip(k, roll) for k, hold in enumerate(structure.holds) for roll in range(len(hold.rolls))]
    far: dict[tuple[Grip, Grip], float] = {}
    for pair in ((one, other) for one in hands for other in hands if one.hold != other.hold):
        q = postures.between(*pair)
        if q is not None:
            elbow = (postures.frame(pair[0]) @ postures.kinematics.frames(q)[3])[:3, 3]
            far[pair] = float(np.linalg.norm(elbow - place))
    if not far:
        raise NoPlanError("to", list(to), "the arm has no posture on any two holds")
    nearest = min(far.values())
    if nearest > 2.0 * postures.kinematics.data.boom_length:
        raise NoPlanError("to", list(to), f"no two holds bring the arm's elbow nearer to it than {nearest:.1f} m")
    least = nearest + SAME_PLACE
    return (lambda near, other: far.get((near, other), np.inf) <= least), place


def _unit(offset: Array) -> Array:
    length = float(np.linalg.norm(offset))
    return offset / length if length > 0.0 else np.array([1.0, 0.0, 0.0])


def _refused(structure: Structure, search: TurnSearch, found: Found, to: Any) -> NoPlanError:
    last = list(found.start)
    for move in found.moves:
        last[move.arm] = move.target
    names = [structure.ids[search.grips.hold[grip]] for grip in last]
    return NoPlanError("to", to, f"no swing leads on from {' and '.join(names)}", separating=names)


def _swings(paths: TurnPaths, search: TurnSearch, found: Found) -> list[tuple[Turn, Array]]:
    """Swings from stance to stance, with their joints over time."""
    hands, out = [search.pairs.named(grip) for grip in found.start], list[tuple[Turn, Array]]()
    for move in found.moves:
        turn = Turn(move.arm, hands[move.arm], search.pairs.named(move.target), hands[1 - move.arm])
        path = paths.path(turn)
        assert path is not None
        out.append((turn, paths.timed(path, SPACING)))
        hands[move.arm] = turn.target
    return out


def _plan(
    walker: Walker,
    paths: TurnPaths,
    standing: Turn,
    first: Array,
    swings: list[tuple[Turn, Array]],
    left: str = "",
    stand: int = STAND,
) -> TwoEndedPlan:
    """The whole plan: standing, swinging, standing.

    Args:
        standing: grips at the beginning, by a turn that changes nothing. first: posture there ``[7]`` [rad].
        swings: with their joints over time. left: id of the hold that the first hand comes from; "": of its grip.
        stand: samples that the arm stands at the beginning, and again before the first swing.
    """
    structure, joints = paths.postures.structure, [np.repeat(first[None], stand, axis=0)]
    poses, hands = [paths.frames(standing, joints[0])[:, 3]], paths.pair(standing, standing.source)
    count, steps, laws, spans = stand, list[Regrasp](), list[TurnLaw](), [[(hands[k], 0)] for k in range(2)]
    for turn, way in swings:
        q = np.concatenate([np.repeat(way[:1], stand, axis=0), way, np.repeat(way[-1:], STAND, axis=0)])
        joints.append(q)
        frames = paths.frames(turn, q)
        poses.append(frames[:, 3])
        hands_at, mine = frames[:-STAND, 7 * turn.arm, :3, 3], from_body_outwards(q[:-STAND], turn.arm)
        laws.append(TurnLaw(hands_at, mine, SPACING))
        lift, land = count, count + len(q) - STAND
        names = left or structure.ids[turn.source.hold], structure.ids[turn.target.hold]
        spent, roll = round((land - lift) * SPACING, 6), structure.holds[turn.target.hold].rolls[turn.target.roll]
        times = round(lift * SPACING, 9), round(land * SPACING, 9), spent, 0.0, 0.0
        steps.append(Regrasp(walker.arms[turn.arm].name, *names, 0, *times, "end of the path", 0.0, roll=roll))
        spans[turn.arm].append((turn.target, land))
        count, left, stand = count + len(q), "", STAND
    path = BodyPath(np.concatenate(poses), SPACING)
    table, chain = _grips(walker, np.concatenate(joints), spans, steps)
    start = tuple(structure.ids[hand.hold] for hand in hands)
    return TwoEndedPlan(path, start, tuple(steps), True, path.duration, "", table, chain, (), tuple(laws))


def _grips(
    walker: Walker, joints: Array, spans: list[list[tuple[Grip, int]]], steps: list[Regrasp]
) -> tuple[Grips, tuple[tuple[int, ...], ...]]:
    """Grips of the plan over its path, and those that each arm uses."""
    rows, parts, chain, offset = list[list[int]](), list[Array](), list[tuple[int, ...]](), 0
    for arm, mine in enumerate(spans):
        columns = from_body_outwards(joints, arm)
        lifts = [round(step.lift / SPACING) for step in steps if step.arm == walker.arms[arm].name]
        ends = [lift + STAND // 2 for lift in lifts] + [len(joints) - 1]
        chain.append(tuple(range(len(rows), len(rows) + len(mine))))
        for (grip, first), last in zip(mine, ends, strict=True):
            rows.append([arm, grip.hold, 0, first, last, offset, 0, grip.roll])
            part = np.zeros((last - first + 1, 4))
            part[:, : columns.shape[1]] = columns[first : last + 1]
            parts.append(part)
            offset += len(part)
    arms, holds, branch, firsts, lasts, offsets, ends_by, rolls = np.array(rows, dtype=np.int64).T
    return Grips(arms, holds, branch, firsts, lasts, offsets, np.concatenate(parts), ends_by, rolls, (END,)), tuple(
        chain
    )
