"""What differs from mode to mode of a walk; :mod:`wbc.walking.run.session` has what is the same."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, NamedTuple, TypeVar

from wbc.robots import Walker
from wbc.simulation import Plant
from wbc.track.summary import Figure
from wbc.walking.body_path import BodyPath
from wbc.walking.holds.structure import Structure
from wbc.walking.log.log import WalkLog
from wbc.walking.loop.stack import WalkStack
from wbc.walking.loop.walk import Walk
from wbc.walking.planner.plan import Plan
from wbc.walking.run.carrying_out import Outcome, Progress
from wbc.walking.run.compiling import compiled_stack
from wbc.walking.run.recording import TickColumns, WalkRecorder
from wbc.walking.run.request import Request

Asked = TypeVar("Asked", bound=Request)


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

    def compiled(self, backend: str) -> WalkStack:
        """The stack that the walk needs."""
        return compiled_stack(self.walker, self.structure, backend)

    def walk(self, plan: Plan, stack: WalkStack, plant: Plant | None) -> Walk:
        """The walk, not begun."""
        return Walk(self.walker, self.structure, plan, stack=stack, plant=plant)

    def meta(self, plan: Plan) -> dict[str, Any]:
        """More plain data for the log."""
        return {"start": list(plan.start)}

    def result(self, walk: Walk, log: WalkLog, ticks: TickColumns) -> Result:
        """What is left of a walk that was carried out."""
        return Result(None, log, ticks, self.figures(log))
