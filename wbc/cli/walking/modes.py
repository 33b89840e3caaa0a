"""What ``wbc walk`` does in each mode, from what the user asked for."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from wbc import validation
from wbc.cli.console import err
from wbc.cli.walking.keyboard import HELP, KeyCommands
from wbc.errors import RangeError
from wbc.robots import Walker, WalkerData
from wbc.terminal import terminal, terminal_keys
from wbc.walking.modes.commands import read_commands
from wbc.walking.planner.plan import Regrasp, read_plan
from wbc.walking.report.figures import least_time_figure
from wbc.walking.run.arm_run import arm_task, perform_arm
from wbc.walking.run.carrying_out import Progress
from wbc.walking.run.drive_run import perform_drive
from wbc.walking.run.perform import WalkRun, perform_walk
from wbc.walking.run.request import WalkRequest
from wbc.walking.run.resume_run import perform_resume
from wbc.walking.run.two_ended_run import perform_two_ended, two_ended_goal

#: (back end, progress, whether to stop) -> what was done
Perform = Callable[[str, Progress, Callable[[], bool]], WalkRun]


def performance(
    request: WalkRequest, machine: Walker, resume: str = "", ask: bool = False, least_time: bool = False
) -> Perform:
    """The run of a mode, not begun yet.

    Args:
        resume: a run's folder, perhaps with @SECONDS; "": none. ask: whether re-grasps are proposed.
        least_time: whether the least time of the plan is among the figures.

    Raises:
        what the modes raise for bad input.
    """
    if least_time:
        return _with_least_time(request, performance(request, machine, resume, ask), resume)
    two_ended = request.robot == "two-ended"
    if request.plan and resume:
        raise RangeError("plan", request.plan, "a resumed run is planned anew")
    if ask and (request.commands or request.tasks or resume or two_ended):
        raise RangeError("ask", ask, "only walks along a path ask")
    if two_ended:
        return _two_ended(request, machine, resume)
    assert isinstance(machine.data, WalkerData)
    if resume:
        return _resumed(request, machine, resume)
    structure = request.build()
    if request.commands or request.tasks:
        request.beginning(structure, machine.data)
    elif request.plan:
        for step in read_plan(request.plan).regrasps:
            structure.index(step.target)
    else:
        request.path(structure, machine.data)
    if request.commands == "keyboard":
        terminal("commands")
        return lambda backend, told, stop: _driven_by_keys(request, machine, backend, stop)
    if request.commands:
        table = read_commands(request.commands)
        return lambda backend, told, stop: perform_drive(
            request, machine, table, backend=backend, progress=told, stop=stop
        )
    if request.tasks:
        for text in request.tasks:
            arm_task(text, structure)
        names = [arm.name for arm in machine.arms]
        validation.one_of("arm", request.arm or names[0], names)
        return lambda backend, told, stop: perform_arm(request, machine, backend=backend, progress=told, stop=stop)
    answer = _answer if ask else None
    return lambda backend, told, stop: perform_walk(
        request, machine, backend=backend, progress=told, stop=stop, ask=answer
    )


def _with_least_time(request: WalkRequest, perform: Perform, resume: str) -> Perform:
    """The same run, with the least time of its plan among its figures; without it where there is no whole plan."""
    other = request.robot == "two-ended" or request.planner == "published" or request.free_start
    if other or request.commands or request.tasks or resume:
        raise RangeError("least-time", True, "it is of a plan of three arms that hold, by the planner 'free'")

    def both(backend: str, told: Progress, stop: Callable[[], bool]) -> WalkRun:
        run = perform(backend, told, stop)
        if run.plan is None or not run.plan.complete:
            return run
        told("least time", None)
        return replace(run, more=(*run.more, least_time_figure(run.walker, run.plan)))

    return both


def _two_ended(request: WalkRequest, machine: Walker, resume: str) -> Perform:
    if resume:
        raise RangeError("resume", resume, "runs of the two-ended arm are not resumed")
    two_ended_goal(request, request.build())
    return lambda backend, told, stop: perform_two_ended(request, machine, backend=backend, progress=told, stop=stop)


def _resumed(request: WalkRequest, machine: Walker, resume: str) -> Perform:
    name, sign, seconds = resume.rpartition("@")
    try:
        at = float(seconds) if sign else None
    except ValueError:
        name, at = resume, None
    folder = Path(name if sign and at is not None else resume)
    if not folder.is_dir():
        raise RangeError("resume", resume, "expected the folder of a run, or FOLDER@SECONDS")
    return lambda backend, told, stop: perform_resume(
        folder, machine, at=at, points=request.points, backend=backend, progress=told, stop=stop
    )


def _driven_by_keys(request: WalkRequest, machine: Walker, backend: str, stop: Callable[[], bool]) -> WalkRun:
    with terminal_keys() as read:
        err().print(HELP)
        return perform_drive(request, machine, KeyCommands(read), backend=backend, stop=stop)


def _answer(step: Regrasp, refused: str) -> str:
    """A line from the standard input; empty, also at its end, is a yes."""
    if refused:
        err().print(refused, markup=False)
    err().print(f"{step.arm}: {step.source} -> {step.target}? [Enter: yes, or another hold]", markup=False)
    return sys.stdin.readline().strip()
