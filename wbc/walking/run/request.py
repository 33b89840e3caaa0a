"""What a run is asked to do: one dataclass a mode, from Python, from what a user types, or from a run's log."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from typing import Any, ClassVar, Literal

import numpy as np
import pinocchio as pin

from wbc import validation
from wbc.errors import RangeError, ShapeError, WbcError
from wbc.robots import WalkerData
from wbc.walking.body_path import BodyPath, grid_path, straight_path
from wbc.walking.holds.built_in import BUILT_IN, remove_columns, remove_fraction, remove_rows
from wbc.walking.holds.files import read_structure
from wbc.walking.holds.hold import frame_of
from wbc.walking.holds.structure import Structure
from wbc.walking.log.log import WalkLogError
from wbc.walking.modes.commands import read_numbers
from wbc.walking.planner.planner import Objective
from wbc.walking.run.places import GridPlace, Place, grid_place, over_holds
from wbc.walking.two_ended import grapple_row
from wbc.walking.two_ended.search import GAITS

OBJECTIVES: tuple[Objective, ...] = ("destination", "velocity")
MODES = (*OBJECTIVES, "arm")
PLANNERS = ("free", "published")
ROBOTS = ("three-armed", "two-ended")
#: The structure with a grid of places, and the row of holds for the two-ended arm
GRID, GRAPPLES = "cylinder", "grapples"
#: Where a walk begins and ends on a built-in structure when nothing is said
ENDS = {
    "cylinder": ("13,6", "13,18"),
    "plane": ("8,6", "8,17"),
    "truss": ("L2,6", "L2,18"),
    "module": ("15,4", "15,14"),
}
TWO_ENDED_ENDS = ("1", "2"), "6"
#: 4 in/s, and [rad/s]
SPEED, TURN_RATE = 0.1016, 0.05


@dataclass(frozen=True)
class Site:
    """On what: a structure less the holds that are taken away.

    Attributes:
        structure: ``cylinder``, ``plane``, ``truss``, ``module``, ``grapples`` or a structure file.
        rows, columns: holds "T,A" that are taken away, such as ``12-14``, by A and by T.
        fraction, seed: part of the holds that is taken away at random.
        rigid: holds fix the tilt of a hand.
    """

    structure: str = GRID
    rows: str = ""
    columns: str = ""
    fraction: float = 0.0
    seed: int = 0
    rigid: bool = False

    def build(self) -> Structure:
        """The structure less the holds that are taken away.

        Raises:
            UnknownNameError: no such structure. StructureFileError: a bad file. RangeError, ShapeError: holds that are
                not there, or none left.
        """
        whole = self.whole()
        if self.rows:
            whole = remove_rows(whole, self.rows)
        if self.columns:
            whole = remove_columns(whole, self.columns)
        return remove_fraction(whole, self.fraction, self.seed)

    def whole(self) -> Structure:
        """With all its holds."""
        if self.structure == GRAPPLES:
            if self.rigid:
                raise RangeError("rigid", self.rigid, "these holds fix the tilt of a hand anyway")
            return grapple_row()
        make: Callable[..., Structure] | None = dict[str, Any](BUILT_IN).get(self.structure)
        if make is not None:
            return make(max_tilt=0.0) if self.rigid else make()
        if self.rigid:
            raise RangeError("rigid", self.rigid, "a file says itself what its holds allow")
        named = "/" in self.structure or self.structure.lower().endswith(".csv")
        if named or validation.is_file("structure", self.structure):
            return read_structure(self.structure)
        validation.one_of("structure", self.structure, (*BUILT_IN, GRAPPLES, "FILE.csv"))
        raise RangeError("structure", self.structure, "no such file")


@dataclass(frozen=True)
class Route:
    """Where a body with arms goes, and how fast.

    Attributes:
        site: or the name of its structure.
        start, points: places that the body is over at the beginning and then. On the cylinder :class:`GridPlace`, or
            text ``T,A`` or ``T,A,heading`` [deg]; else ids of holds, x of the body towards the next one. Empty:
            :data:`ENDS`.
        speed: of the body's origin in the structure's frame [m/s]. turn_rate: largest [rad/s].

    Raises:
        ShapeError: no place, or a structure file, and not both ends given. RangeError: a place beside the grid, or no
            speed above 0.
    """

    site: Site = Site()
    start: Place = ""
    points: tuple[Place, ...] = ()
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
        route = self if self.points else replace(self, points=(self.start,))
        return pin.SE3(route.path(data).poses[0])


@dataclass(frozen=True)
class PathRequest(Route):
    """The body goes over places, by a plan of the hands.

    Attributes:
        objective: ``velocity``: at the speed, fewest delays first; ``destination``: fewest re-grasps first.
        free_start: nothing is held at the beginning, and the body is declared fixed until enough hands hold.
        plan: a file of a plan, which is carried out as it is along its own path; "": plan.
    """

    objective: Objective = "velocity"
    free_start: bool = False
    plan: str = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        validation.one_of("mode", self.objective, OBJECTIVES)
        if self.plan and self.free_start:
            raise RangeError("plan", self.plan, "plans of files are of three arms that hold")


@dataclass(frozen=True)
class PublishedRequest(Route):
    """As :class:`PathRequest`, by the published planner, which knows only the cylinder."""

    objective: Objective = "velocity"

    def __post_init__(self) -> None:
        super().__post_init__()
        validation.one_of("mode", self.objective, OBJECTIVES)
        if self.site.structure != GRID:
            raise RangeError("planner", "published", f"the published planner knows only the structure {GRID!r}")


@dataclass(frozen=True)
class DriveRequest(Route):
    """The body stands over the start, x towards the first of the points, and is driven by rates.

    Attributes:
        commands: a file of rates, or ``keyboard`` or another word for what else drives it.
    """

    commands: str = ""
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
        rows = read_numbers(rest, POSES)
        poses = (frame_of(f"row {k + 1}", row[:3], row[3:6], row[6:]) for k, row in enumerate(rows))
        return ArmTask("poses", text, poses=tuple(tuple(pin.SE3ToXYZQUAT(pose).tolist()) for pose in poses))
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


@dataclass(frozen=True)
class ArmRequest(Route):
    """The body stands as that of :class:`DriveRequest`, and one hand does some tasks.

    Attributes:
        arm: its name; "": the first. tasks: or their texts, see :func:`arm_task`.

    Raises:
        ShapeError, NumberTableError, RangeError: no tasks, or one that is none.
    """

    arm: str = ""
    tasks: tuple[ArmTask, ...] = ()
    goes: ClassVar[bool] = False

    def __post_init__(self) -> None:
        super().__post_init__()
        given = validation.items("do", self.tasks, "tasks")
        tasks = tuple(arm_task(task) if isinstance(task, str) else task for task in given)
        if not tasks:
            raise RangeError("do", tasks, "say what the hand is to do in the mode 'arm'")
        object.__setattr__(self, "tasks", tasks)


@dataclass(frozen=True)
class TwoEndedRequest:
    """The two-ended arm goes end over end.

    Attributes:
        site: or the name of its structure. start: ids of the holds of ``arm1`` and ``arm2``.
        goal: id of the hold, or the place [m], to go to. gait: ``any``, ``inchworm`` or ``turnaround``.
    """

    site: Site = Site(GRAPPLES)
    start: tuple[str, str] = TWO_ENDED_ENDS[0]
    goal: str | tuple[float, float, float] = TWO_ENDED_ENDS[1]
    gait: str = "any"

    def __post_init__(self) -> None:
        site = Site(self.site) if isinstance(self.site, str) else validation.instance("site", self.site, Site, "a Site")
        start = validation.strings("from", self.start)
        if len(start) != 2:
            raise ShapeError("from", start, "expected two holds, 'ID1 ID2'")
        goal: Any = self.goal
        if not isinstance(goal, str):
            goal = tuple(validation.real_array("to", goal, (3,)).tolist())
        for name, value in (("site", site), ("start", start), ("goal", goal)):
            object.__setattr__(self, name, value)
        validation.one_of("gait", self.gait, tuple(GAITS))


Request = PathRequest | PublishedRequest | DriveRequest | ArmRequest | TwoEndedRequest
#: Names of the modes in records
KINDS: Mapping[str, type[Any]] = {
    "path": PathRequest,
    "published": PublishedRequest,
    "drive": DriveRequest,
    "arm": ArmRequest,
    "two-ended": TwoEndedRequest,
}


def read_request(
    structure: str = "",
    mode: str = "velocity",
    speed: float = SPEED,
    turn_rate: float = TURN_RATE,
    start: str = "",
    points: Sequence[str] = (),
    rows: str = "",
    columns: str = "",
    fraction: float = 0.0,
    seed: int = 0,
    planner: str = "free",
    rigid: bool = False,
    commands: str = "",
    arm: str = "",
    tasks: Sequence[str] = (),
    free_start: bool = False,
    robot: str = "three-armed",
    gait: str = "any",
    plan: str = "",
) -> Request:
    """The request that a user types: the options of ``wbc walk``.

    Raises:
        UnknownNameError: no such mode, planner, robot or gait. RangeError: what the mode does not take. What the
            requests raise.
    """
    validation.one_of("mode", mode, MODES)
    validation.one_of("planner", planner, PLANNERS)
    validation.one_of("robot", robot, ROBOTS)
    validation.one_of("gait", gait, tuple(GAITS))
    if commands and mode != "velocity":
        raise RangeError("commands", commands, "they are for the mode 'velocity'")
    if (mode == "arm") != bool(tasks):
        raise RangeError("do", tasks, "say what the hand is to do in the mode 'arm', and in no other")
    published, two_ended, stands = planner == "published", robot == "two-ended", bool(commands or tasks)
    if published and (stands or free_start):
        raise RangeError("planner", planner, "commands, arm mode and a free start are of the planner 'free'")
    if plan and (two_ended or stands or free_start or published):
        raise RangeError("plan", plan, "plans of files are of three arms that hold, and of the planner 'free'")
    if two_ended and (stands or free_start or published):
        raise RangeError("robot", robot, "the two-ended arm goes to a hold or a place, by the planner 'free'")
    if gait != "any" and not two_ended:
        raise RangeError("gait", gait, "gaits are of the robot 'two-ended'")
    site = Site(structure or (GRAPPLES if two_ended else GRID), rows, columns, fraction, seed, rigid)
    if two_ended:
        for name, value in (("speed", speed), ("turn_rate", turn_rate)):
            validation.scalar(name, value, low=0.0, open_low=True)
        return two_ended_request(site, start, points, gait)
    objective: Objective = "velocity" if mode == "velocity" else "destination"
    route: dict[str, Any] = {"site": site, "start": start, "points": tuple(points)}
    route |= {"speed": speed, "turn_rate": turn_rate}
    if published:
        return PublishedRequest(**route, objective=objective)
    if commands:
        return DriveRequest(**route, commands=commands)
    if tasks:
        return ArmRequest(**route, arm=arm, tasks=tuple(arm_task(text) for text in tasks))
    return PathRequest(**route, objective=objective, free_start=free_start, plan=plan)


def two_ended_request(site: Site, start: str, points: Sequence[str], gait: str) -> TwoEndedRequest:
    """A goal is a hold if there is such a one, else a place x,y,z."""
    ends = TWO_ENDED_ENDS if site.structure == GRAPPLES else ((), "")
    first, goals = tuple(start.split()) or ends[0], tuple(points) or (ends[1],)
    if len(first) != 2 or len(goals) != 1 or not goals[0]:
        raise ShapeError("from, to", (start, *goals), "expected two holds, 'ID1 ID2', and one hold or place x,y,z")
    structure = site.build()
    for name in first:
        structure.index(name)
    goal = goals[0]
    if goal not in structure:
        try:
            place = [float(part) for part in goal.split(",")]
        except ValueError:
            place = []
        if len(place) == 3:
            return TwoEndedRequest(site, (first[0], first[1]), (place[0], place[1], place[2]), gait)
    structure.index(goal)
    return TwoEndedRequest(site, (first[0], first[1]), goal, gait)


def record_of(request: Request) -> dict[str, Any]:
    """A request as plain data, for the log of its run; :func:`request_of` reads it."""
    kind = next(name for name, cls in KINDS.items() if type(request) is cls)
    return {"kind": kind, **asdict(request)}


def request_of(record: Any) -> Request:
    """The request of a log: what :func:`record_of` made, or the texts that logs had before.

    Raises:
        WalkLogError: it is none.
    """
    try:
        values = dict(record)
        if "kind" not in values:
            return read_request(**values)
        kind = KINDS[values.pop("kind")]
        known = {field.name for field in fields(kind)}
        if values.keys() - known:
            raise KeyError(min(values.keys() - known))
        values["site"] = Site(**values["site"])
        if "tasks" in values:
            values["tasks"] = tuple(_task(**task) for task in values["tasks"])
        request: Request = kind(**values)
        return request
    except (KeyError, TypeError, ValueError, WbcError) as error:
        reason = f"the log does not say what the run was asked to do: {error}"
        raise WalkLogError("request", type(record).__name__, reason) from error


def _task(**values: Any) -> ArmTask:
    values["poses"] = tuple(tuple(float(x) for x in pose) for pose in values["poses"])
    return ArmTask(**{**values, "twist": tuple(values["twist"])})
