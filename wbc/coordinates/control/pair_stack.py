"""One stack for several pairs: every coordinate once as a task and once as an equality, switched at run time."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from wbc import validation
from wbc.api import Stack
from wbc.coordinates import expressions
from wbc.coordinates.items import FollowRows, KeepRows
from wbc.coordinates.pair import CoordinatePair, pairs_of
from wbc.coordinates.rows import Coordinate
from wbc.errors import DuplicateNameError
from wbc.robot import Robot
from wbc.tasks import Damping, Item, JointLimits

#: Cost of joint speed against a task row of weight 1, less than that of other stacks: operators' rates are to be met
DAMPING = 1e-11
#: Name of the item that lets the task give way near a locus, see :class:`wbc.coordinates.control.easing.Easing`
EASE = "ease near a locus"
#: Part of the drift of what is held that one step takes back
STACK_SHARE = 0.5


@dataclass(frozen=True, eq=False)
class PairStack:
    """A stack with the items of its pairs.

    Attributes:
        stack: the declaration. pairs: by name.
        coordinates: all of them, each once. follow: name of the item that is the task, by pair. keep: by coordinate.
    """

    stack: Stack
    pairs: dict[str, CoordinatePair]
    coordinates: tuple[Coordinate, ...]
    follow: dict[str, str]
    keep: dict[Coordinate, str]


def pair_stack(
    robot: Robot,
    pairs: CoordinatePair | Iterable[CoordinatePair],
    dt: float = 0.02,
    *,
    items: Sequence[Item] = (),
    limits: bool = True,
    gain: float | None = None,
    length: float | None = None,
    scaled: bool = False,
) -> PairStack:
    """The stack of one pair or several.

    Args:
        dt: time between commands [s].
        items: further constraints (obstacles, boxes) or tasks. limits: keep the joint limits, in the order of
            sacrifice before what is held; False: those of the rates only, without which a step beside a locus would
            leave what it is linear for.
        gain: how fast drift of what is held decays [1/s]; default: half of it in one step.
        length: characteristic length [m], as of :class:`wbc.Stack`.
        scaled: tasks that joints are too slow for are slowed down and keep their direction, see ``scaled`` of
            :meth:`wbc.Stack.add`.

    Raises:
        ShapeError, DuplicateNameError: no pairs, two of one name. UnknownNameError, RangeError: as of
            :meth:`CoordinatePair.counts`.
    """
    given = pairs_of(pairs)
    named: dict[str, CoordinatePair] = {}
    for pair in given:
        pair.counts(robot)
        if pair.name in named:
            raise DuplicateNameError("pairs", pair.name, "two pairs of one name")
        named[pair.name] = pair
    every = tuple(dict.fromkeys(one for pair in given for one in pair.rows))
    labels = _labels(every)
    stack = Stack(robot, dt, damping=DAMPING, length=length, calm=False)
    follow: dict[str, str] = {}
    tasks: dict[FollowRows, str] = {}
    keep: dict[Coordinate, str] = {}
    for pair in given:
        task = FollowRows(pair.task, pair.metric)
        if task not in tasks:
            points = "" if pair.metric is None else f" by points at {pair.metric:g} m"
            tasks[task] = f"follow {', '.join(labels[one] for one in pair.task)}{points}"
            stack.add(task, name=tasks[task], scaled=scaled)
        follow[pair.name] = tasks[task]
        for one in pair.constraint:
            if one not in keep:
                keep[one] = f"keep {labels[one]}"
                stack.add(KeepRows(one, STACK_SHARE / dt if gain is None else gain), name=keep[one])
    stack.add(Damping(), name=EASE)
    for item in validation.items("items", items, "items of a stack"):
        stack.add(item)
    stack.add(JointLimits() if validation.flag("limits", limits) else JointLimits(position=False, acceleration=False))
    return PairStack(stack, named, every, follow, keep)


def row_count(robot: Robot, rows: Iterable[Coordinate]) -> int:
    """Rows of several coordinates."""
    return sum(len(expressions.labels(robot, one)) for one in rows)


def _labels(every: Sequence[Coordinate]) -> dict[Coordinate, str]:
    """Names of coordinates, numbered where two would be the same."""
    texts = [str(one) for one in every]
    out = {}
    for k, (one, text) in enumerate(zip(every, texts, strict=True)):
        out[one] = text if texts.count(text) == 1 else f"{text} ({texts[: k + 1].count(text)})"
    return out
