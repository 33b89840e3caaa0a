"""Plans: which hand is moved to which hold, where on the body's path; as objects and as files."""

from __future__ import annotations

import json
import os
import pathlib
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field, replace
from math import isfinite
from typing import Any

from wbc import validation
from wbc.errors import StructureFileError, WbcError
from wbc.walking.body_path import BodyPath
from wbc.walking.log.body_paths import path_of, way_of
from wbc.walking.planner.grips.table import RATE, Grips
from wbc.walking.planner.swings.law import SwingLaw


class NoPlanError(WbcError):
    """No sequence of re-grasps leads to the end of the path; the message says where it ends, which holds and why.

    Attributes:
        separating: ids of the holds at which the path ends; empty where no arm reaches any.
    """

    def __init__(
        self, field: str, value: Any, reason: str, choices: Iterable[str] = (), *, separating: Iterable[str] = ()
    ) -> None:
        super().__init__(field, value, reason, tuple(choices))
        self.separating = tuple(separating)


class HoldLost(WbcError):
    """Fewer hands hold than the robot needs."""


@dataclass(frozen=True)
class Regrasp:
    """One swing of a plan.

    Attributes:
        arm: name. source, target: ids of holds.
        branch: of the wrist on the target, 0: theta5 >= 0, 1: theta5 < 0.
        lift, land: path time u of the body [s].
        duration: of the swing, latches and settling included [s].
        delay: by which the body is late after it [s].
        margin: path time that the source could still have held at the lift [s].
        limit: what ends the grip on the target.
        until: path time until which the target can be held [s].
        curve: number of the hand's curve, see :data:`wbc.walking.planner.swings.curve.ALTERNATIVES`.
        roll: angle about the target's z axis from its x axis to the hand's [rad]; None where the hand may roll.
    """

    arm: str
    source: str
    target: str
    branch: int
    lift: float
    land: float
    duration: float
    delay: float
    margin: float
    limit: str
    until: float
    curve: int = 0
    roll: float | None = None


@dataclass(frozen=True, eq=False)
class Plan:
    """A walk along a body path.

    Attributes:
        path: of the body. start: hold id an arm, in the order of arms. regrasps: in the order of time.
        complete: it leads to the end of the path. reached: path time that it leads to [s].
        reason: why it is not complete; "" if it is.
        grips, chain: the table of grips, and for each arm the grips that it uses, first that of the start; for the
            controller, not in files.
        separating: ids of the holds at which it ends if it is not complete.
        laws: of the swings, one a re-grasp; for the controller, not in files.
        limits: what ends the grips at which it ends if it is not complete, as of :attr:`Grips.reasons`; not in files.
        note: why the path is slower than was asked for; "" where it is not; not in files.
    """

    path: BodyPath
    start: tuple[str, ...]
    regrasps: tuple[Regrasp, ...]
    complete: bool
    reached: float
    reason: str = ""
    grips: Grips | None = field(default=None, repr=False)
    chain: tuple[tuple[int, ...], ...] = field(default=(), repr=False)
    separating: tuple[str, ...] = ()
    laws: tuple[SwingLaw, ...] = field(default=(), repr=False)
    limits: tuple[str, ...] = ()
    note: str = ""

    @property
    def too_slow(self) -> str:
        """The first joint whose rate ends a grip at which the plan ends, where nothing else does; else ""."""
        slow = [limit.removesuffix(RATE) for limit in self.limits if limit.endswith(RATE)]
        return slow[0] if slow and len(slow) == len(self.limits) else ""

    @property
    def delay(self) -> float:
        """By which the body is late at the end [s]."""
        return sum(step.delay for step in self.regrasps)

    def cut(self, arms: Sequence[str], count: int, reached: float) -> Plan:
        """The plan up to its first ``count`` re-grasps and a path time [s], with the rest still to be planned.

        Args:
            arms: names in the order of :attr:`start`.
        """
        steps = self.regrasps[:count]
        used = [sum(step.arm == arm for step in steps) for arm in arms]
        chain = tuple(grips[: k + 1] for grips, k in zip(self.chain, used, strict=True))
        begun = replace(self, regrasps=steps, chain=chain, laws=self.laws[:count])
        return replace(begun, complete=False, reached=reached, reason="being planned")

    def then(self, rest: Plan) -> Plan:
        """This plan, and another one over the same grips that begins with the stance that this one ends with."""
        chain = tuple((*one, *other[1:]) for one, other in zip(self.chain, rest.chain, strict=True))
        steps, laws = (*self.regrasps, *rest.regrasps), (*self.laws, *rest.laws)
        return replace(rest, start=self.start, regrasps=steps, chain=chain, laws=laws)

    def rows(self) -> list[dict[str, Any]]:
        """One dictionary a re-grasp, as in the file."""
        return [asdict(step) for step in self.regrasps]

    def save(self, path: str | os.PathLike[str]) -> pathlib.Path:
        """Write start and re-grasps as JSON."""
        file = pathlib.Path(path)
        kept = {
            "start": list(self.start),
            "complete": self.complete,
            "reached": self.reached,
            "reason": self.reason,
            "separating": list(self.separating),
            "regrasps": self.rows(),
        }
        # The body's path on one line, behind what is to be read
        text = json.dumps(kept, indent=1).removesuffix("\n}")
        file.write_text(f'{text},\n "way": {json.dumps(way_of(self.path))}\n}}\n')
        return file


def read_plan(path: str | os.PathLike[str]) -> Plan:
    """What :meth:`Plan.save` wrote; without grips and laws, which :func:`wbc.walking.planner.follow.follow_plan` adds.

    Raises:
        StructureFileError: not such a file.
    """
    try:
        kept = json.loads(pathlib.Path(path).read_text())
        steps = tuple(_step(row) for row in kept["regrasps"])
        start, separating = tuple(map(str, kept["start"])), tuple(kept["separating"])
        whole, reached, reason = bool(kept["complete"]), float(kept["reached"]), str(kept["reason"])
        along = path_of(kept["way"])
    except FileNotFoundError as error:
        raise StructureFileError("plan", str(path), validation.no_such(path)) from error
    except (OSError, ValueError, KeyError, TypeError, WbcError) as error:
        raise StructureFileError("plan", str(path), f"not a plan: {error}") from error
    return Plan(along, start, steps, whole, reached, reason, separating=separating)


def _step(row: dict[str, Any]) -> Regrasp:
    """A re-grasp of a file.

    Raises:
        TypeError, ValueError: a field that is missing, unknown, or has a value that it cannot have.
    """
    step = Regrasp(**{"curve" if name == "way" else name: value for name, value in row.items()})
    for name, value in asdict(step).items():
        texts = name in ("arm", "source", "target", "limit")
        number = 0.0 if texts or (name == "roll" and value is None) else value
        if texts != isinstance(value, str) or not isfinite(number):
            raise ValueError(f"re-grasp {row}: {name}")
    return step


def differences(one: Plan, other: Plan) -> list[str]:
    """What two plans do differently, one line each; empty for equal plans."""
    out = [] if one.start == other.start else [f"start: {' '.join(one.start)} / {' '.join(other.start)}"]
    for k in range(max(len(one.regrasps), len(other.regrasps))):
        steps = [plan.regrasps[k] if k < len(plan.regrasps) else None for plan in (one, other)]
        shown = [f"{s.arm} {s.source} -> {s.target} at {s.lift:.2f} s" if s else "none" for s in steps]
        if steps[0] != steps[1]:
            out.append(f"re-grasp {k + 1}: {shown[0]} / {shown[1]}")
    return out
