"""Velocity mode from commands: rates from a file, a keyboard or a function, carried out and recorded."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, replace
from itertools import pairwise

import numpy as np
import pinocchio as pin

from wbc.errors import ShapeError
from wbc.robots import Walker, WalkerData
from wbc.track.summary import Figure
from wbc.validation import Array
from wbc.walking.body_path import standing_path
from wbc.walking.log.log import WalkLog
from wbc.walking.loop.stack import WalkStack
from wbc.walking.loop.walk import Walk
from wbc.walking.modes.commands import Commands
from wbc.walking.modes.drive import Drive, standing_plan
from wbc.walking.planner.plan import NoPlanError
from wbc.walking.run.carrying_out import CarryingOut, Progress
from wbc.walking.run.compiling import compiled_stack
from wbc.walking.run.perform import WalkRun
from wbc.walking.run.recording import WalkRecorder, as_walked
from wbc.walking.run.request import WalkRequest

#: Time that the body has to come to rest after the last command [s]
COMING_DOWN = 30.0
#: Ticks over which achieved rates are means
WINDOW = 50


def perform_drive(
    request: WalkRequest,
    walker: Walker,
    commands: Commands,
    *,
    stack: WalkStack | None = None,
    backend: str = "auto",
    progress: Progress | None = None,
    stop: Callable[[], bool] | None = None,
) -> WalkRun:
    """Drives a body over the place where the request begins, until the commands are over and everything is at rest.

    Args:
        commands: asked every tick. Others: as of :func:`wbc.walking.run.perform_walk`.

    Raises:
        as ``perform_walk``.
    """
    report = progress or (lambda what, part: None)
    if not isinstance(walker.data, WalkerData):
        raise ShapeError("walker", walker.robot.name, "expected a body with arms")
    structure = request.build()
    pose = request.beginning(structure, walker.data)
    report("planning", None)
    begin = time.perf_counter()
    path = standing_path(pose)
    try:
        plan = standing_plan(walker, structure, pose)
    except NoPlanError as error:
        return WalkRun(request, walker, structure, path, None, "refused", str(error))
    planned = time.perf_counter() - begin
    report("compiling", None)
    stack = stack or compiled_stack(walker, structure, backend)
    compiled, begin = time.perf_counter() - begin - planned, time.perf_counter()
    walk = Walk(walker, structure, plan, stack=stack)
    drive = Drive(walk)
    recorder = WalkRecorder(walk, request.seed, {"request": asdict(request), "start": list(plan.start)})
    doing = CarryingOut(walk, recorder, tick=drive.tick, progress=report, stop=stop)
    _carry_out(drive, doing, commands)
    log, ticks = recorder.log()
    walked, ticks = as_walked(log, ticks, walk.progress.steps)
    more = (*_achieved(drive, log), *doing.summary())
    outcome = doing.outcome or "time"
    run = WalkRun(request, walker, structure, walked.path, walked, outcome, doing.reason, log, ticks, planned, compiled)
    return replace(run, walk_time=time.perf_counter() - begin, more=more)


def _carry_out(drive: Drive, doing: CarryingOut, commands: Commands) -> None:
    """Until the commands are over and the body stands."""
    walk, reasons = drive.walk, list[str]()
    end = np.inf
    while walk.time < end and not (end < np.inf and drive.standing and len(walk.held) == len(walk.walker.arms)):
        rates = commands.rates(walk.time) if end == np.inf else None
        if rates is None and end == np.inf:
            end = walk.time + COMING_DOWN
        drive.steer(*(np.zeros(3) if rates is None else rates))
        told = np.array([*drive.command[:2], 0.0, 0.0, 0.0, drive.command[2]])
        if not doing.step(command=told):
            return
        if drive.reason and drive.reason not in reasons:
            reasons.append(drive.reason)
    doing.reason = "; ".join(reasons)


def _achieved(drive: Drive, log: WalkLog) -> list[Figure]:
    """Commanded and achieved rates, and what is between them."""
    if len(log) <= WINDOW:
        return []
    steering, matrices = drive.steering, [_matrix(row) for row in log.pose_body_in_structure[::WINDOW]]
    spacing = WINDOW * log.dt
    found = np.array([steering.rates(a, b, spacing)[:3] for a, b in pairwise(matrices)])
    asked = np.array([log.command[k : k + WINDOW].mean(axis=0) for k in range(0, len(found) * WINDOW, WINDOW)])
    asked = asked[:, [0, 1, 5]]
    off, speed = np.linalg.norm(found[:, :2] - asked[:, :2], axis=1), np.linalg.norm(asked[:, :2], axis=1)
    value = {"commanded": float(speed.mean()), "deviation": float(off.mean()), "worst": float(off.max())}
    text = f"commanded {value['commanded']:.4f} m/s, deviation {value['deviation']:.4f} m/s, means over {spacing:g} s"
    return [Figure("drive", "commands", value, text)]


def _matrix(row: Array) -> Array:
    return np.asarray(pin.XYZQUATToSE3(row).homogeneous)
