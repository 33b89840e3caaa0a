"""What differs from mode to mode of a walk; :mod:`wbc.walking.run.session` has what is the same."""

from __future__ import annotations

import gc
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

from wbc.multibody import pin
from wbc.robots import Walker
from wbc.simulation import Plant
from wbc.track.summary import Figure
from wbc.validation import Array
from wbc.walking.body_path import BodyPath
from wbc.walking.holds.structure import Structure
from wbc.walking.log.log import WalkLog
from wbc.walking.log.recorder import versions
from wbc.walking.log.ticks import TickColumns
from wbc.walking.loop.body_command import pose_function
from wbc.walking.loop.closed_chain import chain_function
from wbc.walking.loop.hand_command import aim_function
from wbc.walking.loop.stack import WalkStack
from wbc.walking.loop.walk import ARRIVED, Walk
from wbc.walking.native import compiled
from wbc.walking.planner.plan import Plan
from wbc.walking.run.carrying_out import Outcome, Progress
from wbc.walking.run.recording import Before, WalkRecorder
from wbc.walking.run.records import record_of
from wbc.walking.run.request import Request

Asked = TypeVar("Asked", bound=Request)
#: A body that is turned by less has arrived, as one that is off by less than :data:`ARRIVED` [rad]
TURNED = 0.01


class Ending(NamedTuple):
    """How a mode ended, and why, "" where all is well."""

    outcome: Outcome
    reason: str


@dataclass(frozen=True, eq=False)
class Result:
    """What is left of a walk: the plan and the log that its folder gets, and figures for its summary.

    Attributes:
        plan: None: the one that it began with.
    """

    plan: Plan | None
    log: WalkLog
    ticks: TickColumns
    figures: tuple[Figure, ...]


class Mode(ABC, Generic[Asked]):
    """A request and the machine that does it; what is wrong with either shows when it is made.

    Attributes:
        structure: the holds that there are. path: where the body is to be, as far as that is known before the plan.
    """

    request: Asked
    structure: Structure
    path: BodyPath

    def __init__(self, walker: Walker) -> None:
        self.walker = walker

    @abstractmethod
    def plan(self) -> Plan:
        """What to begin with.

        Raises:
            NoPlanError: there is none.
        """

    @abstractmethod
    def carry_out(
        self, walk: Walk, recorder: WalkRecorder, report: Progress, stop: Callable[[], bool] | None
    ) -> Ending:
        """Ticks until the mode is over."""

    @abstractmethod
    def figures(self, log: WalkLog | None) -> tuple[Figure, ...]:
        """For the summary, of a walk that was carried out; None: without a tick."""

    def remarks(self) -> tuple[Figure, ...]:
        """What the summary says of the request, whatever comes of it."""
        return ()

    def compiled(self, backend: str) -> WalkStack:
        """The stack that the walk needs."""
        return compiled_stack(self.walker, self.structure, backend)

    def walk(self, plan: Plan, stack: WalkStack, plant: Plant | None) -> Walk:
        """The walk, not begun."""
        return Walk(self.walker, self.structure, plan, stack=stack, plant=plant)

    def asked(self) -> dict[str, Any]:
        """What was asked for, as plain data."""
        return record_of(self.request)

    def before(self) -> Before | None:
        """What the log begins with; None: it is empty."""
        return None

    def meta(self, plan: Plan) -> dict[str, Any]:
        """More plain data for the log."""
        return {"start": list(plan.start)}

    def missed(self, walk: Walk) -> str:
        """Why a walk that is over is not where it was to be, "" where it is."""
        return ""

    def result(self, walk: Walk, log: WalkLog, ticks: TickColumns) -> Result:
        """What is left of a walk that was carried out."""
        return Result(None, log, ticks, self.figures(log))


def off_goal(walk: Walk, goal: Array) -> str:
    """How far a body is from the pose where it was to end ``[4, 4]``, or which hands do not hold; "" if all is well."""
    body = pin.XYZQUATToSE3(walk.q[:7])
    away = float(np.linalg.norm(body.translation - goal[:3, 3]))
    turned = float(np.linalg.norm(pin.log3(body.rotation.T @ goal[:3, :3])))
    if away > ARRIVED or turned > TURNED:
        return f"the body is {1e3 * away:.1f} mm and {np.degrees(turned):.2f} deg from where it was to go"
    return loose_hands(walk)


def loose_hands(walk: Walk) -> str:
    """Which hands do not hold; "" if all do."""
    loose = [arm.name for k, arm in enumerate(walk.walker.arms) if k not in walk.held]
    return f"{', '.join(loose)} {'do' if len(loose) > 1 else 'does'} not hold" if loose else ""


def compiled_stack(
    walker: Walker, structure: Structure, backend: str = "auto", *, collisions: bool = False
) -> WalkStack:
    """A stack; the expressions of the loop and the planner's code are loaded then, too.

    Args:
        collisions, backend: as of :class:`WalkStack`.
    """
    stack = WalkStack(walker, structure, collisions=collisions, backend=backend)
    chain_function(walker)
    pose_function()
    aim_function()
    compiled.library()
    versions()
    return stack


def keep() -> None:
    """Say that all that is there now is there to stay: the garbage collector leaves it alone.

    For a program of its own (a command, a benchmark), once what it needs is loaded. A full collection looks at every
    object, which with the modules of a walk takes some 80 ms in the middle of a plan or a tick, and finds nothing.
    """
    gc.collect()
    gc.freeze()
