"""``wbc walk``: walks on holds, planned, carried out, checked and shown, a command a mode."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from wbc.cli.output import FOLDER, WALKED, WalkOutput, Where
from wbc.cli.reading import Option
from wbc.errors import RangeError
from wbc.walking.run.request import (
    ArmRequest,
    DriveRequest,
    PathRequest,
    PublishedRequest,
    ResumeRequest,
)
from wbc.walking.torque.choice import PlantChoice

if TYPE_CHECKING:
    from wbc.robots import Walker

_WHAT = "What it does"


@dataclass(frozen=True)
class Machine:
    """What walks."""

    arms: Annotated[int, "Of the body, 2 to 6; with more than three it is larger."] = 3
    set: Annotated[tuple[str, ...], "NAME=VALUE of the walker's data, in SI; may be repeated."] = ()

    def walker(self) -> Walker:
        """The machine.

        Raises:
            ShapeError, UnknownNameError, RangeError: no such arms, or changes of data that are none.
        """
        from wbc.cli.walking import body

        return body(self.arms, self.set)


Moved = Annotated[PlantChoice, "What walks"]
Walks = Annotated[Machine, "What walks"]
Writes = Annotated[WalkOutput, "How it is done, and what it writes"]
Ask = Annotated[bool, "Propose every re-grasp: a line is empty for yes, or another hold; at its end the walk stops."]


@dataclass(frozen=True)
class WalkPath:
    """Walk over places with a body of two to six arms.

    Leaves log, plan, check, pictures and a page. Ends with 3 if the walk is not possible or does not arrive, with 4 if
    the checker finds a violation. Ctrl-C ends it early; what was done until then is written all the same, and so is
    what a kill leaves.
    """

    request: Annotated[PathRequest, _WHAT]
    plant: Moved
    machine: Walks = Machine()
    output: Writes = WALKED
    ask: Ask = False
    least_time: Annotated[bool, "Least time of the plan's joint path, by toppra, among the figures."] = False

    def run(self) -> int:
        from wbc.cli.walking import WalkLines, carried_out
        from wbc.walking.run.session import mode_of

        free = self.request.free_start
        if free and self.plant.dynamic:
            reason = "a body that nothing holds is not fixed in it; --free-start is kinematic"
            raise RangeError("plant", self.plant.name, reason)
        if free and self.least_time:
            raise RangeError("least-time", True, "it is of a plan of arms that hold")
        lines = WalkLines() if self.ask else None
        mode = mode_of(self.request, self.machine.walker(), lines.answer if lines else None)
        return carried_out(mode, self.output, self.plant, lines, least_time=self.least_time)


@dataclass(frozen=True)
class DriveWalk:
    """Drive the body by rates, from a file or the keyboard."""

    request: Annotated[DriveRequest, _WHAT]
    plant: Moved
    machine: Walks = Machine()
    output: Writes = WALKED

    def run(self) -> int:
        from wbc.cli.console import tell
        from wbc.cli.walking import carried_out
        from wbc.terminal import terminal, terminal_keys
        from wbc.walking.modes.keyboard import HELP, KeyCommands
        from wbc.walking.run.session import mode_of

        if not self.request.commands:
            raise RangeError("commands", "", "give a file of rates, or keyboard")
        walker = self.machine.walker()
        with contextlib.ExitStack() as stack:
            commands = None
            if self.request.commands == "keyboard":
                terminal("commands")
                if self.plant.dynamic:
                    raise RangeError("plant", self.plant.name, "the keyboard drives the kinematic plant")
                tell(HELP)
                commands = KeyCommands(stack.enter_context(terminal_keys()))
            return carried_out(mode_of(self.request, walker, commands=commands), self.output, self.plant)


@dataclass(frozen=True)
class WalkArm:
    """Move one hand, while the body stands."""

    request: Annotated[ArmRequest, _WHAT]
    plant: Moved
    machine: Walks = Machine()
    output: Writes = WALKED

    def run(self) -> int:
        from wbc.cli.walking import carried_out
        from wbc.walking.run.session import mode_of

        return carried_out(mode_of(self.request, self.machine.walker()), self.output, self.plant)


@dataclass(frozen=True)
class Published:
    """Walk as the published planner does, on its cylinder."""

    request: Annotated[PublishedRequest, _WHAT]
    output: Annotated[Where, "What it writes"] = FOLDER

    def run(self) -> int:
        from wbc.cli.walking import published

        return published(self.request, self.output)


@dataclass(frozen=True)
class Resume:
    """Go on with a run, ended or killed, or begin it again.

    It keeps structure, robot, plant and rates.
    """

    request: Annotated[ResumeRequest, _WHAT]
    output: Writes = WALKED
    ask: Ask = False

    def run(self) -> int:
        from wbc.cli.walking import WalkLines, carried_out
        from wbc.walking.run.resume_mode import going_on, machine_walked, plant_walked
        from wbc.walking.run.session import mode_of

        folder, out = Path(self.request.folder), self.output.out
        if out is not None and out.resolve() == folder.resolve():
            raise RangeError("out", str(out), "this is the folder of the run that is gone on with; it needs its own")
        request, lines = going_on(self.request), WalkLines() if self.ask else None
        mode = mode_of(request, machine_walked(request, folder), lines.answer if lines else None)
        plant = PlantChoice.of_run(plant_walked(request, folder))
        return carried_out(mode, self.output, plant, lines, name="resumed")


@dataclass(frozen=True)
class CheckWalk:
    """Check the walk in a run's folder; exit code 4 if it violates anything."""

    folder: Annotated[Path, Option("Folder of a run, ended or killed.", placed=True)]

    def run(self) -> int:
        from wbc.cli.walking import checked

        return checked(self.folder)


@dataclass(frozen=True)
class Compare:
    """Show what two plans do differently, a line each; exit code 1 if anything."""

    one: Annotated[Path, Option("A plan.json, or the folder of a run.", placed=True)]
    other: Annotated[Path, Option("Another one.", placed=True)]

    def run(self) -> int:
        from wbc.cli.console import say
        from wbc.walking.planner.plan import differences, read_plan

        first, second = (read_plan(path / "plan.json" if path.is_dir() else path) for path in (self.one, self.other))
        lines = differences(first, second)
        for line in lines or [f"the same {len(first.regrasps)} re-grasps"]:
            say(line)
        return int(bool(lines))
