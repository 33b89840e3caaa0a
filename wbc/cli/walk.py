"""``wbc walk``: any limbs on any scene, planned, carried out, checked and shown, a command a mode."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

from wbc.cli.output import FOLDER, WALKED, WalkOutput, Where
from wbc.cli.reading import Option
from wbc.climb.request import (
    DEFAULT_SPEED,
    KEYBOARD,
    ClimberRequest,
    ClimbRequest,
    DriveRequest,
    LimbRequest,
    Objective,
    PathRequest,
    PlantRequest,
    RemovedFootholds,
    SceneRequest,
)
from wbc.errors import RangeError

_WHAT = "What it does"
#: The whole published cylinder
NONE_REMOVED = RemovedFootholds()
What = Annotated[ClimberRequest, "What climbs"]
OnWhat = Annotated[SceneRequest, "On what"]
ByWhat = Annotated[PlantRequest, "What moves, and what happens meanwhile"]
Writes = Annotated[WalkOutput, "How it is done, and what it writes"]
Asks = Annotated[bool, "Propose every move: a line is empty for yes, or another foothold; at its end the walk stops."]


@dataclass(frozen=True)
class WalkPath:
    """Walk and climb over places with any limbs.

    Leaves what was asked, log, plan, check, figures, pictures and pages. Ends with 3 if there is no plan or it does not
    arrive, with 4 if the checker finds a violation. Ctrl-C ends it early; what was done until then is written all the
    same, and so is what a kill leaves.

    Example: wbc walk --robot anymal_c --scene stairs
    """

    mode: Annotated[PathRequest, _WHAT]
    climber: What
    scene: OnWhat
    plant: ByWhat
    output: Writes = WALKED
    ask: Asks = False

    def run(self) -> int:
        from wbc.cli.climbing import carried_out

        return carried_out(ClimbRequest(self.mode, self.climber, self.scene, self.plant), self.output, asks=self.ask)


@dataclass(frozen=True)
class DriveWalk:
    """Drive the body by rates, from a file, from texts or by the keyboard.

    Example: wbc walk drive --rate "0.05,0,0,0,0,0 for 4" --rate "0,0,0,0,0,0.05 for 2"
    """

    mode: Annotated[DriveRequest, _WHAT]
    climber: What
    scene: OnWhat
    plant: ByWhat
    output: Writes = WALKED

    def run(self) -> int:
        from wbc.cli.climbing import carried_out
        from wbc.cli.console import tell
        from wbc.cli.keys import HELP, KeyTwists
        from wbc.terminal import terminal, terminal_keys

        request = ClimbRequest(self.mode, self.climber, self.scene, self.plant)
        with contextlib.ExitStack() as stack:
            keys = None
            if self.mode.commands == KEYBOARD:
                terminal("commands")
                tell(HELP)
                keys = KeyTwists(stack.enter_context(terminal_keys()))
            return carried_out(request, self.output, twists=keys)


@dataclass(frozen=True)
class WalkLimb:
    """Move one limb, while the body stands and the others hold.

    Example: wbc walk limb --limb arm2 --do "rate 0.007,0.08,0,0,0,0 for 1.5" --do "hold 15,12" --from 13,11
    """

    mode: Annotated[LimbRequest, _WHAT]
    climber: What
    scene: OnWhat
    plant: ByWhat
    output: Writes = WALKED

    def run(self) -> int:
        from wbc.cli.climbing import carried_out

        return carried_out(ClimbRequest(self.mode, self.climber, self.scene, self.plant), self.output)


@dataclass(frozen=True)
class Published:
    """Walk as the published planner does, on its cylinder.

    Attributes:
        start: place that the body begins over: T,A[,DEGREES].
        points: place that it goes to; may be repeated.
        objective: velocity: from place to place at the speed; destination: fewest moves.
        speed: of the body [m/s].
        turn_rate: of the body [rad/s].
    """

    start: str = field(default="13,6", metadata={"option": "from"})
    points: tuple[str, ...] = field(default=("13,18",), metadata={"option": "to"})
    objective: Objective = "velocity"
    speed: float = DEFAULT_SPEED
    turn_rate: float = 0.05
    removed: Annotated[RemovedFootholds, "On what"] = NONE_REMOVED
    output: Annotated[Where, "What it writes"] = FOLDER

    def run(self) -> int:
        from wbc.cli.climbing import published

        places, speeds = (self.start, *self.points), (self.speed, self.turn_rate)
        return published(self.removed, places, self.objective, speeds, self.output)


@dataclass(frozen=True)
class Resume:
    """Go on with a run, ended or killed, or begin it again.

    It keeps scene, robot, plant and speeds.
    """

    folder: Annotated[Path, Option("Folder of a run, ended or killed.", placed=True)]
    at: Annotated[float | None, "Time in its log that it goes on from [s]. Default: the end."] = None
    to: Annotated[tuple[str, ...], "Place to go to; may be repeated. Default: where the run was to go."] = ()
    output: Writes = WALKED
    ask: Asks = False

    def run(self) -> int:
        from wbc.cli.climbing import carried_out
        from wbc.climb.folder import resumed

        out = self.output.out
        if out is not None and out.resolve() == self.folder.resolve():
            raise RangeError("out", str(out), "this is the folder of the run that is gone on with; it needs its own")
        return carried_out(resumed(self.folder, self.at, self.to), self.output, asks=self.ask)


@dataclass(frozen=True)
class CheckWalk:
    """Check the run in a folder; exit code 4 if it violates anything."""

    folder: Annotated[Path, Option("Folder of a run, ended or killed.", placed=True)]

    def run(self) -> int:
        from wbc.cli.climbing import checked

        return checked(self.folder)


@dataclass(frozen=True)
class Compare:
    """Show what two plans do differently, a line each; exit code 1 if anything."""

    one: Annotated[Path, Option("A plan.npz, or the folder of a run.", placed=True)]
    other: Annotated[Path, Option("Another one.", placed=True)]

    def run(self) -> int:
        from wbc.cli.console import say
        from wbc.climb.plan_files import differences, read_record

        first, second = read_record(self.one), read_record(self.other)
        lines = differences(first, second)
        for line in lines or [f"the same {len(first.tables['moves'])} moves"]:
            say(line)
        return int(bool(lines))
