"""Arm mode on request: what one hand does, task by task, and why each ended.

A task is one of

    hold ID                                  go to a hold and close
    poses FILE                               through poses, a table with columns x, y, z, ax, ay, az, rx, ry, rz
    rate vx,vy,vz,wx,wy,wz for SECONDS       a twist in the structure's axes [m/s, rad/s]

As of the supervisor of the thesis the first task that is refused or stopped is the last, and then the hand is set down.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Literal

import numpy as np
import pinocchio as pin

from wbc.errors import ShapeError
from wbc.robots import Walker, WalkerData
from wbc.track.summary import Figure
from wbc.walking.body_path import standing_path
from wbc.walking.holds.hold import frame_of
from wbc.walking.holds.structure import Structure
from wbc.walking.loop.stack import WalkStack
from wbc.walking.loop.walk import Walk
from wbc.walking.modes.arm_mode import ArmMode, ArmStopped
from wbc.walking.modes.commands import read_numbers
from wbc.walking.modes.drive import standing_plan
from wbc.walking.modes.hand_motion import ArmRefused
from wbc.walking.planner.plan import HoldLost, NoPlanError
from wbc.walking.run.carrying_out import CarryingOut, Progress, farthest, travelled
from wbc.walking.run.compiling import compiled_stack
from wbc.walking.run.perform import WalkRun
from wbc.walking.run.recording import WalkRecorder, as_walked
from wbc.walking.run.request import WalkRequest

Kind = Literal["hold", "poses", "rate"]
Reason = Literal["reached", "time", "key", "refused"]
#: Columns of a file of poses: origin [m], z axis, and a direction whose part across it is the x axis
COLUMNS = ("x", "y", "z", "ax", "ay", "az", "rx", "ry", "rz")
#: Time in which a hand that is left in the air is set down [s]
SETTING_DOWN = 30.0


@dataclass(frozen=True, eq=False)
class ArmTask:
    """What a hand is to do: to a hold, through poses, or by a twist for a time [s]."""

    kind: Kind
    text: str
    hold: str = ""
    poses: tuple[pin.SE3, ...] = ()
    twist: tuple[float, ...] = ()
    seconds: float = 0.0


@dataclass(frozen=True)
class ArmStop:
    """How a task ended: ``reached``, ``time`` (of a rate), ``key`` (somebody stopped it) or ``refused``.

    Attributes:
        task: as it was asked. message: why it was refused or stopped. time: of the walk [s].
    """

    task: str
    reason: Reason
    message: str
    time: float


def arm_task(text: str, structure: Structure) -> ArmTask:
    """A task from what a user types.

    Raises:
        ShapeError: it is none. UnknownNameError: no such hold. NumberTableError, RangeError: a file of poses.
    """
    kind, _, rest = text.strip().partition(" ")
    rest = rest.strip()
    if kind == "hold" and rest:
        structure.index(rest)
        return ArmTask("hold", text, hold=rest)
    if kind == "poses" and rest:
        rows = read_numbers(rest, COLUMNS)
        poses = (frame_of(f"row {k + 1}", row[:3], row[3:6], row[6:]) for k, row in enumerate(rows))
        return ArmTask("poses", text, poses=tuple(poses))
    if kind == "rate":
        numbers, _, seconds = rest.partition(" for ")
        try:
            twist, duration = tuple(float(part) for part in numbers.split(",")), float(seconds)
        except ValueError as error:
            raise ShapeError("do", text, "expected 'rate vx,vy,vz,wx,wy,wz for SECONDS'") from error
        if len(twist) != 6 or not np.isfinite([*twist, duration]).all() or duration <= 0.0:
            raise ShapeError("do", text, "expected six rates and a time above 0")
        return ArmTask("rate", text, twist=twist, seconds=duration)
    raise ShapeError("do", text, "expected 'hold ID', 'poses FILE' or 'rate vx,vy,vz,wx,wy,wz for SECONDS'")


def perform_arm(
    request: WalkRequest,
    walker: Walker,
    *,
    stack: WalkStack | None = None,
    backend: str = "auto",
    progress: Progress | None = None,
    stop: Callable[[], bool] | None = None,
) -> WalkRun:
    """One hand does the request's tasks while the body stands where the request begins.

    Args:
        as of :func:`wbc.walking.run.perform_walk`; ``stop`` ends a motion, and the tasks.

    Raises:
        as ``perform_walk``, and what :func:`arm_task` raises. UnknownNameError: no such arm.
    """
    if not isinstance(walker.data, WalkerData):
        raise ShapeError("walker", walker.robot.name, "expected a body with arms")
    structure = request.build()
    tasks = [arm_task(text, structure) for text in request.tasks]
    pose = request.beginning(structure, walker.data)
    report = progress or (lambda what, part: None)
    report("planning", None)
    begin = time.perf_counter()
    try:
        plan = standing_plan(walker, structure, pose)
    except NoPlanError as error:
        return WalkRun(request, walker, structure, standing_path(pose), None, "refused", str(error))
    planned, begin = time.perf_counter() - begin, time.perf_counter()
    report("compiling", None)
    stack = stack or compiled_stack(walker, structure, backend)
    compiled, begin = time.perf_counter() - begin, time.perf_counter()
    walk = Walk(walker, structure, plan, stack=stack)
    recorder = WalkRecorder(walk, request.seed, {"request": asdict(request), "start": list(plan.start)})
    mode = ArmMode(walk, request.arm or walker.arms[0].name, recorder.tick, stop)
    stops, body = _carried_out(mode, tasks), pose.translation
    doing = CarryingOut(walk, recorder, progress=report)
    mode.leave()
    walk.set_down()
    late = walk.time + SETTING_DOWN
    while (walk.busy or len(walk.held) < len(walker.arms)) and walk.time < late and doing.step():
        pass
    log, ticks = recorder.log()
    walked, ticks = as_walked(log, ticks, walk.progress.steps)
    last = stops[-1]
    ended = {"reached": "arrived", "time": "arrived", "key": "interrupted", "refused": "refused"}
    run = WalkRun(request, walker, structure, walked.path, walked, "arrived", last.message, log, ticks, planned)
    places = log.pose_body_in_structure[log.t <= last.time, :3]
    moved = float(np.linalg.norm(places - body, axis=1).max())
    more = (*_told(stops), Figure("body_moved", "body moved", moved, f"at most {1e3 * moved:.3f} mm"))
    more = (*more, farthest(*mode.farthest), *([] if mode.stopped is None else [travelled(*mode.stopped)]))
    outcome = doing.outcome or ended[last.reason]
    return replace(run, outcome=outcome, compile_time=compiled, walk_time=time.perf_counter() - begin, more=more)  # type: ignore[arg-type]


def _carried_out(mode: ArmMode, tasks: Sequence[ArmTask]) -> list[ArmStop]:
    """Task by task, until one is refused or stopped."""
    out = list[ArmStop]()
    for task in tasks:
        reason: Reason = "time" if task.kind == "rate" else "reached"
        message = ""
        try:
            if task.kind == "hold":
                mode.to_hold(task.hold)
            elif task.kind == "poses":
                mode.through(task.poses)
            else:
                mode.by_rate(task.twist, task.seconds)
        except ArmStopped as error:
            reason, message = "key", str(error)
        except (ArmRefused, HoldLost) as error:
            reason, message = "refused", str(error)
        out.append(ArmStop(task.text, reason, message, mode.walk.time))
        if message:
            break
    return out


def _told(stops: Sequence[ArmStop]) -> list[Figure]:
    """A line a task."""
    out = []
    for k, stop in enumerate(stops, start=1):
        told = f"{stop.task}: {stop.reason} at {stop.time:.2f} s{f' ({stop.message})' if stop.message else ''}"
        out.append(Figure(f"task_{k}", f"task {k}", asdict(stop), told))
    return out
