"""What ``wbc walk`` does in each mode, from what the user asked for."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace

from wbc.cli.console import err
from wbc.cli.walking.keyboard import HELP, KeyCommands
from wbc.errors import RangeError
from wbc.robots import Walker
from wbc.terminal import terminal, terminal_keys
from wbc.walking.planner.plan import Regrasp
from wbc.walking.report.figures import least_time_figure
from wbc.walking.run.carrying_out import Progress
from wbc.walking.run.request import DriveRequest, PathRequest, Request, TwoEndedRequest
from wbc.walking.run.resume_mode import read_resume
from wbc.walking.run.session import WalkRun, mode_of, perform, perform_walk

#: (back end, progress, whether to stop) -> what was done
Perform = Callable[[str, Progress, Callable[[], bool]], WalkRun]


def performance(
    request: Request,
    machine: Walker,
    resume: str = "",
    ask: bool = False,
    least_time: bool = False,
    points: tuple[str, ...] = (),
) -> Perform:
    """The run of a request, not begun yet.

    Args:
        resume: a run's folder, perhaps with @SECONDS; "": none. points: where a resumed run goes, as they were typed.
        ask: whether re-grasps are proposed. least_time: whether the least time of the plan is among the figures.

    Raises:
        what the modes raise for bad input.
    """
    if least_time:
        planned = isinstance(request, PathRequest) and not request.free_start and not resume
        if not planned:
            raise RangeError("least-time", True, "it is of a plan of three arms that hold, by the planner 'free'")
        return _with_least_time(performance(request, machine, resume, ask))
    if isinstance(request, PathRequest) and request.plan and resume:
        raise RangeError("plan", request.plan, "a resumed run is planned anew")
    if ask and (resume or not isinstance(request, PathRequest)):
        raise RangeError("ask", ask, "only walks along a path ask")
    if isinstance(request, TwoEndedRequest) and resume:
        raise RangeError("resume", resume, "runs of the two-ended arm are not resumed")
    if isinstance(request, DriveRequest) and request.commands == "keyboard" and not resume:
        terminal("commands")
        return lambda backend, report, stop: _driven_by_keys(request, machine, backend, stop)
    mode = mode_of(read_resume(resume, points) if resume else request, machine, _answer if ask else None)
    return lambda backend, report, stop: perform(mode, backend=backend, progress=report, stop=stop)


def _with_least_time(run: Perform) -> Perform:
    """The same run, with the least time of its plan among its figures; without it where there is no whole plan."""

    def both(backend: str, report: Progress, stop: Callable[[], bool]) -> WalkRun:
        done = run(backend, report, stop)
        if done.plan is None or not done.plan.complete:
            return done
        report("least time", None)
        return replace(done, more=(*done.more, least_time_figure(done.walker, done.plan)))

    return both


def _driven_by_keys(request: DriveRequest, machine: Walker, backend: str, stop: Callable[[], bool]) -> WalkRun:
    with terminal_keys() as read:
        err().print(HELP)
        return perform_walk(request, machine, commands=KeyCommands(read), backend=backend, stop=stop)


def _answer(step: Regrasp, refused: str) -> str:
    """A line from the standard input; empty, also at its end, is a yes."""
    if refused:
        err().print(refused, markup=False)
    err().print(f"{step.arm}: {step.source} -> {step.target}? [Enter: yes, or another hold]", markup=False)
    return sys.stdin.readline().strip()
