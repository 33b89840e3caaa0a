"""A run, piece by piece, whatever recorded it: its numbers, and what there is to see of them."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cached_property
from typing import NamedTuple

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
from wbc.record.recording import Recording
from wbc.replaying.ticks import compiled, redoing
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

#: Ticks a second of which poses and binding rows are shown [1/s]
RATE = 30.0
#: Time between two explanations, which cost some milliseconds each [s]
EXPLAINED = 1.0
#: Says whether to look again for ticks where a file ends that is still written
Wait = Callable[[], bool]


class SeenTick(NamedTuple):
    """What there is to see of a tick.

    Attributes:
        t: time [s]. poses: ``robot/LINK``, ``target/ITEM`` or ``obstacle/ITEM`` -> its pose in the world: x, y, z [m],
            quaternion x, y, z, w. status: how the tick ended. binding: rows that push against the optimum, and those
            that gave way. why: why the command is what it is; "" where that was said already.
    """

    t: float
    poses: Mapping[str, Array]
    status: str = ""
    binding: tuple[str, ...] = ()
    why: str = ""


#: Ticks as they were written together, and what there is to see of some of them
Piece = tuple[Log, list[SeenTick]]


class Run:
    """A run's folder, a recording, or a log in any of this package's formats, whole or as far as it was written.

    Attributes:
        path: what is read. about: what is said of the run: plain data. units: column -> unit. bodies: as
            ``SeenTick.poses`` -> what is drawn there. remarks: what is not shown, and why.

    Raises:
        FormatError: there is no such file or folder. LogFileError: no run, or damaged.
    """

    def __init__(self, path: str | os.PathLike[str], trust: bool = False) -> None:
        place, trust = validation.existing("run", path, FormatError), validation.flag("trust", trust)
        self.path = recording_in(place) or place
        file = next((self.path / name for name in FILES if (self.path / name).is_file()), self.path)
        self.remarks, self._obstacles = list[str](), dict[str, DrawnMesh]()
        self._controller: Controller | None = None
        self._placed, self._said, self._said_at = dict[str, tuple[str, str]](), tuple[str, ...](), -np.inf
        self._chunks: Callable[[Wait | None], Iterable[tuple[Log, Array]]]
        self._ticks: LogFile | None = None
        if file.suffix == ".parquet" or not is_recording(file):
            log = load(file)
            self.about, self.units, self._chunks = log.meta, log.units, lambda wait: [(log, log["t"])]
        elif "kinds" in (ticks := LogFile(file)).about:
            self._ticks, self.about, self.units = ticks, ticks.about["meta"], ticks.about["units"]
            self._chunks = lambda wait: ((log_of(ticks, rows), rows) for rows in ticks.chunks(wait))
        else:
            self._ticks = recording = Recording(file)
            self.about, self.units, self._chunks = recording.about, recording.column_units, recording.logs
            self._read_stack(recording, trust)
        self._robot = self._own_robot() if self._controller is None else self._controller.stack.robot

    @property
    def complete(self) -> bool:
        """It was closed: see :attr:`wbc.log.LogFile.complete`."""
        return self._ticks is None or self._ticks.complete

    @cached_property
    def bodies(self) -> Mapping[str, DrawnMesh]:
        """Read when they are asked for: meshes take most of the time of what a table is made of."""
        links = {} if self._robot is None else robot_meshes(self._robot)
        return self._obstacles | {f"robot/{link}": mesh for link, mesh in links.items()}

    def _read_stack(self, recording: Recording, trust: bool) -> None:
        try:
            self._controller = controller = compiled(recording, backend="auto", trust=trust)
        except WbcError as error:
            self.remarks.append(f"targets, obstacles and reasons are not shown: {error}")
            return
        self._again = redoing(recording, controller)
        for name, block in core_of(controller).layout.blocks.items():
            item, target = block.entry.item, block.slots.get("target")
            if target is not None and is_place(target.input):
                self._placed[f"target/{name}"] = name, "target"
            if isinstance(item, Obstacle):
                self._placed[f"obstacle/{name}"] = name, "pose"
                self._obstacles[f"obstacle/{name}"] = shape_mesh(item.parts)

    def _own_robot(self) -> Robot | None:
        """The robot of a run without a stack: by name, where the run has its whole configuration."""
        name, count = str(self.about.get("robot", "")), sum(column.startswith("q.") for column in self.units)
        if name in names() and (robot := load_robot(name)).nq == count:
            return robot
        self.remarks.append(f"the robot is not shown: no robot is {name!r} and has {count} coordinates")
        return None

    def pieces(
        self, wait: Wait | None = None, rate: float = RATE, progress: Callable[[int], None] | None = None
    ) -> Iterator[Piece]:
        """All ticks as they were written, of which ``rate`` a second are seen; arguments are those of
        :func:`wbc.formats.convert`.
        """
        count, last = 0, -np.inf
        for log, rows in self._chunks(wait):
            # The first tick of each period of the rate is seen
            periods, q = np.floor(rate * log["t"] + 1e-6), log.array("q")
            seen = np.flatnonzero(np.diff(periods, prepend=last) > 0.0).tolist()
            yield log, [self._seen(float(log["t"][k]), q[k], rows[k]) for k in seen]
            count, last = count + len(log), periods.max(initial=last)
            if progress is not None:
                progress(count)

    def _seen(self, t: float, q: Array, row: Array) -> SeenTick:
        poses = dict[str, Array]()
        if self._robot is not None:
            model, data, body = self._robot.model, self._robot.model.createData(), pin.FrameType.BODY
            pin.framesForwardKinematics(model, data, q)
            places = zip(model.frames, data.oMf, strict=True)
            poses = {f"robot/{frame.name}": pin.SE3ToXYZQUAT(place) for frame, place in places if frame.type == body}
        if self._controller is None:
            return SeenTick(t, poses)
        # One tick alone: from no active set the answer is the same to rounding
        tick = Tick(self._controller, SharedTick(0, t, state_of(self._again(row, True))))
        placed = {frame: tick.world_pose(*value) for frame, value in self._placed.items()}
        poses |= {frame: pin.SE3ToXYZQUAT(pose) for frame, pose in placed.items() if pose is not None}
        step, why = tick.step, ""
        binding = (*map(str, step.binding), *(f"gave way: {slack}" for slack in step.relaxed))
        if (said := (str(step.status), *binding)) != self._said and t >= self._said_at + EXPLAINED:
            self._said, self._said_at, why = said, t, " ".join(sentences(step.explain()))
        return SeenTick(t, poses, str(step.status), binding, why)
