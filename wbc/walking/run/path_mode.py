"""A plan of a body with arms along a path is carried out from its beginning to its end."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from wbc.errors import WbcError
from wbc.robots import Walker
from wbc.simulation import Plant
from wbc.track.summary import Figure
from wbc.walking.holds.surface import CylinderSurface
from wbc.walking.log.body_paths import way_of
from wbc.walking.log.log import WalkLog
from wbc.walking.loop.stack import WalkStack
from wbc.walking.loop.state import State
from wbc.walking.loop.walk import PATIENCE, SLACK, Walk
from wbc.walking.modes.first_grasps import free_state, plan_from_state
from wbc.walking.modes.veto import Veto
from wbc.walking.planner.follow import follow_plan
from wbc.walking.planner.plan import Plan, Regrasp, read_plan
from wbc.walking.planner.planner import plan_walk
from wbc.walking.run.carrying_out import CarryingOut, Progress
from wbc.walking.run.mode import Asked, Ending, Mode, off_goal
from wbc.walking.run.plausible import ground
from wbc.walking.run.recording import WalkRecorder
from wbc.walking.run.request import PathRequest

#: (the next re-grasp, why the last answer was refused or "") -> "" for yes, another hold, or None: nobody answers
Ask = Callable[[Regrasp, str], str | None]
#: A path that goes round a cylinder by less goes along it, and there is nothing to say [deg]
ROUND = 30.0


class PlannedMode(Mode[Asked]):
    """Ticks until a plan is carried out.

    Args:
        ask: proposes every re-grasp; None: nobody is asked.
    """

    def __init__(self, walker: Walker, ask: Ask | None = None) -> None:
        super().__init__(walker)
        self._ask = ask
        self._figures: tuple[Figure, ...] = ()

    def carry_out(
        self, walk: Walk, recorder: WalkRecorder, report: Progress, stop: Callable[[], bool] | None
    ) -> Ending:
        """Until the walk is done, or takes too long."""
        duration, doing = walk.plan.path.duration, CarryingOut(walk, recorder, progress=report, stop=stop)
        veto, late = None if self._ask is None else Veto(walk), walk.time + PATIENCE * duration + SLACK
        ending = Ending("arrived", "")
        while not walk.done:
            if veto is not None and self._ask is not None and veto.proposal is not None:
                recorder.write()  # an answer may take long
                declined = _declined(veto, self._ask)
                if declined:
                    doing.abort("interrupted" if stop is not None and stop() else "declined", declined)
                    ending = Ending(doing.outcome or "declined", doing.reason)
                    break
            if walk.time > late:
                reason = f"not there after {walk.time:.0f} s, the path takes {duration:.0f} s"
                ending = Ending("late", reason)
                break
            if not doing.step(walk.path_time / duration):
                ending = Ending(doing.outcome or "interrupted", doing.reason)
                break
        self._figures = doing.summary()
        return ending

    def figures(self, log: WalkLog | None) -> tuple[Figure, ...]:
        """How far things go after an abort."""
        return self._figures


class PathMode(PlannedMode[PathRequest]):
    """A body with arms goes over places.

    Raises:
        ShapeError: another machine. What the request's methods, ``read_plan`` and ``structure.index`` raise.
    """

    def __init__(self, request: PathRequest, walker: Walker, ask: Ask | None = None) -> None:
        super().__init__(walker, ask)
        data = walker.arm_data
        self.request, self.structure = request, ground(request.site, walker)
        self._given = read_plan(request.plan) if request.plan else None
        for step in () if self._given is None else self._given.regrasps:
            self.structure.index(step.target)
        self.path = request.path(data) if self._given is None else self._given.path
        self._state: State | None = None

    def plan(self) -> Plan:
        """The file's, one from nothing held, or the planner's."""
        if self.request.free_start:
            self._state = free_state(self.walker, self.path.poses[0])
            return plan_from_state(self.walker, self.structure, self.path, self._state)
        if self._given is not None:
            return follow_plan(self.walker, self.structure, self._given)
        objective = self.request.objective
        return plan_walk(self.walker, self.structure, self.path, objective=objective, partial=True, detour=True)

    def remarks(self) -> tuple[Figure, ...]:
        """How far a path from hold to hold goes round a cylinder, which it does by the shorter way."""
        surface, request = self.structure.surface, self.request
        names = [place for place in (request.start, *request.points) if isinstance(place, str)]
        if self._given is not None or not names or not isinstance(surface, CylinderSurface):
            return ()
        whole = request.site.whole()
        places = (whole[name].position - surface.pose.translation for name in names)
        angles = np.array([np.arctan2(y, x) for x, y, _ in (surface.pose.rotation.T @ place for place in places)])
        turns = np.degrees((np.diff(angles) + np.pi) % (2 * np.pi) - np.pi)
        if (np.abs(turns) < ROUND).all():
            return ()
        text = ", ".join(f"{abs(turn):.0f} deg, the other way would be {360 - abs(turn):.0f} deg" for turn in turns)
        return (Figure("round", "round the cylinder", np.radians(turns).tolist(), f"the short way: {text}"),)

    def walk(self, plan: Plan, stack: WalkStack, plant: Plant | None) -> Walk:
        """On the plan's holds, or with nothing held."""
        return Walk(self.walker, self.structure, plan, stack=stack, state=self._state, plant=plant)

    def missed(self, walk: Walk) -> str:
        """Where the path that was asked for ends, whatever path was found."""
        return off_goal(walk, self.path.poses[-1])

    def meta(self, plan: Plan) -> dict[str, Any]:
        """A detour that was found, or the path of a file, goes with the log, so that the walk can be resumed on it."""
        way = {} if plan.path is self.path and self._given is None else {"way": way_of(plan.path)}
        return {**super().meta(plan), **way}


def _declined(veto: Veto, ask: Ask) -> str:
    """Answers to the proposal, until one is possible; why the walk is to stop, "" where it goes on."""
    refused = ""
    while (step := veto.proposal) is not None:
        answer = ask(step, refused)
        if answer is None:
            return f"nobody said yes to {step.arm} from {step.source} to {step.target}"
        if not answer:
            veto.accept()
            return ""
        try:
            veto.choose(answer)
        except WbcError as error:
            refused = str(error)
    return ""
