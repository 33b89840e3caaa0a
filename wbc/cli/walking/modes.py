"""What ``wbc walk`` does in each mode, from what the user asked for."""

from __future__ import annotations

import os
import select
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from wbc.cli.console import err
from wbc.cli.walking.keyboard import HELP, KeyCommands
from wbc.errors import RangeError, ShapeError
from wbc.robots import Walker
from wbc.terminal import terminal, terminal_keys
from wbc.walking.planner.plan import Regrasp
from wbc.walking.report.figures import least_time_figure
from wbc.walking.run.carrying_out import Progress
from wbc.walking.run.request import DriveRequest, PathRequest, Request
from wbc.walking.run.resume_mode import ResumeRequest
from wbc.walking.run.session import WalkRun, mode_of, perform, perform_walk
from wbc.walking.torque.choice import PlantChoice

#: Time between two looks at whether a walk is to stop that waits for an answer [s]
WAIT = 0.1
#: Joints that do as they are commanded
KINEMATIC = PlantChoice()
#: (back end, progress, whether to stop, the run's folder) -> what was done
Perform = Callable[[str, Progress, Callable[[], bool], Path], WalkRun]


def performance(
    request: Request | ResumeRequest,
    machine: Walker,
    ask: bool = False,
    least_time: bool = False,
    plant: PlantChoice = KINEMATIC,
) -> Perform:
    """The run of a request, not begun yet.

    Args:
        ask: whether re-grasps are proposed. least_time: whether the least time of the plan is among the figures.
        plant: what moves.

    Raises:
        what the modes raise for bad input.
    """
    if least_time:
        if not isinstance(request, PathRequest) or request.free_start:
            raise RangeError("least-time", True, "it is of a plan of arms that hold, by the planner 'free'")
        return _with_least_time(performance(request, machine, ask, plant=plant))
    if ask and not isinstance(request, PathRequest):
        raise RangeError("ask", ask, "only walks along a path ask")
    if isinstance(request, DriveRequest) and request.commands == "keyboard":
        terminal("commands")
        if plant.dynamic:
            raise RangeError("plant", plant.name, "the keyboard drives the kinematic plant")
        return lambda backend, report, stop, folder: _driven_by_keys(request, machine, backend, stop, folder)
    if plant.dynamic and isinstance(request, PathRequest) and request.free_start:
        raise RangeError("plant", plant.name, "a body that nothing holds is not fixed in it; --free-start is kinematic")
    lines = Lines() if ask else None
    mode = mode_of(request, machine, None if lines is None else lines.answer)

    def run(backend: str, report: Progress, stop: Callable[[], bool], folder: Path) -> WalkRun:
        if lines is not None:
            lines.stop = stop
        if not plant.dynamic:
            return perform(mode, backend=backend, progress=report, stop=stop, folder=folder)
        report("compiling the torques", None)
        loop = plant.build(mode.walker, mode.structure, backend)
        return perform(mode, backend=backend, progress=report, stop=stop, folder=folder, plant=loop)

    return run


def plant_choice(name: str, gravity: str, faults: Sequence[str] | None) -> PlantChoice:
    """What ``--plant``, ``--gravity`` and ``--fault`` mean.

    Raises:
        UnknownNameError, ShapeError, RangeError: a text that is none.
    """
    try:
        x, y, z = (float(part) for part in gravity.split(","))
    except ValueError as error:
        raise ShapeError("gravity", gravity, "expected x,y,z in m/s^2") from error
    return PlantChoice(name, (x, y, z), tuple(faults or ()))


def _with_least_time(run: Perform) -> Perform:
    """The same run, with the least time of its plan among its figures; without it where there is no whole plan."""

    def both(backend: str, report: Progress, stop: Callable[[], bool], folder: Path) -> WalkRun:
        done = run(backend, report, stop, folder)
        if done.plan is None or not done.plan.complete:
            return done
        report("least time", None)
        return replace(done, more=(*done.more, least_time_figure(done.walker, done.plan)))

    return both


def _driven_by_keys(
    request: DriveRequest, machine: Walker, backend: str, stop: Callable[[], bool], folder: Path
) -> WalkRun:
    with terminal_keys() as read:
        err().print(HELP)
        commands = KeyCommands(read)
        return perform_walk(request, machine, commands=commands, backend=backend, stop=stop, folder=folder)


class Lines:
    """Answers to proposals: lines of the standard input, until it ends or somebody stops the walk.

    Attributes:
        stop: asked while nobody has answered yet; true: there is no answer.
    """

    def __init__(self) -> None:
        self.stop: Callable[[], bool] = lambda: False
        self._read = b""

    def answer(self, step: Regrasp, refused: str) -> str | None:
        """A line, "" for yes, or another hold; None at the end of the input or of the walk: nobody says yes."""
        if refused:
            err().print(refused, markup=False)
        question = f"{step.arm}: {step.source} -> {step.target}? [Enter: yes, another hold, or Ctrl-D: stop]"
        err().print(question, markup=False)
        return self._line()

    def _line(self) -> str | None:
        try:
            number = sys.stdin.fileno()
        except (OSError, ValueError):  # no file, as in a test
            line = sys.stdin.readline()
            return line.strip() if line else None
        # A line that waits in a buffer of sys.stdin would not be seen by select, and readline would not hear a stop
        while b"\n" not in self._read:
            if self.stop():
                return None
            if select.select([number], [], [], WAIT)[0]:
                some = os.read(number, 4096)
                if not some:
                    return None
                self._read += some
        line, _, self._read = self._read.partition(b"\n")
        return line.decode(errors="replace").strip()
