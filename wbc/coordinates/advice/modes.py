"""Modes in which operators command an arm, as pairs of coordinates.

| mode | commanded | held |
|---|---|---|
| M1 | tip of the first arm | scalar constraints, as many as there are joints beyond those that the tip takes |
| M2 | one of those constraints: self-motion | the tip, and the others |
| M3 | a point on the way to the tip, as far as it can go | joints beyond it, pitch plane |
| M4 | position of the tip | joints of the wrist, and a scalar constraint where one is left |
| M5 | one joint, or the body joint | all other joints |
| M6 | body joint, or one arm | both hands by their poses; or the other arm and the body by locks |
| M7 | tip of the carrier | both hands, fixed in space |
| M8 | the point on the way, in the least-squares sense | the tip: more rows than joints |

Joints of no arm have brakes in every mode.

Source: E. Dupuis, PhD thesis, McGill University, 2001, chapter 4, eqs. 4.12 to 4.28, 4.43, 4.44 and 4.48.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from enum import StrEnum
from typing import TypeAlias

from wbc import validation
from wbc.analysis.rows import BodyRows, JointRows
from wbc.coordinates.arms.arm_parts import Arm, Held, MissingPartError, Parts
from wbc.coordinates.arms.which_parts import parts
from wbc.coordinates.pair import CoordinatePair
from wbc.coordinates.rows import Coordinate
from wbc.errors import ShapeError
from wbc.robot import Robot
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
NO_MIDDLE = "point between base and tip that joints move"


def mode(name: str | Mode) -> Mode:
    """A mode by its short name or what it is called.

    Raises:
        UnknownNameError: no such mode.
    """
    if isinstance(name, Mode):
        return name
    by_name = SHORT | {m.value: m for m in Mode}
    return by_name[validation.one_of("mode", name, by_name)]


def mode_pairs(robot: str | Robot, wanted: str | Mode) -> tuple[CoordinatePair, ...]:
    """The pairs of a mode on a robot; the frames they need are those of the robot in :func:`wbc.coordinates.parts`.

    Args:
        robot: what :func:`wbc.robots.load` takes by name or file, or a robot.

    Raises:
        UnknownNameError: no such robot or mode. MissingPartError: the robot has no rows for it; the error says what
            is missing.
    """
    chosen = mode(wanted)
    found = parts(robot)
    pairs = _MAKERS[chosen](found)
    if isinstance(pairs, str):
        name = robot if isinstance(robot, str) else robot.name
        has = [f"{one.name} {one.value}" for one, made in _made(found).items() if not isinstance(made, str)]
        raise MissingPartError.of("mode", f"{chosen.name} on {name}", pairs, has)
    return tuple(pairs)


def mode_row(robot: str | Robot) -> dict[Mode, tuple[CoordinatePair, ...] | str]:
    """Mode -> the pairs of a robot, or the part that is missing.

    Raises:
        UnknownNameError, MissingPartError: no such robot; one that has no arm at all.
    """
    return _made(parts(robot))


def _made(found: Parts) -> dict[Mode, tuple[CoordinatePair, ...] | str]:
    made = {one: _MAKERS[one](found) for one in Mode}
    return {one: pairs if isinstance(pairs, str) else tuple(pairs) for one, pairs in made.items()}


def modes_of(robot: str | Robot, wanted: Iterable[str | Mode]) -> tuple[Mode, ...]:
    """Those of some modes that a robot has rows for.

    Raises:
        UnknownNameError: no such robot or mode. MissingPartError: the robot has none of them.
    """
    row, chosen = mode_row(robot), [mode(one) for one in validation.items("wanted", wanted, "modes")]
    if not chosen:
        raise ShapeError("wanted", wanted, "expected one mode or several")
    found = tuple(one for one in chosen if not isinstance(row[one], str))
    if not found:
        mode_pairs(robot, chosen[0])
    return found


def mode_table() -> dict[str, dict[Mode, tuple[CoordinatePair, ...] | str]]:
    """Robot -> mode -> its pairs, or the part that is missing, for the arms of the published studies."""
    return {robot: mode_row(robot) for robot in OPERATOR_ARMS}


def _others(found: Parts, arm: Arm) -> Held:
    """Brakes on everything but one arm."""
    body = () if found.body is None else (JointRows(found.body),)
    return (*(lock for other in found.everything if other is not arm for lock in other.locks()), *body, *found.brakes())


def _text(held: Iterable[Coordinate]) -> str:
    return ", ".join(map(str, held)) or "nothing"


def _end_effector(found: Parts) -> Made:
    arm = found.arms[0]
    pairs = [CoordinatePair(arm.tip, (*held, *_others(found, arm)), f"{arm.tip} | {_text(held)}") for held in arm.sets]
    others = tuple(lock for other in found.arms if other is not arm for lock in other.locks())
    return pairs + [
        CoordinatePair(arm.tip, (*held, *others), f"{arm.tip} | {_text(held)}; {found.body} free")
        for held in found.free_body
    ]


def _self_motion(found: Parts) -> Made:
    arm, out = found.arms[0], []
    if not arm.redundancy:
        return NOT_REDUNDANT
    for one in arm.candidates():
        rest = next(tuple(other for other in held if other != one) for held in arm.sets if one in held)
        text = ", ".join(map(str, (arm.tip, *rest)))
        out.append(CoordinatePair(one, (arm.tip, *rest, *_others(found, arm)), f"{one} | {text}"))
    return out


def _intermediate(found: Parts) -> Made:
    arm = found.arms[0]
    task = arm.middle
    if task is None:
        return NO_MIDDLE
    held = ", ".join(("joints beyond", *map(str, arm.with_middle)))
    rows = (*arm.with_middle, *arm.locks(arm.before_middle), *_others(found, arm))
    return [CoordinatePair(task, rows, f"{task} | {held}")]


def _position(found: Parts) -> Made:
    arm = found.arms[0]
    if not arm.tip.rotation:
        return _end_effector(found)
    if not arm.tip.translation:
        return "tip whose position moves"
    if not arm.position_sets:
        return "set of coordinates that leaves the tip's position free"
    point = BodyRows(arm.tip.frame, rotation=(), name=f"{arm.prefix}tip")
    wrist = {str(lock) for lock in arm.locks(min(4, len(arm.joints) - 3))}
    out = []
    for held in arm.position_sets:
        names = [str(one) for one in held if str(one) not in wrist]
        whole = wrist <= {str(one) for one in held}
        text = ", ".join([*names, "wrist"] if whole else map(str, held))
        out.append(CoordinatePair(point, (*held, *_others(found, arm)), f"{point} | {text}"))
    return out


def _joints(found: Parts) -> Made:
    every = [lock for arm in found.everything for lock in arm.locks()]
    every += [] if found.body is None else [JointRows(found.body)]
    held = found.brakes()
    return [CoordinatePair(o, [*(x for x in every if x is not o), *held], f"{o} | other joints") for o in every]


def _hands(found: Parts) -> Held:
    """Both hands held by their poses, and what takes up the redundancy of their arms."""
    return tuple(one for arm in found.arms for one in (arm.tip, *arm.sets[0]))


def _two_arms(found: Parts) -> Made:
    if len(found.arms) < 2:
        return "second arm"
    out = [CoordinatePair(arm.tip, (*arm.sets[0], *_others(found, arm)), f"{arm.tip} | the rest") for arm in found.arms]
    if found.body is not None:
        body, carrier = JointRows(found.body), () if found.carrier is None else found.carrier.locks()
        locked = tuple(lock for arm in found.arms for lock in arm.locks())
        rest = (*carrier, *found.brakes())
        out.append(CoordinatePair(body, (*_hands(found), *rest), f"{body} | hands"))
        out.append(CoordinatePair(body, (*locked, *rest), f"{body} | arms"))
    return out


def _carried(found: Parts) -> Made:
    carrier = found.carrier
    if carrier is None:
        return "carrier"
    body = () if found.body is None else (JointRows(found.body),)
    held = (*_hands(found), *body, *carrier.sets[0], *found.brakes())
    return [CoordinatePair(carrier.tip, held, f"{carrier.tip} | hands")]


def _over_determined(found: Parts) -> Made:
    arm = found.arms[0]
    if not arm.redundancy:
        if len(arm.joints) < 2:
            return "second joint"
        return [CoordinatePair(arm.tip, (*arm.locks(1)[:1], *_others(found, arm)), f"{arm.tip} | {arm.joints[1]}")]
    if arm.middle is None:
        return NO_MIDDLE
    if arm.with_both is None:
        return "point between base and tip that self-motion moves, with more rows than joints to spare"
    held = (arm.tip, *arm.with_both)
    return [CoordinatePair(arm.middle, (*held, *_others(found, arm)), f"{arm.middle} | {_text(held)}")]


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


def restriction_table(robot: str, mode: str | Mode = Mode.M1) -> str:
    """Markdown table of a mode's pairs with the conditions under which the determinant of each vanishes, exactly.

    Pairs without a closed form of use are left out. Joints are counted from 1; c34 is cos(q3 + q4). Some seconds.

    Raises:
        UnknownNameError, MissingPartError: see :func:`mode_pairs`.
    """
    # Imported here: the modes themselves need no exact algebra
    from wbc.coordinates.advice.determinant_places import closed_form

    machine = parts(robot).robot
    lines = ["| task and constraint | not where |", "|---|---|"]
    for pair in mode_pairs(robot, mode):
        found = closed_form(machine, pair)
        if found is not None:
            name = pair.name.replace(" | ", "; ")
            lines.append(f"| {name} | {', '.join(found.lines) or 'nowhere'} |")
    return "\n".join(lines)
