"""Plans a walk, carries it out and records it."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Literal

from wbc.errors import ShapeError
from wbc.robots import Walker, WalkerData
from wbc.walking.body_path import BodyPath
from wbc.walking.plan import HoldLost, NoPlanError, Plan
from wbc.walking.planner import Objective, plan_walk
from wbc.walking.run.recording import TickColumns, WalkRecorder
from wbc.walking.run.request import WalkRequest
from wbc.walking.run_log import WalkLog
from wbc.walking.structure import Structure
from wbc.walking.walk import PATIENCE, SLACK, Walk
from wbc.walking.walk_stack import WalkStack

Outcome = Literal["arrived", "late", "interrupted", "hold lost", "refused"]
#: (what is done, how much of it from 0 to 1 or None)
Progress = Callable[[str, float | None], None]
#: Ticks between two reports of progress
STRIDE = 25


@dataclass(frozen=True, eq=False)
class WalkRun:
    """A walk as it was carried out, or refused.

    Attributes:
        request, walker, structure: what walks where. path: where the body is asked to be, or goes round.
        plan: None if no stance is possible where the walk begins.
        outcome, reason: how it ended; the reason is "" where all is well.
        log, ticks: None if nothing was carried out.
        plan_time, compile_time, walk_time: of the computer [s]; walking has controller, simulation and log.
    """

    request: WalkRequest
    walker: Walker
    structure: Structure
    path: BodyPath
    plan: Plan | None
    outcome: Outcome
    reason: str
    log: WalkLog | None = None
    ticks: TickColumns | None = None
    plan_time: float = 0.0
    compile_time: float = 0.0
    walk_time: float = 0.0


def perform_walk(
    request: WalkRequest,
    walker: Walker,
    *,
    stack: WalkStack | None = None,
    backend: str = "auto",
    progress: Progress | None = None,
    stop: Callable[[], bool] | None = None,
) -> WalkRun:
    """Plans and walks with our planner.

    Args:
        stack: a compiled one for the same walker and structure; None: compiles one.
        backend: as of ``Stack.compile``.
        stop: asked before every tick; the log ends there.

    Raises:
        What the request's methods raise. ShapeError: no body with arms.
    """
    report = progress or (lambda what, part: None)
    if not isinstance(walker.data, WalkerData):
        raise ShapeError("walker", walker.robot.name, "expected a body with arms")
    structure = request.build()
    path = request.path(structure, walker.data)
    report("planning", None)
    begin = time.perf_counter()
    try:
        asked: Objective = "velocity" if request.mode == "velocity" else "destination"
        plan = plan_walk(walker, structure, path, objective=asked, partial=True, detour=True)
    except NoPlanError as error:
        return WalkRun(request, walker, structure, path, None, "refused", str(error), plan_time=_since(begin))
    planned, path = _since(begin), plan.path
    if not plan.complete:
        return WalkRun(request, walker, structure, path, plan, "refused", plan.reason, plan_time=planned)
    report("compiling", None)
    begin = time.perf_counter()
    stack = stack or WalkStack(walker, structure, collisions=False, backend=backend)
    compiled = _since(begin)
    begin = time.perf_counter()
    walk = Walk(walker, structure, plan, stack=stack)
    recorder = WalkRecorder(walk, request.seed, {"request": asdict(request), "start": list(plan.start)})
    outcome, reason = _walked(walk, recorder, report, stop or (lambda: False))
    if not len(recorder):
        return WalkRun(
            request, walker, structure, path, plan, outcome, reason, plan_time=planned, compile_time=compiled
        )
    log, ticks = recorder.log()
    return WalkRun(
        request, walker, structure, path, plan, outcome, reason, log, ticks, planned, compiled, _since(begin)
    )


def _walked(walk: Walk, recorder: WalkRecorder, report: Progress, stop: Callable[[], bool]) -> tuple[Outcome, str]:
    """Ticks until the walk is over; (how it ended, why)."""
    duration = walk.plan.path.duration
    while not walk.done:
        if stop():
            return "interrupted", f"stopped at {walk.time:.2f} s"
        if walk.time > PATIENCE * duration + SLACK:
            return "late", f"not there after {walk.time:.0f} s, the path takes {duration:.0f} s"
        try:
            recorder.tick(walk.tick())
        except HoldLost as error:
            return "hold lost", str(error)
        except NoPlanError as error:
            return "refused", str(error)
        if len(recorder) % STRIDE == 0:
            report("walking", min(walk.path_time / duration, 1.0))
    return "arrived", ""


def _since(begin: float) -> float:
    return time.perf_counter() - begin
