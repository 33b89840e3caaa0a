"""A run as messages in JSON with Foxglove's schemas, for files and connections alike."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from wbc.formats.run import Run, SeenTick
from wbc.formats.sink import Sink
from wbc.formats.tick_tree import TickTree, schema_of
from wbc.log import Log
from wbc.tick.outcome import STATUSES
from wbc.validation import Array
from wbc.viewer.bodies import DrawnMesh

#: Nanoseconds of a second
NANO = 1_000_000_000
#: Frame that all others are placed in
WORLD = "world"
#: Length of the axes that mark a target [m]
AXIS = 0.1
#: Parts of an arrow, as shares of its length
ARROW = {"shaft_length": 0.8, "shaft_diameter": 0.05, "head_length": 0.2, "head_diameter": 0.1}
#: Quaternions x, y, z, w that turn an arrow, which points along x, along each axis
TURNS = ((0.0, 0.0, 0.0, 1.0), (0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)), (0.0, -np.sqrt(0.5), 0.0, np.sqrt(0.5)))
#: Level of foxglove.Log: rows gave way
WARNING = 3
#: Level of foxglove.Log: all rows hold
INFO = 2
#: Group of columns -> field of a joint's state
JOINT_PARTS = {"q": "position", "v": "velocity", "a": "acceleration"}
#: Topic of ticks
TICK = "/tick"


class Message(NamedTuple):
    """Something that is said on a topic.

    Attributes:
        topic: where. time: since the run began [ns]. data: plain data.
    """

    topic: str
    time: int
    data: dict[str, Any]


def of_ticks(log: Log, tree: TickTree) -> Iterator[Message]:
    """Two messages for each tick: all its numbers, and its joints. What is not finite is null."""
    rows, joints = np.column_stack([log[name] for name in tree.names]).tolist(), _joints(log)
    codes = log["flag"].tolist() if "flag" in log else None
    for k, time in enumerate(nanoseconds(log["t"])):
        said = {"status": str(STATUSES[codes[k]])} if codes else {}
        yield Message(TICK, time, tree.tick(rows[k]) | said)
        if joints:
            states = [{"name": name} | {part: row[k] for part, row in parts.items()} for name, parts in joints.items()]
            yield Message("/joint_states", time, {"timestamp": stamp(time), "joints": states})


def _single(units: Mapping[str, str]) -> list[str]:
    """Joints with one coordinate."""
    return [name[2:] for name, unit in units.items() if name.startswith("q.") and unit in ("rad", "m")]


def _joints(log: Log) -> dict[str, dict[str, list[float]]]:
    """Joint -> field of its state -> a number a tick; the two coordinates of one without end are an angle."""
    out: dict[str, dict[str, list[float]]] = {name: {} for name in _single(log.units)}
    for name in [name[2:-2] for name in log.units if name.startswith("q.") and name.endswith(".1")]:
        if f"q.{name}.2" not in log:
            out[name] = {"position": np.arctan2(log[f"q.{name}.1"], log[f"q.{name}.0"]).tolist()}
    for group, part in JOINT_PARTS.items():
        for name, row in log.group(group).items():
            if name in out:
                out[name][part] = row.tolist()
    return out


def of_scene(run: Run) -> Iterator[Message]:
    """What stays as it is, once: bodies of links and obstacles in their frames."""
    bodies = run.meshes | {f"obstacle/{name}": mesh for name, mesh in run.obstacles.items()}
    if bodies:
        yield Message("/scene", 0, {"deletions": [], "entities": [_body(*body) for body in bodies.items()]})


def of_seen(seen: SeenTick) -> Iterator[Message]:
    """The messages of what is seen of a tick."""
    time = int(nanoseconds(np.array([seen.t]))[0])
    prefixed = {"": seen.frames, "target/": seen.targets, "obstacle/": seen.obstacles}
    placed = {f"{prefix}{name}": pose for prefix, poses in prefixed.items() for name, pose in poses.items()}
    if placed:
        place = {"timestamp": stamp(time), "parent_frame_id": WORLD}
        transforms = [
            place | {"child_frame_id": name, "translation": _named(pose[:3]), "rotation": _named(pose[3:])}
            for name, pose in placed.items()
            if name != WORLD
        ]
        yield Message("/tf", time, {"transforms": transforms})
    if seen.targets:
        arrows = [_target(name, time) for name in seen.targets]
        yield Message("/scene", time, {"deletions": [], "entities": arrows})
    if seen.why:
        level = INFO if seen.status == "solved" else WARNING
        rows = f"binding: {', '.join(seen.binding)}" if seen.binding else "nothing binds"
        said = {"timestamp": stamp(time), "level": level, "message": f"{seen.why} ({rows})", "name": seen.status}
        yield Message("/why", time, said)


def nanoseconds(seconds: Array) -> list[int]:
    """Times [s] in nanoseconds."""
    out: list[int] = np.round(seconds * NANO).astype(np.int64).tolist()
    return out


def stamp(time: int) -> dict[str, int]:
    """A time in nanoseconds as messages have it."""
    return {"sec": time // NANO, "nsec": time % NANO}


def _named(numbers: Array, names: str = "xyzw") -> dict[str, float]:
    return dict(zip(names, numbers.tolist(), strict=False))


def _body(frame: str, mesh: DrawnMesh) -> dict[str, Any]:
    surface = {
        "pose": _pose(TURNS[0]),
        "points": [_named(point) for point in mesh.corners.round(5).astype(float)],
        "color": _colour(np.array(mesh.colour) / 255.0),
        "indices": mesh.triangles.ravel().tolist(),
    }
    return _entity(frame, f"body/{frame}", 0) | {"triangles": [surface]}


def _target(name: str, time: int) -> dict[str, Any]:
    """The three axes of a target."""
    arrow = {part: AXIS * share for part, share in ARROW.items()}
    axes = [{"pose": _pose(turn)} | arrow | {"color": _colour(np.eye(3)[k])} for k, turn in enumerate(TURNS)]
    return _entity(f"target/{name}", f"target/{name}", time) | {"arrows": axes}


def _pose(turn: Sequence[float]) -> dict[str, Any]:
    return {"position": _named(np.zeros(3)), "orientation": _named(np.array(turn))}


def _colour(numbers: Array) -> dict[str, float]:
    return _named(np.append(numbers, 1.0), "rgba")


def _entity(frame: str, name: str, time: int) -> dict[str, Any]:
    still = {"lifetime": {"sec": 0, "nsec": 0}, "frame_locked": True}
    return {"timestamp": stamp(time), "frame_id": frame, "id": name} | still


class MessageSink(Sink):
    """A sink of messages by their times; who inherits has channels to put them in."""

    def begin(self, run: Run) -> None:
        joints = _single(run.units)
        self._tree = TickTree(run.units, {f"{group}.{name}" for name in joints for group in JOINT_PARTS})
        for topic, schema in {TICK: self._tree.schema, **SCHEMAS}.items():
            self._open(topic, schema)
        self._bodies = list(of_scene(run))
        for message in self._bodies:
            self._put(message)

    def write(self, log: Log, seen: list[SeenTick]) -> None:
        messages = [*of_ticks(log, self._tree), *(message for moment in seen for message in of_seen(moment))]
        for message in sorted(messages, key=lambda message: message.time):
            self._say(message)

    def _say(self, message: Message) -> None:
        """Put a message of a tick; files wait for nothing."""
        self._put(message)

    @abstractmethod
    def _open(self, topic: str, schema: dict[str, Any]) -> None:
        """A channel."""

    @abstractmethod
    def _put(self, message: Message) -> None:
        """Into its channel."""


def _schemas() -> dict[str, dict[str, Any]]:
    """Those of examples that are made as messages are."""
    pose, mesh = np.zeros(7), DrawnMesh(np.zeros((1, 3)), np.zeros((1, 3), dtype=int), (0, 0, 0))
    moment = SeenTick(0.0, {"link": pose}, {"target": pose}, {}, why="why")
    said = {message.topic: message.data for message in of_seen(moment)}
    said["/scene"] = {"deletions": [{"id": ""}], "entities": [_body("link", mesh) | _target("target", 0)]}
    state: dict[str, Any] = {"name": ""} | dict.fromkeys(JOINT_PARTS.values(), 0.0)
    said["/joint_states"] = {"timestamp": stamp(0), "joints": [state]}
    return {topic: schema_of(said[topic], kind) for topic, kind in KINDS.items()}


#: Topic -> Foxglove's name of its messages, all but those of ticks, whose schema each run has of its own
KINDS = {
    "/joint_states": "foxglove.JointStates",
    "/tf": "foxglove.FrameTransforms",
    "/scene": "foxglove.SceneUpdate",
    "/why": "foxglove.Log",
}
#: Topic -> schema of its messages
SCHEMAS = _schemas()
