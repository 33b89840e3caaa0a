"""A walk as it is asked for: planned, compiled, carried out and recorded, in every mode alike."""

from __future__ import annotations

import contextlib
import pathlib
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from wbc import validation
from wbc.api import Controller
from wbc.errors import RangeError, ShapeError
from wbc.robots import Walker
from wbc.simulation import Plant, PlantError
from wbc.track.summary import Figure
from wbc.walking.body_path import BodyPath
from wbc.walking.checker import Report
from wbc.walking.checker.report import SHOWN, Finding
from wbc.walking.holds.structure import Structure
from wbc.walking.log.folder import PLAN, begin_folder, machine_of, write_whole
from wbc.walking.log.log import WalkLog
from wbc.walking.log.ticks import TickColumns
from wbc.walking.loop.stack import WalkStack
from wbc.walking.modes.commands import Commands
from wbc.walking.planner.plan import HoldLost, NoPlanError, Plan
from wbc.walking.run.arm_tasks_mode import ArmTasksMode
from wbc.walking.run.carrying_out import WELL, Outcome, Progress, settle
from wbc.walking.run.drive_mode import DriveMode
from wbc.walking.run.mode import Mode
from wbc.walking.run.path_mode import Ask, PathMode
from wbc.walking.run.plausible import far_apart
from wbc.walking.run.recording import WalkRecorder
from wbc.walking.run.records import record_of
from wbc.walking.run.request import ArmRequest, DriveRequest, PathRequest, Request, ResumeRequest
from wbc.walking.run.resume_mode import ResumeMode, going_on
from wbc.walking.torque.loads import Loads
from wbc.walking.torque.loop import TorqueLoop


@dataclass(frozen=True, eq=False)
class WalkRun:
    """A walk as it was carried out, or refused.

    Attributes:
        request, walker, structure: what walks where. path: where the body is asked to be, or goes round.
        plan: None if no stance is possible where the walk begins.
        outcome, reason: how it ended; the reason is "" where all is well.
        log, ticks: None if nothing was carried out.
        more: figures of its mode, for the summary. loads: what hands bore, under torques.
        plan_time, compile_time, walk_time: of the computer [s]; walking has controller, plant and log.
    """

    request: Request
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
    loads: Loads | None = None

    @property
    def well(self) -> bool:
        """It did what it was to do, as far as is known: :meth:`judged` knows more."""
        return self.outcome in WELL

    def judged(self, report: Report | None) -> WalkRun:
        """The run as the checker sees it: where anything is violated the outcome is ``violated``, whatever else it did.

        Args:
            report: None: it was not checked, and stays as it is.
        """
        if report is None or report.ok:
            return self
        did = f"it {self.outcome}" if self.well else f"{self.outcome}: {self.reason}"
        reason = f"{'; '.join(map(_found, report.violations))}; apart from that {did}"
        return replace(self, outcome="violated", reason=reason)


def _found(finding: Finding) -> str:
    """A violation in words."""
    unit, factor = SHOWN[finding.unit]
    side = "at least" if finding.least else "at most"
    numbers = f"{factor * finding.worst:.4g} {unit}".strip()
    text = f"{finding.kind} {numbers}, {side} {factor * finding.limit:.4g} are allowed, at {finding.time:.2f} s"
    return f"{text}, {finding.where}" if finding.where else text


def perform_walk(
    request: Request | ResumeRequest,
    walker: Walker,
    *,
    stack: WalkStack | None = None,
    backend: str = "auto",
    progress: Progress | None = None,
    stop: Callable[[], bool] | None = None,
    ask: Ask | None = None,
    commands: Commands | None = None,
    plant: Plant | None = None,
    folder: pathlib.Path | None = None,
) -> WalkRun:
    """Plans and walks with our planner, as the request says.

    Args:
        stack: a compiled one for the same walker and structure; None: compiles one.
        backend: as of ``Stack.compile``.
        stop: asked before every tick; the body then comes to rest, and the log ends there.
        ask: (the next re-grasp, why the last answer was refused or "") -> "" for yes, another hold, or None: the walk
            comes to rest and ends, ``declined``; of paths.
        commands: what drives the body, asked every tick; default: the file of the :class:`DriveRequest`.
        plant: what moves; default: a :class:`wbc.simulation.KinematicPlant`.
        folder: gets what was asked for, holds, machine, plan and log while they come, so that nothing is lost when the
            program is killed; None: nothing is written.

    Raises:
        WalkLogError: the folder cannot be written.
        What the mode of the request and :class:`wbc.walking.loop.walk.Walk` raise for bad input.
    """
    mode = mode_of(request, walker, ask, commands)
    return perform(mode, stack=stack, backend=backend, progress=progress, stop=stop, plant=plant, folder=folder)


def mode_of(
    request: Request | ResumeRequest, walker: Walker, ask: Ask | None = None, commands: Commands | None = None
) -> Mode[Any]:
    """The mode that does a request; what is wrong with it shows here. Arguments as of :func:`perform_walk`.

    Raises:
        RangeError: questions or commands for a mode that has none. ShapeError: no request that is carried out here.
            What the mode raises.
    """
    if isinstance(request, ResumeRequest):
        request = going_on(request)
    if ask is not None and not isinstance(request, PathRequest):
        raise RangeError("ask", type(request).__name__, "only walks along a path ask")
    if commands is not None and not isinstance(request, DriveRequest):
        raise RangeError("commands", type(request).__name__, "only a DriveRequest is driven")
    if isinstance(request, PathRequest):
        return PathMode(request, walker, ask)
    if isinstance(request, DriveRequest):
        return DriveMode(request, walker, commands)
    if isinstance(request, ArmRequest):
        return ArmTasksMode(request, walker)
    if isinstance(request, ResumeRequest):
        return ResumeMode(request, walker)
    raise ShapeError("request", request, "expected a request of a walk by the planner 'free'")


def perform(
    mode: Mode[Any],
    *,
    stack: WalkStack | None = None,
    backend: str = "auto",
    progress: Progress | None = None,
    stop: Callable[[], bool] | None = None,
    plant: Plant | None = None,
    folder: pathlib.Path | None = None,
    compiled: Callable[[Controller], None] | None = None,
) -> WalkRun:
    """Plans, compiles, walks and records. Arguments as of :func:`perform_walk`; ``compiled`` is called once when the
    controller is ready.
    """
    if folder is not None:
        about = plant.about if isinstance(plant, TorqueLoop) else None
        begin_folder(folder, mode.asked(), mode.walker, mode.structure, about)
    report, clock = progress or (lambda what, part: None), time.perf_counter
    run = WalkRun(mode.request, mode.walker, mode.structure, mode.path, None, "refused", "")
    report("planning", None)
    begin = clock()
    try:
        plan = mode.plan()
    except NoPlanError as error:
        reason = f"{error}{_hint(mode)}"
        return replace(run, reason=reason, plan_time=clock() - begin, more=mode.remarks())
    reason = plan.reason if plan.complete else f"{plan.reason}{_hint(mode)}"
    slower = (Figure("slower", "slower than asked", plan.note, plan.note),) if plan.note else ()
    more = (*mode.remarks(), *slower)
    run = replace(run, path=plan.path, plan=plan, reason=reason, plan_time=clock() - begin, more=more)
    if folder is not None:
        write_whole(folder / PLAN, plan.save)
    if not plan.complete:
        return run
    unborne = plant.bearing.of_plan(plan, mode.structure) if isinstance(plant, TorqueLoop) else ""
    if unborne:
        return replace(run, reason=unborne)
    report("compiling", None)
    begin = clock()
    stack = stack or mode.compiled(backend)
    run, begin = replace(run, compile_time=clock() - begin), clock()
    if compiled is not None:
        validation.called("compiled", compiled, stack.controller)
    walk = mode.walk(plan, stack, plant)
    meta = {"machine": machine_of(mode.walker), **mode.meta(plan), "request": record_of(mode.request)}
    if isinstance(plant, TorqueLoop):
        meta["plant"] = plant.about
    recorder = WalkRecorder(walk, mode.request.site.seed, meta, folder=folder, before=mode.before())
    try:
        ending = mode.carry_out(walk, recorder, report, stop)
        with contextlib.suppress(HoldLost, PlantError):
            settle(walk, recorder)
    finally:
        with contextlib.suppress(PlantError):
            walk.machine.rest()
    missed = mode.missed(walk) if ending.outcome == "arrived" else ""
    run = replace(run, outcome="missed" if missed else ending.outcome, reason=missed or ending.reason)
    if not len(recorder):
        return replace(run, more=(*run.more, *mode.figures(None)))
    result = mode.result(walk, *recorder.log())
    if isinstance(plant, TorqueLoop):
        run = replace(run, more=(*run.more, *plant.watch.figures()), loads=plant.watch.loads())
    run = replace(run, log=result.log, ticks=result.ticks, more=(*run.more, *result.figures))
    if result.plan is not None:
        run = replace(run, path=result.plan.path, plan=result.plan)
    return replace(run, walk_time=clock() - begin)


def _hint(mode: Mode[Any]) -> str:
    """What else may be the reason where there is no plan."""
    remark = far_apart(mode.structure, mode.walker)
    return f"; {remark}" if remark else ""
