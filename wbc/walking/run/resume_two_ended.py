"""Going on with a run of the two-ended arm from any state of its log."""

from __future__ import annotations

import pathlib
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from wbc.errors import RangeError, ShapeError
from wbc.multibody import pin
from wbc.robots import Walker
from wbc.simulation import Plant
from wbc.track.summary import Figure
from wbc.walking.holds.files import read_structure
from wbc.walking.log.folder import STRUCTURE
from wbc.walking.log.log import CLOSED, CLOSING, OPEN, WalkLog, load_columns
from wbc.walking.log.ticks import TickColumns
from wbc.walking.loop.stack import WalkStack
from wbc.walking.loop.walk import Walk
from wbc.walking.planner.grips.rolls import frame_on
from wbc.walking.planner.plan import NoPlanError, Plan
from wbc.walking.run.mode import Result
from wbc.walking.run.path_mode import TwoEndedMode
from wbc.walking.run.recording import Before, as_walked
from wbc.walking.run.records import request_of
from wbc.walking.run.request import ResumeRequest, TwoEndedRequest
from wbc.walking.run.resume_mode import RESUME, resumed_state, row_at
from wbc.walking.two_ended import TwoEndedPlan, TwoEndedStack, TwoEndedWalk, plan_two_ended
from wbc.walking.two_ended.planner import plan_from_air
from wbc.walking.two_ended.postures import Grip, from_hand_to_hand
from wbc.walking.two_ended.swing_path import TurnLaw

#: Joints that are farther from a swing are not on it [rad]
SAME = 5e-4


class TwoEndedResumeMode(TwoEndedMode):
    """Reads a run's folder, and goes on with it as fast as it was going: a hand in the air on its way, and then to the
    goal.

    Raises:
        WalkLogError: no log of a walk. RangeError: a time that it does not have, another robot, or a state that is not
            legal.
    """

    def __init__(self, resume: ResumeRequest, walker: Walker) -> None:
        self._resume, self._folder = resume, pathlib.Path(resume.folder)
        columns = load_columns(self._folder)
        self._old, self._ticks = WalkLog.of(columns), TickColumns.of(columns)
        request = request_of(self._old.meta.get("request"))
        if not isinstance(request, TwoEndedRequest) or not walker.two_ended:
            raise RangeError("resume", str(self._folder), "the run is of another machine")
        if walker.data.digest != self._old.meta["robot_digest"]:
            raise RangeError("resume", self._old.meta["robot_digest"], "the run has another robot; use the same --set")
        if resume.points:
            request = replace(request, gait="any").to(resume.points)
        super().__init__(request, walker)
        self.structure = read_structure(self._folder / STRUCTURE)
        self._row = row = row_at(self._old, resume.at)
        here = self._old.present(np.arange(len(self._old.hold_id)), float(self._old.t[row]))
        gone = [name for name, there in zip(self._old.hold_id, here, strict=True) if not there]
        self._there = self.structure.without(gone)
        self._state = resumed_state(self._old, row, walker, self._there)

    def plan(self) -> TwoEndedPlan:
        """From the stance that the arm had last, beginning with the swing that it is in; where it is on none from hold
        to hold, it comes to rest, and its hand goes to another one.
        """
        start, request = dict[str, str](), self.request
        for arm, name in enumerate(self._old.arms):
            closed = np.flatnonzero(self._old.hand_state[: self._row + 1, arm] == CLOSED)
            start[name] = self._old.hold_id[self._old.hand_hold[closed[-1], arm]]
        self._arm, target = self._swing()
        grips = [self._grip(arm) for arm in range(len(start))]
        near, far = (None if grip is None else grip.roll for grip in grips)

        def to(goal: Any, gait: str) -> TwoEndedPlan:
            return plan_two_ended(self.walker, self._there, start, goal, gait=gait, rolls=(near, far))

        if self._arm is None:
            return to(request.goal, request.gait)
        # The way to the goal may begin otherwise from here: then first to where the hand is on its way
        ways = [(request.goal, request.gait), *([(target, "any")] if target else [])]
        for goal, gait in ways if set(start.values()) <= set(self._there.ids) else []:
            with suppress(NoPlanError):
                plan = to(goal, gait)
                if self._goes_on(plan, target) and (goal == request.goal or len(plan.regrasps) == 1):
                    return plan
        held, free = grips[1 - self._arm], self._old.arms[self._arm]
        assert held is not None
        arms, q, v = self.walker.arms, self._state.q, self._state.v
        joints = from_hand_to_hand(*(q[one.q] for one in arms))
        # A hand that opens does not move before its latch is through
        rates = None if v is None or self._state.opening is not None else from_hand_to_hand(*(v[one.v] for one in arms))
        more: dict[str, Any] = {"gait": request.gait, "left": start[free], "rates": rates}
        return plan_from_air(self.walker, self._there, (1 - self._arm, held), joints, request.goal, **more)

    def _grip(self, arm: int) -> Grip | None:
        """That a hand holds by, at the roll nearest to how it is turned; None: it does not hold."""
        hold, robot = self._state.held.get(arm), self.walker.robot
        if hold is None:
            return None
        data = robot.model.createData()
        pin.framesForwardKinematics(robot.model, data, self._state.q)
        x = data.oMf[robot.model.getFrameId(self.walker.arms[arm].hand)].rotation[:, 0]
        rolls = range(len(self._there.holds[hold].rolls))
        return Grip(hold, max(rolls, key=lambda roll: float(frame_on(self._there, hold, roll)[:3, 0] @ x)))

    def _goes_on(self, plan: TwoEndedPlan, target: str) -> bool:
        """Whether a plan begins with the swing that the arm is in, to a hold; "": to any."""
        if self._arm is None or not plan.regrasps:
            return False
        arm, step, law = self.walker.arms[self._arm], plan.regrasps[0], plan.laws[0]
        assert isinstance(law, TurnLaw)
        return step.arm == arm.name and target in ("", step.target) and law.off(self._state.q[arm.q]) < SAME

    def _swing(self) -> tuple[int | None, str]:
        """The arm whose hand is in the air or opens, None for none, and the hold that it goes to, "" where none is."""
        states, holds = self._old.hand_state[self._row], self._old.hand_hold[self._row]
        for arm, state in enumerate(states.tolist()):
            if arm not in self._state.held:
                there = state in (OPEN, CLOSING) and holds[arm] >= 0
                return arm, self._old.hold_id[holds[arm]] if there else ""
        return None, ""

    def walk(self, plan: Plan, stack: WalkStack, plant: Plant | None) -> TwoEndedWalk:
        """From the state of the log."""
        if not isinstance(plan, TwoEndedPlan) or not isinstance(stack, TwoEndedStack):
            raise ShapeError("stack", stack, "expected a TwoEndedStack")
        walk = TwoEndedWalk(self.walker, self._there, plan, stack=stack, plant=plant, state=self._state)
        walk.go_on(self._arm, self._state)
        goal = self.request.goal
        if plan.to != goal:
            walk.go_to(goal, self.request.gait)
        return walk

    def asked(self) -> dict[str, Any]:
        """The run that goes on, by its whole path, and from when."""
        resume = self._resume
        folder = str(self._folder.resolve())
        return {"kind": RESUME, "folder": folder, "at": resume.at, "points": list(resume.points)}

    def before(self) -> Before:
        """What was walked until it goes on."""
        return Before(self._old, self._ticks, self._row, self.structure)

    def meta(self, plan: Plan) -> dict[str, Any]:
        """What the old log has, and when it was gone on with."""
        old = self._old.meta
        return {**old, "resumed": [*old.get("resumed", []), self._state.time]}

    def figures(self, log: WalkLog | None) -> tuple[Figure, ...]:
        """From where it went on, and how far things go after an abort."""
        value = {"from": str(self._folder), "at": self._state.time}
        resumed = Figure("resumed", "resumed", value, f"{self._folder} at {self._state.time:.2f} s")
        return (resumed, *super().figures(log))

    def result(self, walk: Walk, log: WalkLog, ticks: TickColumns) -> Result:
        """The log of the run up to then and of the new walk; the plan is what was done."""
        plan, ticks = as_walked(log, ticks, walk.progress.steps)
        return Result(plan, log, ticks, self.figures(log))
