"""A run, piece by piece, whatever recorded it: its numbers, and what there is to see of them."""

from __future__ import annotations

import functools
import pathlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

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
from wbc.tasks import Obstacle
from wbc.validation import Array
from wbc.viewer.bodies import DrawnMesh, robot_meshes, shape_mesh
from wbc.viewer.drawing import is_place
from wbc.viewer.link import SharedTick
from wbc.viewer.reading import sentences
from wbc.viewer.runs import is_recording, recording_in
from wbc.viewer.tick import Tick

#: Ticks a second of which poses, margins and binding rows are shown [1/s]
RATE = 30.0
#: Time between two explanations, which cost some milliseconds each [s]
EXPLAINED = 1.0
#: Where a walk's folder has its robot
URDF = "robot.urdf"


@dataclass(frozen=True)
class SeenTick:
    """What there is to see of a tick.

    Attributes:
        t: time [s]. frames: link -> its pose in the world. targets, obstacles: item -> pose of its target, or of what
            is kept clear of, in the world. All poses: x, y, z [m], quaternion x, y, z, w.
        status: how the tick ended. binding: rows that push against the optimum, and those that gave way.
        margins: constraint -> its least margin, in the unit of its rows.
        why: why the command is what it is; "" where that was said already.
    """

    t: float
    frames: Mapping[str, Array]
    targets: Mapping[str, Array]
    obstacles: Mapping[str, Array]
    status: str = ""
    binding: tuple[str, ...] = ()
    margins: Mapping[str, float] | None = None
    why: str = ""


class Run:
    """A run's folder, a recording, or a log in any of this package's formats, whole or as far as it was written.

    Attributes:
        path: what is read. about: what is said of the run: plain data. units: column -> unit. robot: the robot, None
            where the run does not say which. meshes, obstacles: link, or item, -> what is drawn there. remarks: what is
            not shown, and why.

    Raises:
        LogFileError: no such run, or damaged.
    """

    def __init__(self, path: pathlib.Path, trust: bool = False) -> None:
        recording = recording_in(path)
        self.path = recording or path
        self.about: Mapping[str, Any]
        self.units: Mapping[str, str]
        self.robot: Robot | None = None
        self.remarks: list[str] = []
        self.obstacles: dict[str, DrawnMesh] = {}
        self._controller: Controller | None = None
        self._due, self._said, self._said_at = -np.inf, "", -np.inf
        file = recording or _unfinished(path)
        read = load(path) if file is None else LogFile(file)
        if isinstance(read, LogFile) and "kinds" not in read.about:
            read = self._recording = Recording(read.path)
            self.about, self.units, self._pieces = read.about, read.column_units, read.logs
            self._read_stack(read, trust)
        else:
            if isinstance(read, LogFile):
                self.about, self.units = read.about["meta"], dict(read.about["units"])
            else:
                self.about, self.units = read.meta, read.units
            self._pieces = functools.partial(_log_pieces, read)
            self._read_robot(path if path.is_dir() else path.parent)
        self.meshes: dict[str, DrawnMesh] = {} if self.robot is None else robot_meshes(self.robot)
        self._data: Any = None if self.robot is None else self.robot.model.createData()

    def _read_stack(self, recording: Recording, trust: bool) -> None:
        try:
            self._controller = controller = compiled(recording, backend="auto", trust=trust)
        except WbcError as error:
            self.remarks.append(f"robot, targets and reasons are not shown: {error}")
            return
        self.robot = controller.stack.robot
        blocks = core_of(controller).layout.blocks
        self._places = {
            name: slot.input.name
            for name, block in blocks.items()
            for slot in block.slots.values()
            if slot.input.name == "target" and is_place(slot.input)
        }
        items = {name: block.entry.item for name, block in blocks.items()}
        self.obstacles = {name: shape_mesh(item.parts) for name, item in items.items() if isinstance(item, Obstacle)}

    def _read_robot(self, folder: pathlib.Path) -> None:
        """The robot of a log without a stack: of a file beside it, else by name."""
        name = str(self.about.get("robot", ""))
        based = any(column.startswith("pose.") for column in self.units)
        if (folder / URDF).is_file():
            self.robot = load_robot(folder / URDF, base="floating" if based else None)
        elif name in names():
            self.robot = load_robot(name)
        else:
            self.remarks.append(f"the robot is not shown: the run has no stack and no {URDF}, and no robot is {name!r}")

    def pieces(
        self, wait: Callable[[], bool] | None = None, rate: float = RATE
    ) -> Iterator[tuple[Log, list[SeenTick]]]:
        """The run in pieces, as they were written: numbers of all ticks, and what is to be seen of ``rate`` a second.

        Args:
            wait: as of :meth:`wbc.log.LogFile.chunks`.
        """
        for log, rows in self._pieces(wait):
            yield log, [self._at(log, k, rows[k]) for k in self._shown(log, rate)]

    def _shown(self, log: Log, rate: float) -> Iterator[int]:
        for k, t in enumerate(log["t"].tolist()):
            if t >= self._due - 1e-9:
                self._due = max(self._due + 1.0 / rate, t) if np.isfinite(self._due) else t + 1.0 / rate
                yield k

    def _at(self, log: Log, k: int, row: Array) -> SeenTick:
        t = float(log["t"][k])
        if self._controller is None:
            return SeenTick(t, self._frames(self._configuration(log, k)), {}, {})
        core, recording = core_of(self._controller), self._recording
        # One tick alone: from no active set the answer is the same to rounding
        for name in recorded_inputs(core.layout):
            getattr(core.tick, name)[:] = row[recording.parts[name]]
        core.tick.reset()
        tick = Tick(self._controller, SharedTick(k + 1, t, state_of(core.again())))
        step = tick.step
        binding = (*map(str, step.binding), *(f"gave way: {slack}" for slack in step.relaxed))
        said = f"{step.status}|{'|'.join(binding)}"
        why = ""
        if said != self._said and t >= self._said_at + EXPLAINED:
            self._said, self._said_at = said, t
            why = " ".join(sentences(step.explain()))
        targets, obstacles = (
            {name: seven(pose) for name, value in places.items() if (pose := tick.world_pose(name, value)) is not None}
            for places in (self._places, dict.fromkeys(self.obstacles, "pose"))
        )
        return SeenTick(
            t,
            self._frames(tick.q),
            targets,
            obstacles,
            str(step.status),
            binding,
            {name: float(values.min()) for name, values in step.margins.items() if len(values)},
            why,
        )

    def _configuration(self, log: Log, k: int) -> Array | None:
        """q of a log's tick; joints without a column stand where they are by themselves."""
        if self.robot is None:
            return None
        robot, q = self.robot, self.robot.neutral.copy()
        model = robot.model
        if robot.base == "floating" and len(pose := log.array("pose")[k]) == 7:
            q[:7] = pose
        for name, first, size in zip(model.names[1:], model.idx_qs[1:], model.nqs[1:], strict=True):
            own = [f"q.{name}"] if size == 1 else [f"q.{name}.{j}" for j in range(size)]
            if all(column in log for column in own):
                q[first : first + size] = [log[column][k] for column in own]
        return q

    def _frames(self, q: Array | None) -> dict[str, Array]:
        if self.robot is None or q is None:
            return {}
        model, data = self.robot.model, self._data
        pin.framesForwardKinematics(model, data, q)
        return {
            str(frame.name): seven(data.oMf[number])
            for number, frame in enumerate(model.frames)
            if frame.type == pin.FrameType.BODY
        }


def _log_pieces(read: Log | LogFile, wait: Callable[[], bool] | None) -> Iterator[tuple[Log, Array]]:
    """Logs and rows, which a log alone has none of but its columns."""
    if isinstance(read, LogFile):
        yield from ((log_of(read, rows), rows) for rows in read.chunks(wait))
    else:
        yield read, read["t"]


def _unfinished(path: pathlib.Path) -> pathlib.Path | None:
    """The log of a run that was killed, itself or in a folder that has no whole one."""
    files = [path / name for name in FILES if (path / name).is_file()] if path.is_dir() else [path]
    return files[0] if files and files[0].suffix == ".part" and is_recording(files[0]) else None


def seven(pose: pin.SE3) -> Array:
    """x, y, z [m] and the quaternion x, y, z, w of a pose."""
    return np.array(pin.SE3ToXYZQUAT(pose))


def run_of(path: object, trust: bool = False) -> Run:
    """A run by its folder or file.

    Raises:
        FormatError: there is no such thing. LogFileError: it is no run.
    """
    place = validation.file_path("run", path)
    if not validation.exists("run", place):
        raise FormatError("run", str(place), validation.no_such(place, "there is no such file or folder"))
    return Run(place, validation.flag("trust", trust))
