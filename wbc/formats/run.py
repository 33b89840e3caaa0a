"""A run, piece by piece, whatever recorded it: its numbers, what there is to see of them, and where these go."""

from __future__ import annotations

import pathlib
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from wbc import validation
from wbc.api import Controller
from wbc.controller import core_of
from wbc.controller.step import state_of
from wbc.errors import WbcError
from wbc.formats.errors import FormatError
from wbc.log import Log, LogFile, load
from wbc.log.log import FILES, log_of
from wbc.multibody import pin
from wbc.record.recorder import recorded_inputs
from wbc.record.recording import Recording
from wbc.replaying.ticks import compiled
from wbc.robot import Robot
from wbc.robots import load as load_robot, names
from wbc.shapes import Box
from wbc.tasks import Obstacle
from wbc.validation import Array
from wbc.viewer.bodies import DrawnMesh, indexed, robot_meshes, shape_mesh
from wbc.viewer.drawing import is_place
from wbc.viewer.link import SharedTick
from wbc.viewer.reading import sentences
from wbc.viewer.runs import is_recording, recording_in
from wbc.viewer.tick import Tick

#: Ticks a second of which poses and binding rows are shown [1/s]
RATE = 30.0
#: Time between two explanations, which cost some milliseconds each [s]
EXPLAINED = 1.0
#: Length and width of the axes that mark a target [m]
AXIS = (0.1, 0.005)


@dataclass(frozen=True)
class SeenTick:
    """What there is to see of a tick.

    Attributes:
        t: time [s]. poses: ``robot/LINK``, ``target/ITEM`` or ``obstacle/ITEM`` -> its pose in the world: x, y, z [m],
            quaternion x, y, z, w.
        status: how the tick ended. binding: rows that push against the optimum, and those that gave way.
        why: why the command is what it is; "" where that was said already.
    """

    t: float
    poses: Mapping[str, Array]
    status: str = ""
    binding: tuple[str, ...] = ()
    why: str = ""


class Run:
    """A run's folder, a recording, or a log in any of this package's formats, whole or as far as it was written.

    Attributes:
        path: what is read. about: what is said of the run: plain data. units: column -> unit. bodies: as
            ``SeenTick.poses`` -> what is drawn there. remarks: what is not shown, and why.

    Raises:
        LogFileError: no such run, or damaged.
    """

    def __init__(self, path: pathlib.Path, trust: bool = False) -> None:
        self.path = recording_in(path) or path
        file = next((self.path / name for name in FILES if (self.path / name).is_file()), self.path)
        self.remarks, self.bodies = list[str](), dict[str, list[DrawnMesh]]()
        self.about: Mapping[str, Any]
        self.units: Mapping[str, str]
        self._controller: Controller | None = None
        self._placed = dict[str, tuple[str, str]]()
        self._due, self._said, self._said_at = -np.inf, tuple[str, ...](), -np.inf
        self._chunks: Callable[[Callable[[], bool] | None], Iterable[tuple[Log, Array]]]
        if file.suffix == ".parquet" or not is_recording(file):
            log = load(file)
            self.about, self.units, self._chunks = log.meta, log.units, lambda wait: [(log, log["t"])]
        elif "kinds" in (ticks := LogFile(file)).about:
            self.about, self.units = ticks.about["meta"], ticks.about["units"]
            self._chunks = lambda wait: ((log_of(ticks, rows), rows) for rows in ticks.chunks(wait))
        else:
            recording = Recording(file)
            self.about, self.units, self._chunks = recording.about, recording.column_units, recording.logs
            self._read_stack(recording, trust)
        self._robot = self._own_robot() if self._controller is None else self._controller.stack.robot
        if self._robot is not None:
            self.bodies |= {f"robot/{link}": [mesh] for link, mesh in robot_meshes(self._robot).items()}

    def _read_stack(self, recording: Recording, trust: bool) -> None:
        try:
            self._controller, self._parts = compiled(recording, backend="auto", trust=trust), recording.parts
        except WbcError as error:
            self.remarks.append(f"targets, obstacles and reasons are not shown: {error}")
            return
        for name, block in core_of(self._controller).layout.blocks.items():
            item, target = block.entry.item, block.slots.get("target")
            if target is not None and is_place(target.input):
                self._placed[f"target/{name}"], self.bodies[f"target/{name}"] = (name, "target"), _axes()
            if isinstance(item, Obstacle):
                self._placed[f"obstacle/{name}"] = name, "pose"
                self.bodies[f"obstacle/{name}"] = [shape_mesh(item.parts)]

    def _own_robot(self) -> Robot | None:
        """The robot of a run without a stack: by name, where the run has its whole configuration."""
        name, count = str(self.about.get("robot", "")), sum(column.startswith("q.") for column in self.units)
        robot = load_robot(name) if name in names() else None
        if robot is None or robot.nq != count:
            self.remarks.append(f"the robot is not shown: no robot is {name!r} and has {count} coordinates")
            return None
        return robot

    def pieces(
        self, wait: Callable[[], bool] | None = None, rate: float = RATE
    ) -> Iterator[tuple[Log, list[SeenTick]]]:
        """Numbers of all ticks, and what is to be seen of ``rate`` a second, as they were written; ``wait``: as of
        :meth:`wbc.log.LogFile.chunks`.
        """
        for log, rows in self._chunks(wait):
            seen, configurations = list[SeenTick](), log.array("q")
            for k, t in enumerate(log["t"].tolist()):
                if t >= self._due - 1e-9:
                    self._due = max(self._due + 1.0 / rate, t) if np.isfinite(self._due) else t + 1.0 / rate
                    seen.append(self._seen(t, configurations[k], rows[k]))
            yield log, seen

    def _seen(self, t: float, q: Array, row: Array) -> SeenTick:
        poses = {} if self._robot is None else _link_poses(self._robot, q)
        if self._controller is None:
            return SeenTick(t, poses)
        # One tick alone: from no active set the answer is the same to rounding
        core = core_of(self._controller)
        for name in recorded_inputs(core.layout):
            getattr(core.tick, name)[:] = row[self._parts[name]]
        core.tick.reset()
        tick = Tick(self._controller, SharedTick(0, t, state_of(core.again())))
        step = tick.step
        placed = {frame: tick.world_pose(*value) for frame, value in self._placed.items()}
        poses |= {frame: _seven(pose) for frame, pose in placed.items() if pose is not None}
        binding = (*map(str, step.binding), *(f"gave way: {slack}" for slack in step.relaxed))
        said, why = (str(step.status), *binding), ""
        if said != self._said and t >= self._said_at + EXPLAINED:
            self._said, self._said_at = said, t
            why = " ".join(sentences(step.explain()))
        return SeenTick(t, poses, str(step.status), binding, why)


def _link_poses(robot: Robot, q: Array) -> dict[str, Array]:
    model, data = robot.model, robot.model.createData()
    pin.framesForwardKinematics(model, data, q)
    placed = zip(model.frames, data.oMf, strict=True)
    return {f"robot/{frame.name}": _seven(pose) for frame, pose in placed if frame.type == pin.FrameType.BODY}


def _axes() -> list[DrawnMesh]:
    """Bars along x, y and z, in red, green and blue."""
    bars, length, width = list[DrawnMesh](), *AXIS
    for along, colour in zip(np.eye(3), ((255, 0, 0), (0, 255, 0), (0, 0, 255)), strict=True):
        x, y, z = (width + (length - width) * along).tolist()
        bars.append(indexed(Box((x, y, z)).triangles() + 0.5 * length * along, colour))
    return bars


def _seven(pose: pin.SE3) -> Array:
    return np.array(pin.SE3ToXYZQUAT(pose))


def run_of(path: object, trust: bool = False) -> Run:
    """A run by its folder or file; FormatError: there is no such thing, LogFileError: it is no run."""
    place = validation.file_path("run", path)
    if not validation.exists("run", place):
        raise FormatError("run", str(place), validation.no_such(place, "there is no such file or folder"))
    return Run(place, validation.flag("trust", trust))


class Sink(ABC):
    """A file, folder or connection into which a run is written; ticks are kept in memory where nothing else is done.

    Attributes:
        needs: the extra that brings its packages, and what needs them in words; empty: none.
    """

    needs: ClassVar[tuple[str, ...]] = ()

    def __init__(self, path: pathlib.Path) -> None:
        self._path, self._logs = path, list[Log]()

    def begin(self, run: Run) -> None:
        """Comes first."""
        self._run = run

    def write(self, log: Log, seen: list[SeenTick]) -> None:
        """The next ticks, and what is to be seen of some of them."""
        self._logs.append(log)

    @abstractmethod
    def close(self) -> None:
        """Nothing more comes."""

    def taken(self) -> Log:
        """Ticks that were kept, and are so no longer."""
        logs, self._logs = self._logs, []
        columns = {name: np.concatenate([log[name] for log in logs] or [np.zeros(0)]) for name in self._run.units}
        return Log(columns, self._run.units, self._run.about, logs[-1].tables if logs else {})
