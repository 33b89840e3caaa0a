"""Going on with a walk from any state of its log."""

from __future__ import annotations

import pathlib
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from wbc.errors import RangeError, WbcError
from wbc.multibody import pin
from wbc.robots import Walker, walker as made_walker
from wbc.simulation import Plant
from wbc.track.summary import Figure
from wbc.validation import Array
from wbc.walking.body_path import BodyPath, straight_path
from wbc.walking.holds.files import read_structure
from wbc.walking.holds.structure import Structure
from wbc.walking.log.body_paths import path_of
from wbc.walking.log.folder import BEGUN, STRUCTURE, machine_made, read_begun, walked
from wbc.walking.log.log import CLOSED, OPENING, WalkLog, WalkLogError, load_columns
from wbc.walking.log.ticks import TickColumns
from wbc.walking.loop.coasting import Coasting
from wbc.walking.loop.foresight import Foresight
from wbc.walking.loop.stack import DT, WalkStack
from wbc.walking.loop.state import Manual, State
from wbc.walking.loop.stopping import Stops
from wbc.walking.loop.walk import PATIENCE, SLACK, Walk
from wbc.walking.modes.first_grasps import plan_from_state
from wbc.walking.planner.objective import Objective
from wbc.walking.planner.plan import Plan
from wbc.walking.run.carrying_out import CarryingOut, Progress
from wbc.walking.run.mode import Ending, Mode, Result, compiled_stack, off_goal
from wbc.walking.run.places import GridPlace, Place
from wbc.walking.run.recording import Before, WalkRecorder, as_walked, configuration
from wbc.walking.run.records import request_of
from wbc.walking.run.request import PathRequest, Request, ResumeRequest

#: A body goes back along its log for so long at most [s], by straight lines over so many ticks
TRAIL, EVERY = 20.0, 25
#: Name of the mode in ``begun.json``
RESUME = "resume"


def resumed_state(log: WalkLog, row: int, walker: Walker, structure: Structure) -> State:
    """The state of a row of a log, with the hands that hold there and the velocity that it came with.

    Args:
        structure: with the holds that are there.

    Raises:
        RangeError: fewer hands hold than the body needs, and it was not declared fixed.
    """
    held, opening = dict[int, int](), None
    for arm in range(len(log.arms)):
        state, hold = int(log.hand_state[row, arm]), int(log.hand_hold[row, arm])
        if state == CLOSED and log.hold_id[hold] in structure:
            held[arm] = structure.index(log.hold_id[hold])
        elif state == OPENING and log.hold_id[hold] in structure:
            opening = arm, structure.index(log.hold_id[hold])
    if len(held) < walker.min_holds and not log.body_fixed[row]:
        raise RangeError("resume.at", float(log.t[row]), f"{len(held)} hands hold there, {walker.min_holds} must")
    v = np.zeros(walker.robot.nv)
    v[:6] = log.twist_body[row - 1]
    column = {name: k for k, name in enumerate(log.joints)}
    for limb in walker.arms:
        v[limb.v] = log.v[row - 1, [column[joint] for joint in limb.joints]]
    return State(configuration(walker, log, row), held, float(log.t[row]), opening, v)


def _let_go(state: State, arm: int, least: int) -> State:
    """A hand whose arm cannot hold on while the body comes to rest, as it was about to be lifted, opens at once.

    Args:
        least: so many hands must hold.
    """
    if len(state.held) <= least:
        return state
    others = {one: hold for one, hold in state.held.items() if one != arm}
    return replace(state, held=others, opening=(arm, state.held[arm]))


def row_at(log: WalkLog, at: float | None) -> int:
    """The row of a log at a time [s]; None: the last one.

    Raises:
        RangeError: it has no such time.
    """
    if at is None:
        return len(log) - 1
    if not log.t[1] - 1e-9 <= at <= log.t[-1] + 1e-9:  # nor is nan
        raise RangeError("resume.at", at, f"expected a time from {log.t[1]:g} to {log.t[-1]:g} s")
    return int(np.searchsorted(log.t, at + 1e-9, side="right")) - 1


def going_on(resume: ResumeRequest, seen: frozenset[pathlib.Path] = frozenset()) -> Request | ResumeRequest:
    """The request itself; of a run that was ended before it walked what it was asked to do, which is then begun.

    Raises:
        WalkLogError: there is no run. RangeError: a time of a run that did not walk.
    """
    folder = pathlib.Path(resume.folder)
    if walked(folder):
        return resume
    if resume.at is not None:
        raise RangeError("resume.at", resume.at, "the run was ended before it walked, and can only be begun again")
    begun = dict(read_begun(folder)["request"])
    if begun.get("kind") != RESUME:
        request = request_of(begun)
        return _goal(request, resume.points) if resume.points else request
    try:
        at, points = begun["at"], tuple(_place(place) for place in begun["points"])
        before = ResumeRequest(begun["folder"], at, resume.points or points)
    except (KeyError, TypeError, WbcError) as error:
        raise WalkLogError("resume", str(folder), f"{BEGUN} does not say what was gone on with: {error}") from error
    if folder.resolve() in seen:
        raise WalkLogError("resume", str(folder), "this run goes on with itself")
    return going_on(before, seen | {folder.resolve()})


def plant_walked(request: Request | ResumeRequest, folder: pathlib.Path) -> dict[str, Any]:
    """What moved in a run that is gone on with, or begun again, as plain data; empty: the kinematic plant.

    Args:
        request: of :func:`going_on`. folder: of the run that was asked for.
    """
    if not isinstance(request, ResumeRequest):
        return dict(read_begun(folder)["plant"])
    return dict(WalkLog.load(request.folder).meta.get("plant", {}))


def machine_walked(request: Request | ResumeRequest, folder: pathlib.Path) -> Walker:
    """The machine of a run that is gone on with, or begun again.

    Args:
        request: of :func:`going_on`. folder: of the run that was asked for.

    Raises:
        WalkLogError: the run does not say.
    """
    if not isinstance(request, ResumeRequest):
        return machine_made(read_begun(folder)["machine"])
    log = WalkLog.load(request.folder)
    # Logs of the version before do not say; theirs is checked by its digest
    return machine_made(log.meta["machine"]) if "machine" in log.meta else made_walker(len(log.arms))


def _place(place: Any) -> Place:
    """Of plain data."""
    return place if isinstance(place, str) else GridPlace(*place)


class ResumeMode(Mode[PathRequest]):
    """Reads a run's folder, and goes on with it.

    Raises:
        WalkLogError: no log of a walk. RangeError: a time that it does not have, another robot, a state that is not
            legal, or a run that has no goal.
    """

    def __init__(self, resume: ResumeRequest, walker: Walker) -> None:
        super().__init__(walker)
        self._resume, self._folder = resume, pathlib.Path(resume.folder)
        columns = load_columns(self._folder)
        self._old, self._ticks = WalkLog.of(columns), TickColumns.of(columns)
        old = self._old
        self.request = request = _goal(request_of(old.meta.get("request")), resume.points)
        if walker.arm_data.digest != old.meta["robot_digest"]:
            raise RangeError("resume", old.meta["robot_digest"], "the run has another robot; use the same --set")
        if len(old.arms) != len(walker.arms):
            raise RangeError("resume", len(old.arms), f"the run has another number of arms than {len(walker.arms)}")
        row = row_at(old, resume.at)
        self._row, self.structure = row, read_structure(self._folder / STRUCTURE)
        here = old.present(np.arange(len(old.hold_id)), float(old.t[row]))
        gone = [name for name, there in zip(old.hold_id, here, strict=True) if not there]
        self._there = self.structure.without(gone)
        self._state = resumed_state(old, row, walker, self._there)
        asked = resume.points or "way" not in old.meta
        whole = request.path(walker.arm_data) if asked else path_of(old.meta["way"])
        brake, sight = Stops.of(walker, DT).brake, Foresight(walker, self._there)
        coasting = Coasting.of(walker, self._there, self._state, brake, DT, sight)
        if coasting is not None and len(coasting.pulled) == 1 and not coasting.free:
            self._state = _let_go(self._state, coasting.pulled[0], walker.min_holds)
            coasting = Coasting.of(walker, self._there, self._state, brake, DT, sight)
        self._stands = self._state if coasting is None else coasting.state(self._state)
        self.path = _rest(pin.XYZQUATToSE3(self._stands.q[:7]), whole, request)

    def plan(self) -> Plan:
        """From where everything has come to rest after the state of the log; the body may go back as it came."""
        log, request = self._old, self.request
        since = int(np.searchsorted(log.t, log.t[self._row] - TRAIL))
        came = [pin.XYZQUATToSE3(row) for row in log.pose_body_in_structure[since : self._row + 1 : EVERY][::-1]]
        here = pin.XYZQUATToSE3(self._stands.q[:7])
        behind = straight_path([here, *came], request.speed, request.turn_rate).poses
        return plan_from_state(self.walker, self._there, self.path, self._stands, behind)

    def compiled(self, backend: str) -> WalkStack:
        """For the holds that are there."""
        return compiled_stack(self.walker, self._there, backend)

    def walk(self, plan: Plan, stack: WalkStack, plant: Plant | None) -> Walk:
        """From the state of the log."""
        return Walk(self.walker, self._there, plan, stack=stack, state=self._state, plant=plant)

    def asked(self) -> dict[str, Any]:
        """The run that goes on, by its whole path, and from when."""
        resume = self._resume
        folder = str(pathlib.Path(resume.folder).resolve())
        return {"kind": RESUME, "folder": folder, "at": resume.at, "points": list(resume.points)}

    def before(self) -> Before:
        """What was walked until it goes on."""
        return Before(self._old, self._ticks, self._row, self.structure)

    def meta(self, plan: Plan) -> dict[str, Any]:
        """What the old log has, and when it was gone on with; its way leads to the old goal."""
        old = {name: value for name, value in self._old.meta.items() if not (name == "way" and self._resume.points)}
        return {**old, "resumed": [*old.get("resumed", []), self._state.time]}

    def carry_out(
        self, walk: Walk, recorder: WalkRecorder, report: Progress, stop: Callable[[], bool] | None
    ) -> Ending:
        """To the end of the path."""
        self._doing = doing = CarryingOut(walk, recorder, progress=report, stop=stop)
        _latch(walk, doing, self._state)
        duration = walk.plan.path.duration
        late = walk.time + PATIENCE * duration + SLACK
        while not walk.done and walk.time < late and doing.step(walk.path_time / duration):
            pass
        return Ending(doing.outcome or ("arrived" if walk.done else "late"), doing.reason)

    def missed(self, walk: Walk) -> str:
        """Where its path ends."""
        return off_goal(walk, self.path.poses[-1])

    def figures(self, log: WalkLog | None) -> tuple[Figure, ...]:
        """From where it went on, and how far things go after an abort."""
        value = {"from": str(self._folder), "at": self._state.time}
        resumed = Figure("resumed", "resumed", value, f"{self._folder} at {self._state.time:.2f} s")
        return (resumed, *self._doing.summary())

    def result(self, walk: Walk, log: WalkLog, ticks: TickColumns) -> Result:
        """The log of the run up to then and of the new walk; the plan is what was done."""
        plan, ticks = as_walked(log, ticks, walk.progress.steps)
        return Result(plan, log, ticks, self.figures(log))


def _latch(walk: Walk, doing: CarryingOut, state: State) -> None:
    """A hand that was opening opens."""
    if state.opening is None:
        return
    arm, hold = state.opening
    for _ in range(round(walk.hands.data.latch_time / walk.dt)):
        walk.hands.manual = Manual(arm, "opening", hold)
        if not doing.step():
            break
    walk.hands.manual = None


def _goal(request: Request, points: tuple[Place, ...]) -> PathRequest:
    """What the rest of a run is asked to do.

    Raises:
        RangeError: it has no goal.
    """
    if not points and not request.goes:
        raise RangeError("to", points, "the run was driven and has no goal; say where to go")
    goes = points or request.points, request.speed, request.turn_rate
    objective: Objective = getattr(request, "objective", "destination")
    return PathRequest(request.site, request.start, *goes, objective)


def _rest(pose: pin.SE3, path: BodyPath, request: PathRequest) -> BodyPath:
    """From a pose straight to the nearest place of a path, and on along it."""
    off = np.linalg.norm(path.poses[:, :3, 3] - pose.translation, axis=1)
    turned = np.linalg.norm(path.poses[:, :3, 0] - pose.rotation[:, 0], axis=1)
    nearest = int((off + turned).argmin())
    begin: Array = straight_path([pose, pin.SE3(path.poses[nearest])], request.speed, request.turn_rate).poses
    return BodyPath(np.concatenate([begin, path.poses[nearest + 1 :]]), path.spacing)
