"""What a run is asked to do: one dataclass a mode, from Python, from what a user types, or from a run's log."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from math import isfinite
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from wbc import validation
from wbc.errors import RangeError, ShapeError
from wbc.walking.planner.objective import OBJECTIVES, Objective
from wbc.walking.run.places import GridPlace, Place, grid_place, over_holds

if TYPE_CHECKING:
    from wbc.multibody import pin
    from wbc.robots import WalkerData
    from wbc.walking.body_path import BodyPath
    from wbc.walking.holds.structure import Structure

#: The structure with a grid of places
GRID = "cylinder"
#: Where a walk begins and ends on a built-in structure when nothing is said
ENDS = {
    "cylinder": ("13,6", "13,18"),
    "plane": ("8,6", "8,17"),
    "truss": ("L2,6", "L2,18"),
    "module": ("15,4", "15,14"),
}
#: 4 in/s, and [rad/s]
SPEED, TURN_RATE = 0.1016, 0.05


@dataclass(frozen=True)
class Site:
    """On what: a structure less the holds that are taken away.

    Attributes:
        structure: cylinder, plane, truss, module, or FILE.csv.
        rows: Holds T,A that are taken away by A, such as 12-14.
        columns: Holds T,A that are taken away by T.
        fraction: Part of the holds that is taken away at random [1].
        seed: Of the random choice.
        rigid: Holds fix the tilt of a hand.
    """

    structure: str = GRID
    rows: str = field(default="", metadata={"option": "remove-rows"})
    columns: str = field(default="", metadata={"option": "remove-columns"})
    fraction: float = field(default=0.0, metadata={"option": "remove"})
    seed: int = 0
    rigid: bool = False

    def build(self) -> Structure:
        """The structure less the holds that are taken away.

        Raises:
            UnknownNameError: no such structure. StructureFileError: a bad file. RangeError, ShapeError: holds that are
                not there, or none left.
        """
        from wbc.walking.holds.built_in import remove_columns, remove_fraction, remove_rows

        whole = self.whole()
        if self.rows:
            whole = remove_rows(whole, self.rows)
        if self.columns:
            whole = remove_columns(whole, self.columns)
        return remove_fraction(whole, self.fraction, self.seed)

    def whole(self) -> Structure:
        """With all its holds."""
        from wbc.walking.holds.built_in import BUILT_IN
        from wbc.walking.holds.files import read_structure

        make: Callable[..., Structure] | None = dict[str, Any](BUILT_IN).get(self.structure)
        if make is not None:
            return make(max_tilt=0.0) if self.rigid else make()
        if self.rigid:
            raise RangeError("rigid", self.rigid, "a file says itself what its holds allow")
        named = "/" in self.structure or self.structure.lower().endswith(".csv")
        if named or validation.is_file("structure", self.structure):
            return read_structure(self.structure)
        validation.one_of("structure", self.structure, (*BUILT_IN, "FILE.csv"))
        raise RangeError("structure", self.structure, "no such file")


@dataclass(frozen=True)
class Route:
    """Where a body with arms goes, and how fast.

    On the cylinder a place is a :class:`GridPlace`, or text T,A or T,A,heading [degrees]; else it is the id of a hold,
    x of the body towards the next one. Without any, the walk is from end to end, see :data:`ENDS`.

    Attributes:
        site: Or the name of its structure.
        start: Place that the body begins over: T,A[,DEGREES] on the cylinder, else a hold's id.
        points: Place that it goes to; may be repeated.
        speed: Largest of the body's origin in the structure's frame [m/s].
        turn_rate: Largest rate of turning [rad/s].

    Raises:
        ShapeError: no place, or a structure file, and not both ends given. RangeError: a place beside the grid, or no
            speed above 0.
    """

    site: Site = Site()
    start: Place = field(default="", metadata={"option": "from"})
    points: tuple[Place, ...] = field(default=(), metadata={"option": "to"})
    speed: float = SPEED
    turn_rate: float = TURN_RATE

    #: Whether the body has to have somewhere to go
    goes: ClassVar[bool] = True

    def __post_init__(self) -> None:
        site = Site(self.site) if isinstance(self.site, str) else validation.instance("site", self.site, Site, "a Site")
        first, last = ENDS.get(site.structure, ("", ""))
        points = tuple(validation.items("to", self.points, "places")) or ((last,) if last else ())
        places: list[Place] = [self.start or first, *points]
        if not all(places) or (self.goes and not points):
            site.whole()  # where there is no such structure, that is what is wrong
            raise ShapeError("to", self.points, "say from which to which hold; a file has no ends of its own")
        for k, place in enumerate(places):
            if site.structure == GRID:
                places[k] = grid_place(f"place {k + 1}", place)
            else:
                validation.instance(f"place {k + 1}", place, str, "the id of a hold")
        for name, value in (("site", site), ("start", places[0]), ("points", tuple(places[1:]))):
            object.__setattr__(self, name, value)
        for name in ("speed", "turn_rate"):
            validation.scalar(name, getattr(self, name), low=0.0, open_low=True)

    def path(self, data: WalkerData) -> BodyPath:
        """Over the grid of the cylinder, else from over hold to over hold.

        Raises:
            ShapeError, RangeError, UnknownNameError: places that are not there.
        """
        from wbc.walking.body_path import grid_path, straight_path

        places = (self.start, *self.points)
        grid = [place for place in places if isinstance(place, GridPlace)]
        if grid:
            return grid_path(grid, self.speed, self.turn_rate, data.body_height)
        # Holds that were taken away still are places to be over
        names = [place for place in places if isinstance(place, str)]
        return straight_path(over_holds(self.site.whole(), names, data.body_height), self.speed, self.turn_rate)

    def beginning(self, data: WalkerData) -> pin.SE3:
        """Where the body is at first.

        Raises:
            as :meth:`path`.
        """
        from wbc.multibody import pin

        route = self if self.points else replace(self, points=(self.start,))
        return pin.SE3(route.path(data).poses[0])


@dataclass(frozen=True)
class PathRequest(Route):
    """The body goes over places, by a plan of the hands.

    Attributes:
        objective: Of the plan: velocity: at the speed, fewest delays first; destination: fewest re-grasps first.
        free_start: Nothing is held at the beginning, and the body is declared fixed until enough hands hold.
        plan: A plan.json, which is carried out as it is along its own path, instead of planning.
    """

    objective: Objective = "velocity"
    free_start: bool = False
    plan: str = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        validation.one_of("objective", self.objective, OBJECTIVES)
        if self.plan and self.free_start:
            raise RangeError("plan", self.plan, "plans of files are of three arms that hold")


@dataclass(frozen=True)
class PublishedRequest(Route):
    """As :class:`PathRequest`, by the published planner, which knows only the cylinder.

    Attributes:
        objective: velocity: from point to point at the speed; destination: fewest re-grasps.
    """

    objective: Objective = "velocity"

    def __post_init__(self) -> None:
        super().__post_init__()
        validation.one_of("objective", self.objective, OBJECTIVES)
        if self.site.structure != GRID:
            raise RangeError("planner", "published", f"the published planner knows only the structure {GRID!r}")


@dataclass(frozen=True)
class DriveRequest(Route):
    """The body stands over the start, x towards the first of the points, and is driven by rates.

    Attributes:
        commands: Rates: a CSV or npz file with columns t, T, A, spin [s, m/s, m/s, rad/s], or keyboard.
    """

    commands: str = field(default="", metadata={"placed": True})
    goes: ClassVar[bool] = False


TaskKind = Literal["hold", "poses", "rate"]
#: Columns of a file of poses: origin [m], z axis, and a direction whose part across it is the x axis
POSES = ("x", "y", "z", "ax", "ay", "az", "rx", "ry", "rz")


@dataclass(frozen=True)
class ArmTask:
    """What a hand is to do.

    Attributes:
        kind: to a hold, through poses, or by a twist for a time. text: as it was asked for.
        hold: its id. poses: positions [m] and quaternions x, y, z, w. twist: [m/s, rad/s]. seconds: [s].
    """

    kind: TaskKind
    text: str
    hold: str = ""
    poses: tuple[tuple[float, ...], ...] = ()
    twist: tuple[float, ...] = ()
    seconds: float = 0.0


def arm_task(text: str) -> ArmTask:
    """A task from what a user types; whether there is such a hold is not asked here:

        hold ID                                  go to a hold and close
        poses FILE                               through poses, a table with columns x, y, z, ax, ay, az, rx, ry, rz
        rate vx,vy,vz,wx,wy,wz for SECONDS       a twist in the structure's axes [m/s, rad/s]

    Raises:
        ShapeError: it is none. NumberTableError, RangeError: a file of poses.
    """
    kind, _, rest = text.strip().partition(" ")
    rest = rest.strip()
    if kind == "hold" and rest:
        return ArmTask("hold", text, hold=rest)
    if kind == "poses" and rest:
        from wbc.multibody import pin
        from wbc.walking.holds.hold import frame_of
        from wbc.walking.modes.commands import read_numbers

        rows = read_numbers(rest, POSES)
        poses = (frame_of(f"row {k + 1}", row[:3], row[3:6], row[6:]) for k, row in enumerate(rows))
        return ArmTask("poses", text, poses=tuple(tuple(pin.SE3ToXYZQUAT(pose).tolist()) for pose in poses))
    if kind == "rate":
        numbers, _, seconds = rest.partition(" for ")
        try:
            twist, duration = tuple(float(part) for part in numbers.split(",")), float(seconds)
        except ValueError as error:
            raise ShapeError("do", text, "expected 'rate vx,vy,vz,wx,wy,wz for SECONDS'") from error
        if len(twist) != 6 or not all(map(isfinite, (*twist, duration))) or duration <= 0.0:
            raise ShapeError("do", text, "expected six rates and a time above 0")
        return ArmTask("rate", text, twist=twist, seconds=duration)
    raise ShapeError("do", text, "expected 'hold ID', 'poses FILE' or 'rate vx,vy,vz,wx,wy,wz for SECONDS'")


@dataclass(frozen=True)
class ArmRequest(Route):
    """The body stands as that of :class:`DriveRequest`, and one hand does some tasks.

    Attributes:
        arm: The arm that moves. Default: the first.
        tasks: 'hold ID', 'poses FILE' or 'rate vx,vy,vz,wx,wy,wz for SECONDS' [m/s, rad/s]; may be repeated.

    Raises:
        ShapeError, NumberTableError, RangeError: no tasks, or one that is none.
    """

    arm: str = ""
    tasks: tuple[ArmTask, ...] = field(default=(), metadata={"option": "do"})
    goes: ClassVar[bool] = False

    def __post_init__(self) -> None:
        super().__post_init__()
        given = validation.items("do", self.tasks, "tasks")
        tasks = tuple(arm_task(task) if isinstance(task, str) else task for task in given)
        if not tasks:
            raise RangeError("do", tasks, "say what the hand is to do in the mode 'arm'")
        object.__setattr__(self, "tasks", tasks)


@dataclass(frozen=True)
class ResumeRequest:
    """A run goes on, at rest in the state that its log has at a time, to its end.

    Attributes:
        folder: Of the run, ended or killed.
        at: Time of the state that it goes on from [s]. Default: the last one.
        points: Where to go, as of a path; may be repeated. Default: where the run was to go, by the path that it found.
    """

    folder: str | os.PathLike[str] = field(metadata={"placed": True})
    at: float | None = None
    points: tuple[Place, ...] = field(default=(), metadata={"option": "to"})

    def __post_init__(self) -> None:
        object.__setattr__(self, "folder", validation.file_path("resume", self.folder))
        object.__setattr__(self, "points", tuple(validation.items("to", self.points, "places")))
        if self.at is not None and (isinstance(self.at, bool) or not isinstance(self.at, (int, float))):
            raise ShapeError("resume.at", self.at, "expected a time in s")


Request = PathRequest | PublishedRequest | DriveRequest | ArmRequest
