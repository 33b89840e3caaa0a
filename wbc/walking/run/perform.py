"""Plans a walk, carries it out and records it."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace

from wbc.errors import ShapeError, WbcError
from wbc.robots import Walker, WalkerData
from wbc.track.summary import Figure
from wbc.walking.body_path import BodyPath
from wbc.walking.holds.structure import Structure
from wbc.walking.log.body_paths import way_of
from wbc.walking.log.log import WalkLog
from wbc.walking.loop.stack import WalkStack
from wbc.walking.loop.walk import PATIENCE, SLACK, Walk
from wbc.walking.modes.first_grasps import free_state, plan_from_state
from wbc.walking.modes.veto import Veto
from wbc.walking.planner.follow import follow_plan
from wbc.walking.planner.plan import NoPlanError, Plan, Regrasp, read_plan
from wbc.walking.planner.planner import Objective, plan_walk
from wbc.walking.run.carrying_out import CarryingOut, Outcome, Progress
from wbc.walking.run.compiling import compiled_stack
from wbc.walking.run.recording import TickColumns, WalkRecorder
from wbc.walking.run.request import WalkRequest


@dataclass(frozen=True, eq=False)
class WalkRun:
    """A walk as it was carried out, or refused.

    Attributes:
        request, walker, structure: what walks where. path: where the body is asked to be, or goes round.
        plan: None if no stance is possible where the walk begins.
        outcome, reason: how it ended; the reason is "" where all is well.
        log, ticks: None if nothing was carried out.
        more: figures of its mode, for the summary.
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
    more: tuple[Figure, ...] = ()


def perform_walk(
    request: WalkRequest,
    walker: Walker,
    *,
    stack: WalkStack | None = None,
    backend: str = "auto",
    progress: Progress | None = None,
    stop: Callable[[], bool] | None = None,
    ask: Callable[[Regrasp, str], str] | None = None,
) -> WalkRun:
    """Plans and walks with our planner.

    Args:
        stack: a compiled one for the same walker and structure; None: compiles one.
        backend: as of ``Stack.compile``.
        stop: asked before every tick; the body then comes to rest, and the log ends there.
        ask: (the next re-grasp, why the last answer was refused or "") -> "" for yes, or another hold.

    Raises:
        What the request's methods, ``read_plan`` and ``follow_plan`` raise for bad input. ShapeError: no body with
            arms.
    """
    report = progress or (lambda what, part: None)
    if not isinstance(walker.data, WalkerData):
        raise ShapeError("walker", walker.robot.name, "expected a body with arms")
    structure = request.build()
    asked_plan = read_plan(request.plan) if request.plan else None
    path = request.path(structure, walker.data) if asked_plan is None else asked_plan.path
    report("planning", None)
    begin = time.perf_counter()
    try:
        asked: Objective = "velocity" if request.mode == "velocity" else "destination"
        if request.free_start:
            state = free_state(walker, path.poses[0])
            plan = plan_from_state(walker, structure, path, state)
        elif asked_plan is not None:
            state, plan = None, follow_plan(walker, structure, asked_plan)
        else:
            state, plan = None, plan_walk(walker, structure, path, objective=asked, partial=True, detour=True)
    except NoPlanError as error:
        return WalkRun(request, walker, structure, path, None, "refused", str(error), plan_time=_since(begin))
    # A way round that was found, or that of a file, goes with the log, so that the walk can be resumed on it
    way = {} if plan.path is path and asked_plan is None else {"way": way_of(plan.path)}
    planned, path = _since(begin), plan.path
    if not plan.complete:
        return WalkRun(request, walker, structure, path, plan, "refused", plan.reason, plan_time=planned)
    report("compiling", None)
    begin = time.perf_counter()
    stack = stack or compiled_stack(walker, structure, backend)
    compiled = _since(begin)
    begin = time.perf_counter()
    walk = Walk(walker, structure, plan, stack=stack, state=state)
    recorder = WalkRecorder(walk, request.seed, {"request": asdict(request), "start": list(plan.start), **way})
    outcome, reason, more = walked(walk, recorder, report, stop, ask)
    run = WalkRun(request, walker, structure, path, plan, outcome, reason, None, None, planned, compiled, more=more)
    if not len(recorder):
        return run
    log, ticks = recorder.log()
    return replace(run, log=log, ticks=ticks, walk_time=_since(begin))


def walked(
    walk: Walk,
    recorder: WalkRecorder,
    report: Progress,
    stop: Callable[[], bool] | None,
    ask: Callable[[Regrasp, str], str] | None,
) -> tuple[Outcome, str, tuple[Figure, ...]]:
    """Ticks until a walk is over; (how it ended, why, figures). Arguments as of :func:`perform_walk`."""
    duration = walk.plan.path.duration
    doing = CarryingOut(walk, recorder, progress=report, stop=stop)
    veto = None if ask is None else Veto(walk)
    while not walk.done:
        if veto is not None and ask is not None:
            _asked(veto, ask)
        if walk.time > PATIENCE * duration + SLACK:
            reason = f"not there after {walk.time:.0f} s, the path takes {duration:.0f} s"
            return "late", reason, doing.summary()
        if not doing.step(walk.path_time / duration):
            return doing.outcome or "interrupted", doing.reason, doing.summary()
    return "arrived", "", doing.summary()


def _asked(veto: Veto, ask: Callable[[Regrasp, str], str]) -> None:
    """Answers to the proposal, until one is possible."""
    refused = ""
    while (step := veto.proposal) is not None:
        answer = ask(step, refused)
        if not answer:
            veto.accept()
            return
        try:
            veto.choose(answer)
        except WbcError as error:
            refused = str(error)


def _since(begin: float) -> float:
    return time.perf_counter() - begin
