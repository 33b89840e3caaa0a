"""Going on with a walk from any state of its log."""

from __future__ import annotations

import pathlib
import time
from collections.abc import Callable
from dataclasses import asdict, fields, replace
from math import inf
from typing import Any

import numpy as np
import pinocchio as pin

from wbc.errors import RangeError, ShapeError
from wbc.robots import Walker, WalkerData
from wbc.track.summary import Figure
from wbc.validation import Array
from wbc.walking.body_path import BodyPath, straight_path
from wbc.walking.holds.files import read_structure
from wbc.walking.holds.structure import Structure
from wbc.walking.log.body_paths import path_of
from wbc.walking.log.log import CLOSED, OPENING, WalkLog, WalkLogError
from wbc.walking.loop.stack import WalkStack
from wbc.walking.loop.state import Manual, State
from wbc.walking.loop.walk import PATIENCE, SLACK, Walk
from wbc.walking.modes.first_grasps import plan_from_state
from wbc.walking.planner.plan import NoPlanError
from wbc.walking.run.carrying_out import CarryingOut, Progress
from wbc.walking.run.compiling import compiled_stack
from wbc.walking.run.perform import WalkRun
from wbc.walking.run.recording import TICKS, TickColumns, WalkRecorder, as_walked, configuration
from wbc.walking.run.request import WalkRequest

STRUCTURE = "structure.csv"


def resumed_state(log: WalkLog, row: int, walker: Walker, structure: Structure) -> State:
    """The state of a row of a log: a body at rest with the hands that hold there.

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
    return State(configuration(walker, log, row), held, float(log.t[row]), opening)


def joined(before: WalkLog, row: int, after: WalkLog) -> WalkLog:
    """A log up to a row, and from there on another one of the same holds or fewer.

    Raises:
        ShapeError: other arms or joints.
    """
    if before.joints != after.joints or before.arms != after.arms:
        raise ShapeError("joined", after.arms, "expected a log of the same machine")
    rows = np.array([before.hold_id.index(name) for name in after.hold_id])
    hold = np.where(after.hand_hold >= 0, rows[after.hand_hold], -1)
    parts: dict[str, Any] = {}
    for name in (*("t", "pose_body_in_structure", "q", "v", "twist_body", "hand_state", "body_fixed"),):
        parts[name] = np.concatenate([getattr(before, name)[:row], getattr(after, name)])
    for name in ("command", "command_kind"):
        parts[name] = np.concatenate([getattr(before, name)[:row], getattr(after, name)])
    parts["hand_hold"] = np.concatenate([before.hand_hold[:row], hold])
    # What vanished before the row stays gone; what would have vanished later has not
    begin = float(after.t[0])
    spans = before.presence_span.copy()
    spans[spans[:, 1] > begin, 1] = inf
    for gone, span in zip(after.presence_hold, after.presence_span, strict=True):
        mine = (before.presence_hold == rows[gone]) & (spans[:, 1] == inf)
        spans[mine, 1] = span[1]
    there = spans[:, 0] <= begin
    parts |= {"presence_hold": before.presence_hold[there], "presence_span": spans[there]}
    kept = {f.name: getattr(before, f.name) for f in fields(before)}
    meta = {**before.meta, "resumed": [*before.meta.get("resumed", []), begin]}
    return WalkLog(**{**kept, **parts, "meta": meta})


def perform_resume(
    folder: pathlib.Path,
    walker: Walker,
    *,
    at: float | None = None,
    points: tuple[str, ...] = (),
    stack: WalkStack | None = None,
    backend: str = "auto",
    progress: Progress | None = None,
    stop: Callable[[], bool] | None = None,
) -> WalkRun:
    """Reads a run's folder, begins at rest in the state that its log has at a time, plans and walks to the end.

    Args:
        at: [s]; None: the last state. points: where to go, as of ``WalkRequest``; (): where the run was to go, by the
            way that it had found.
        Others: as of :func:`wbc.walking.run.perform_walk`.

    Raises:
        WalkLogError: no log of a walk. RangeError: a time that it does not have, another robot, a state that is not
            legal, or a run that has no goal.
    """
    report = progress or (lambda what, part: None)
    old = WalkLog.load(folder)
    request = _request(old, points)
    if not isinstance(walker.data, WalkerData) or walker.data.digest != old.meta["robot_digest"]:
        raise RangeError("resume", old.meta["robot_digest"], "the run has another robot; use the same --set")
    row = len(old) - 1 if at is None else int(np.searchsorted(old.t, at + 1e-9, side="right")) - 1
    if row < 1 or (at is not None and at > old.t[-1] + 1e-9):
        raise RangeError("resume.at", at, f"expected a time from {old.t[1]:g} to {old.t[-1]:g} s")
    whole = read_structure(folder / STRUCTURE)
    here = old.present(np.arange(len(old.hold_id)), float(old.t[row]))
    structure = whole.without([name for name, there in zip(old.hold_id, here, strict=True) if not there])
    state = resumed_state(old, row, walker, structure)
    whole_way = request.path(structure, walker.data) if points or "way" not in old.meta else path_of(old.meta["way"])
    path = _rest(pin.XYZQUATToSE3(old.pose_body_in_structure[row]), whole_way, request)
    report("planning", None)
    begin = time.perf_counter()
    try:
        plan = plan_from_state(walker, structure, path, state)
    except NoPlanError as error:
        return WalkRun(request, walker, whole, path, None, "refused", str(error))
    planned, begin = time.perf_counter() - begin, time.perf_counter()
    report("compiling", None)
    stack = stack or compiled_stack(walker, structure, backend)
    compiled, begin = time.perf_counter() - begin, time.perf_counter()
    walk = Walk(walker, structure, plan, stack=stack, state=state)
    recorder = WalkRecorder(walk, request.seed, {"request": asdict(request)})
    doing = CarryingOut(walk, recorder, progress=report, stop=stop)
    _latch(walk, doing, state)
    late = walk.time + PATIENCE * plan.path.duration + SLACK
    while not walk.done and walk.time < late and doing.step(walk.path_time / plan.path.duration):
        pass
    after, ticks = recorder.log()
    log = joined(old, row, after)
    ticks = TickColumns.load(folder / TICKS).then(row, ticks)
    walked, ticks = as_walked(log, ticks, walk.progress.steps)
    outcome = doing.outcome or ("arrived" if walk.done else "late")
    told = Figure("resumed", "resumed", {"from": str(folder), "at": state.time}, f"{folder} at {state.time:.2f} s")
    run = WalkRun(request, walker, whole, walked.path, walked, outcome, doing.reason, log, ticks, planned, compiled)
    return replace(run, walk_time=time.perf_counter() - begin, more=(told, *doing.summary()))


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


def _request(log: WalkLog, points: tuple[str, ...]) -> WalkRequest:
    """What the run was asked to do, from its log."""
    kept = log.meta.get("request")
    if not isinstance(kept, dict) or not kept.keys() <= {f.name for f in fields(WalkRequest)}:
        raise WalkLogError("resume", str(log.meta.get("robot")), "the log does not say what the run was asked to do")
    values: dict[str, Any] = {k: tuple(value) if isinstance(value, list) else value for k, value in kept.items()}
    request = WalkRequest(**values)
    if points:
        request = replace(request, points=points)
    elif request.commands or request.tasks:
        raise RangeError("to", points, "the run was driven and has no goal; say where to go")
    mode = "destination" if request.mode == "arm" else request.mode
    return replace(request, mode=mode, commands="", tasks=(), arm="", free_start=False)


def _rest(pose: pin.SE3, path: BodyPath, request: WalkRequest) -> BodyPath:
    """From a pose straight to the nearest place of a path, and on along it."""
    off = np.linalg.norm(path.poses[:, :3, 3] - pose.translation, axis=1)
    turned = np.linalg.norm(path.poses[:, :3, 0] - pose.rotation[:, 0], axis=1)
    nearest = int((off + turned).argmin())
    begin: Array = straight_path([pose, pin.SE3(path.poses[nearest])], request.speed, request.turn_rate).poses
    return BodyPath(np.concatenate([begin, path.poses[nearest + 1 :]]), path.spacing)
