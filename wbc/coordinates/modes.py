"""Modes in which operators command an arm, as pairs of coordinates.

| mode | commanded | held |
|---|---|---|
| M1 | tip of the first arm | one scalar constraint, or two with the body joint free; other joints of a tree |
| M2 | that constraint: self-motion | the tip |
| M3 | a point on the way to the tip, as far as it can go | joints beyond it, pitch plane |
| M4 | position of the tip | joints of the wrist, and a scalar constraint where one is left |
| M5 | one joint, or the body joint | all other joints |
| M6 | body joint, or one arm | both hands by their poses; or the other arm and the body by locks |
| M7 | tip of the carrier | both hands, fixed in space |
| M8 | the point on the way, in the least-squares sense | the tip: more rows than joints |

Source: E. Dupuis, PhD thesis, McGill University, 2001, chapter 4, eqs. 4.12 to 4.28, 4.43, 4.44 and 4.48.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from enum import StrEnum
from typing import TypeAlias

from wbc import validation
from wbc.analysis.rows import BodyRows, JointRows
from wbc.coordinates.arm_parts import Arm, Parts, parts
from wbc.coordinates.pair import CoordinatePair
from wbc.coordinates.rows import Coordinate
from wbc.errors import WbcError
from wbc.robots.operator_arms import OPERATOR_ARMS


class Mode(StrEnum):
    """See the module."""

    M1 = "end effector"
    M2 = "self-motion"
    M3 = "intermediate body"
    M4 = "position only"
    M5 = "joint by joint"
    M6 = "two arms"
    M7 = "carrier with held hands"
    M8 = "over-determined"


#: Short names, as operators say them
SHORT = {mode.name: mode for mode in Mode}
#: The pairs of a mode, or the part that a robot lacks
Made: TypeAlias = "Sequence[CoordinatePair] | str"
NOT_REDUNDANT = "joint beyond those that its tip takes"


class MissingPartError(WbcError):
    """A mode that a robot has no rows for; ``part`` is what it lacks."""

    part = ""


def mode(name: str | Mode) -> Mode:
    """A mode by its short name or what it is called.

    Raises:
        UnknownNameError: no such mode.
    """
    if isinstance(name, Mode):
        return name
    by_name = SHORT | {m.value: m for m in Mode}
    return by_name[validation.one_of("mode", name, by_name)]


def mode_pairs(robot: str, wanted: str | Mode) -> tuple[CoordinatePair, ...]:
    """The pairs of a mode on a robot of :func:`wbc.robots.operator_arm`; the frames they need are in
    :func:`wbc.coordinates.parts`.

    Raises:
        UnknownNameError: no such robot or mode. MissingPartError: the robot has no rows for it; the error says what
            is missing.
    """
    chosen, found = mode(wanted), parts(robot)
    pairs = _MAKERS[chosen](found)
    if isinstance(pairs, str):
        error = MissingPartError("mode", f"{chosen.name} on {robot}", f"the robot has no {pairs}")
        error.part = pairs
        raise error
    return tuple(pairs)


def mode_table() -> dict[str, dict[Mode, tuple[CoordinatePair, ...] | str]]:
    """Robot -> mode -> its pairs, or the part that is missing."""
    out: dict[str, dict[Mode, tuple[CoordinatePair, ...] | str]] = {}
    for robot in OPERATOR_ARMS:
        row: dict[Mode, tuple[CoordinatePair, ...] | str] = {}
        for one in Mode:
            try:
                row[one] = mode_pairs(robot, one)
            except MissingPartError as error:
                row[one] = error.part
        out[robot] = row
    return out


def _others(found: Parts, arm: Arm) -> tuple[Coordinate, ...]:
    """Brakes on everything but one arm."""
    body = () if found.body is None else (JointRows(found.body),)
    return (*(lock for other in found.everything if other is not arm for lock in other.locks()), *body)


def _redundant(arm: Arm) -> tuple[Coordinate, ...]:
    return arm.candidates() if arm.redundancy == 1 else ()


def _end_effector(found: Parts) -> Made:
    arm = found.arms[0]
    pairs = [CoordinatePair(arm.tip, (one, *_others(found, arm)), f"{arm.tip} | {one}") for one in _redundant(arm)]
    return [*pairs, *_free_body(found, arm)] or NOT_REDUNDANT


def _free_body(found: Parts, arm: Arm) -> list[CoordinatePair]:
    """Pairs for where the arm by itself is singular: the body joint moves, two coordinates of the arm are held.

    The five were chosen by a search over all twos of alpha, beta, gamma and locks; how well they do is measured in
    docs/coordinates.md.
    """
    if found.body is None or found.carrier is not None or arm.alpha is None:
        return []
    others = tuple(lock for other in found.arms if other is not arm for lock in other.locks())
    held: list[tuple[Coordinate, Coordinate]] = [(arm.alpha, JointRows(arm.joints[k])) for k in (1, 4)]
    held += [(JointRows(arm.joints[i]), JointRows(arm.joints[k])) for i, k in ((0, 4), (1, 2), (2, 4))]
    return [CoordinatePair(arm.tip, (a, b, *others), f"{arm.tip} | {a}, {b}; {found.body} free") for a, b in held]


def _self_motion(found: Parts) -> Made:
    arm = found.arms[0]
    return [
        CoordinatePair(one, (arm.tip, *_others(found, arm)), f"{one} | {arm.tip}") for one in _redundant(arm)
    ] or NOT_REDUNDANT


def _intermediate(found: Parts) -> Made:
    arm = found.arms[0]
    assert arm.middle is not None
    task = arm.middle
    if len(task.translation) > arm.before_middle:
        # Two joints or fewer cannot lead a point in the plane: what they can is one of its coordinates
        task = arm.components()[1]
    # Three joints whose axes meet lead a point over a sphere; the turn about the line to it is the pitch plane's
    plane = () if arm.alpha is None else (arm.alpha,)
    held = ", ".join(("joints beyond", *map(str, plane)))
    return [CoordinatePair(task, (*plane, *arm.locks(arm.before_middle), *_others(found, arm)), f"{task} | {held}")]


def _position(found: Parts) -> Made:
    arm = found.arms[0]
    if not arm.tip.rotation:
        if not arm.redundancy:
            return NOT_REDUNDANT
        return _end_effector(found)
    point = BodyRows(arm.tip.frame, rotation=(), name=f"{arm.prefix}tip")
    wrist = arm.locks(4)
    return [
        CoordinatePair(point, (one, *wrist, *_others(found, arm)), f"{point} | {one}, wrist")
        for one in (arm.alpha, JointRows(arm.joints[0]))
        if one is not None
    ]


def _joints(found: Parts) -> Made:
    every = [lock for arm in found.everything for lock in arm.locks()]
    every += [] if found.body is None else [JointRows(found.body)]
    return [CoordinatePair(one, [o for o in every if o is not one], f"{one} | other joints") for one in every]


def _hands(found: Parts) -> tuple[Coordinate, ...]:
    """Both hands held by their poses, and the pitch planes of their arms."""
    return tuple(one for arm in found.arms for one in (arm.tip, arm.alpha) if one is not None)


def _two_arms(found: Parts) -> Made:
    if len(found.arms) < 2 or found.body is None:
        return "second arm"
    body = JointRows(found.body)
    out = []
    for arm in found.arms:
        assert arm.alpha is not None
        out.append(CoordinatePair(arm.tip, (arm.alpha, *_others(found, arm)), f"{arm.tip} | the rest"))
    carrier = () if found.carrier is None else found.carrier.locks()
    out.append(CoordinatePair(body, (*_hands(found), *carrier), f"{body} | hands"))
    locked = tuple(lock for arm in found.arms for lock in arm.locks())
    out.append(CoordinatePair(body, (*locked, *carrier), f"{body} | arms"))
    return out


def _carried(found: Parts) -> Made:
    carrier = found.carrier
    if carrier is None or found.body is None:
        return "carrier"
    assert carrier.alpha is not None
    held = (*_hands(found), JointRows(found.body), carrier.alpha)
    return [CoordinatePair(carrier.tip, held, f"{carrier.tip} | hands")]


def _over_determined(found: Parts) -> Made:
    arm = found.arms[0]
    if arm.middle is None:
        return "point between base and tip"
    if not arm.redundancy:
        return [CoordinatePair(arm.tip, arm.locks(1)[:1], f"{arm.tip} | {arm.joints[1]}")]
    return [CoordinatePair(arm.middle, (arm.tip, *_others(found, arm)), f"{arm.middle} | {arm.tip}")]


_MAKERS: dict[Mode, Callable[[Parts], Made]] = {
    Mode.M1: _end_effector,
    Mode.M2: _self_motion,
    Mode.M3: _intermediate,
    Mode.M4: _position,
    Mode.M5: _joints,
    Mode.M6: _two_arms,
    Mode.M7: _carried,
    Mode.M8: _over_determined,
}


def table_text(table: Mapping[str, Mapping[Mode, tuple[CoordinatePair, ...] | str]]) -> str:
    """The table robot by mode as Markdown: the number of pairs, or what is missing."""
    lines = ["| robot | " + " | ".join(mode.name for mode in Mode) + " |", "|---" * (len(Mode) + 1) + "|"]
    for robot, row in table.items():
        cells = [f"no {found}" if isinstance(found, str) else str(len(found)) for found in row.values()]
        lines.append(f"| {robot} | " + " | ".join(cells) + " |")
    return "\n".join(lines)
