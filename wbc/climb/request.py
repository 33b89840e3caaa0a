"""What a climb is to be: plain data, as a command line or a run's folder has it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from typing import Any, Literal, get_args

from wbc import validation
from wbc.errors import RangeError, ShapeError, WbcError
from wbc.log import LogFileError

#: How limbs of a robot's file hold
Holding = Literal["point", "flat", "grip", "rolling-grip", "suction"]
#: What moves the robot
PlantName = Literal["kinematic", "mujoco", "pinocchio"]
#: What a path is planned for
Objective = Literal["velocity", "destination"]
#: The plant without torques
KINEMATIC = "kinematic"
#: In place of a file of rates
KEYBOARD = "keyboard"
#: Built-in structures, of ``wbc.climb.grids``
GRID_NAMES = ("cylinder_grid", "plane_grid", "truss_grid", "module")
#: 4 in/s
DEFAULT_SPEED = 0.1016


@dataclass(frozen=True)
class ClimberRequest:
    """What climbs.

    Attributes:
        robot: a name of ``wbc.climb.machines``, or a URDF or MJCF file.
        arms: of the published walker, 2 to 6; with more than three its body is larger.
        set: NAME=VALUE of the published walker's data, in SI; may be repeated.
        limbs: of a file, frames at the tips of its limbs; their z axes point out of what they hold. A point may be the
            centre of a ball; of flat feet any frames of their links.
        hold: of a file, how its limbs hold.
        friction: of a file's feet [1].
    """

    robot: str = "walker"
    arms: int = 3
    set: tuple[str, ...] = ()
    limbs: tuple[str, ...] = ()
    hold: Holding = "point"
    friction: float = 0.6


@dataclass(frozen=True)
class RemovedFootholds:
    """Footholds that are taken away.

    Attributes:
        remove: share of the footholds that is taken away at random [1].
        remove_rows: footholds T,A that are taken away by A, such as 12-14.
        remove_columns: footholds T,A that are taken away by T.
        seed: of what is random.
    """

    remove: float = 0.0
    remove_rows: str = ""
    remove_columns: str = ""
    seed: int = 0


@dataclass(frozen=True)
class SceneRequest(RemovedFootholds):
    """What is climbed.

    Attributes:
        scene: cylinder_grid, plane_grid, truss_grid or module, a family of ``wbc.climb.scenes``, drawn at the robot's
            size, or a file of a structure.
        density: share of footholds of a family that are there [1].
        gravity: x, y, z [m/s^2]. Default: that of the family or file; none elsewhere.
    """

    scene: str = "cylinder_grid"
    density: float = 0.8
    gravity: tuple[float, float, float] | None = None


@dataclass(frozen=True)
class PlantRequest:
    """What moves, and what happens meanwhile.

    Attributes:
        plant: kinematic, which does as commanded; mujoco, and pinocchio where all limbs grip, take torques.
        slippery: part of the planned friction that feet have [1].
        mass_error: largest relative error of the links' masses [1].
        payload: mass on the body, which the loop does not know [kg].
        rubbing: friction of every joint, Coulomb's and as a rate viscous [N m, N m s; N, N s/m].
        delay: of the torques, which the loop knows [s].
        fault: "slip LIMB METRES at SECONDS", "limp JOINT at SECONDS", "break LIMB at SECONDS" or "delay SECONDS"; may
            be repeated.
        vanish: "FOOTHOLD at SECONDS": it is gone from then on; may be repeated.
        fail: "LIMB at SECONDS": it holds no more from then on; may be repeated.
    """

    plant: PlantName = "kinematic"
    slippery: float = 1.0
    mass_error: float = 0.0
    payload: float = 0.0
    rubbing: float = 0.0
    delay: float = 0.0
    fault: tuple[str, ...] = ()
    vanish: tuple[str, ...] = ()
    fail: tuple[str, ...] = ()


@dataclass(frozen=True)
class PathRequest:
    """The body goes over places, one after the other.

    A place is T,A[,DEGREES] on a grid, else the id of a foothold.

    Attributes:
        start: place that the body begins over. Default: that of the scene.
        points: place that it goes to; may be repeated. Default: the end of the scene.
        objective: velocity: along the way at the speed, as far as there are footholds for that; destination: fewest
            moves of limbs, at most so fast.
        speed: of the body's origin at most [m/s]; 0: as fast as joints let it. Default: 0.1016 on built-in structures,
            else 0.
        turn_rate: of the body at most [rad/s].
        planning_time: that a plan over stances may take at most, on the way too [s]; inf: as long as it takes.
        plan: a plan.npz, which is carried out as it is in place of planning.
    """

    start: str = field(default="", metadata={"option": "from"})
    points: tuple[str, ...] = field(default=(), metadata={"option": "to"})
    objective: Objective = "velocity"
    speed: float | None = None
    turn_rate: float = 0.1
    planning_time: float = 120.0
    plan: str = ""


@dataclass(frozen=True)
class DriveRequest:
    """The body is driven by rates along its own axes.

    On a cylinder they go along and round it: the body turns as the cylinder does under it.

    Attributes:
        commands: a CSV or npz file with t, vx, vy, vz and, where it turns, wx, wy, wz [s, m/s, rad/s], or keyboard.
        rate: "VX,VY,VZ,WX,WY,WZ for SECONDS" in place of a file [m/s, rad/s]; may be repeated.
        start: place that the body begins over. Default: that of the scene.
    """

    commands: str = field(default="", metadata={"placed": True})
    rate: tuple[str, ...] = ()
    start: str = field(default="", metadata={"option": "from"})


@dataclass(frozen=True)
class LimbRequest:
    """The body stands, and one limb works while the others hold.

    Attributes:
        limb: which. Default: the first.
        do: "hold FOOTHOLD", "poses FILE" (columns x,y,z,qx,qy,qz,qw) or "rate VX,VY,VZ,WX,WY,WZ for SECONDS" along the
            world's axes [m/s, rad/s]; may be repeated.
        start: place that the body is over. Default: that of the scene.
    """

    limb: str = ""
    do: tuple[str, ...] = ()
    start: str = field(default="", metadata={"option": "from"})


@dataclass(frozen=True)
class EarlierRun:
    """A run that a climb goes on with.

    Attributes:
        folder: of that run. at: time in its log [s]. passed: time before that log, for what happens meanwhile [s].
    """

    folder: str
    at: float
    passed: float = 0.0


Mode = PathRequest | DriveRequest | LimbRequest
#: Names of the modes in files
KINDS: Mapping[str, type[Any]] = {"path": PathRequest, "drive": DriveRequest, "limb": LimbRequest}


@dataclass(frozen=True)
class ClimbRequest:
    """What climbs what, by what, and what it does.

        ClimbRequest(PathRequest(points=("13,12",)), scene=SceneRequest(remove=0.2))

    Attributes:
        mode: what it does. climber: what climbs. scene: what is climbed. plant: what moves.
        earlier: a run of the same climber in the same scene that it goes on with; None: it begins.
    """

    mode: Mode = PathRequest()
    climber: ClimberRequest = ClimberRequest()
    scene: SceneRequest = SceneRequest()
    plant: PlantRequest = PlantRequest()
    earlier: EarlierRun | None = None

    def __post_init__(self) -> None:
        for name, kind in (
            ("mode", Mode),
            ("climber", ClimberRequest),
            ("scene", SceneRequest),
            ("plant", PlantRequest),
        ):
            if not isinstance(getattr(self, name), kind):
                raise ShapeError(name, getattr(self, name), "expected a request of wbc.climb.request")
        mode, plant = self.mode, self.plant
        if isinstance(mode, PathRequest):
            validation.one_of("objective", mode.objective, get_args(Objective))
            if mode.speed is None:
                usual = DEFAULT_SPEED if self.scene.scene in GRID_NAMES else 0.0
                object.__setattr__(self, "mode", replace(mode, speed=usual))
            else:
                validation.scalar("speed", mode.speed, low=0.0, unit="m/s")
            validation.scalar("turn-rate", mode.turn_rate, low=0.0, open_low=True, unit="rad/s")
            if not mode.planning_time > 0.0:
                raise RangeError("planning-time", mode.planning_time, "expected a time above 0 s")
        elif isinstance(mode, DriveRequest):
            if bool(mode.commands) == bool(mode.rate):
                raise RangeError(
                    "commands", mode.commands, "give a file of rates, keyboard, or --rate, and one of them"
                )
        elif not mode.do:
            raise RangeError("do", mode.do, "say what the limb is to do")
        validation.one_of("plant", plant.plant, get_args(PlantName))
        if isinstance(mode, DriveRequest) and mode.commands == KEYBOARD and plant.plant != KINEMATIC:
            raise RangeError("plant", plant.plant, "the keyboard drives the kinematic plant")

    def plain(self) -> dict[str, Any]:
        """As plain data, of which :func:`request_of` makes it again."""
        return {"kind": next(kind for kind, made in KINDS.items() if made is type(self.mode)), **asdict(self)}


def request_of(plain: Any) -> ClimbRequest:
    """The request of :meth:`ClimbRequest.plain`.

    Raises:
        LogFileError: it is none.
    """
    try:
        earlier = plain["earlier"]
        return ClimbRequest(
            _made(KINDS[plain["kind"]], plain["mode"]),
            _made(ClimberRequest, plain["climber"]),
            _made(SceneRequest, plain["scene"]),
            _made(PlantRequest, plain["plant"]),
            None if earlier is None else _made(EarlierRun, earlier),
        )
    except (KeyError, TypeError, ValueError, AttributeError, WbcError) as error:
        raise LogFileError("request", type(plain).__name__, f"it does not say what was to be done: {error}") from error


def _made(kind: type[Any], values: Mapping[str, Any]) -> Any:
    known = {each.name for each in fields(kind)}
    if unknown := set(values) - known:
        raise ValueError(f"{kind.__name__} has no {min(unknown)}")
    return kind(**{name: tuple(value) if isinstance(value, list) else value for name, value in values.items()})
