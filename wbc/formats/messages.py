"""A run as messages in JSON with Foxglove's schemas, for files and connections alike."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from wbc.formats.run import Run, SeenTick
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
#: Quaternions x, y, z, w that turn an arrow, which points along x, along each axis
TURNS = ((0.0, 0.0, 0.0, 1.0), (0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)), (0.0, -np.sqrt(0.5), 0.0, np.sqrt(0.5)))
#: Members of a group that keep their names in each tick, at most
NAMED = 3
#: Level of foxglove.Log: rows gave way
WARNING = 3
#: Level of foxglove.Log: all rows hold
INFO = 2

#: Group of columns -> field of a joint's state
JOINT_PARTS = {"q": "position", "v": "velocity", "a": "acceleration"}
#: Topic of ticks
TICK = "/tick"
#: Name of their schema
TICK_SCHEMA = "wbc.Tick"


def schema_of(example: Any, title: str = "") -> dict[str, Any]:
    """The schema of messages such as an example, of which nothing is empty."""
    if isinstance(example, dict):
        made = {"type": "object", "properties": {key: schema_of(part) for key, part in example.items()}}
        return made | ({"title": title} if title else {})
    if isinstance(example, list):
        return {"type": "array", "items": schema_of(example[0])}
    return {"type": {bool: "boolean", int: "integer", float: "number", str: "string"}[type(example)]}


class Message(NamedTuple):
    """Something that is said on a topic.

    Attributes:
        topic: where. time: since the run began [ns]. data: plain data.
    """

    topic: str
    time: int
    data: dict[str, Any]


class TickTree:
    """A run's columns ``group.member`` as nested objects, but those of ``/joint_states``.

    Where more than :data:`NAMED` members stand alone beside each other they are an array, as names would take a third
    of a file: the schema says which is which.

    Attributes:
        names: columns in the order of the numbers of a tick. schema: of its messages.
    """

    def __init__(self, units: Mapping[str, str]) -> None:
        nodes: dict[str, Any] = {}
        joints = set(_single(units))
        for name in units:
            group, _, member = name.partition(".")
            if member in joints and group in JOINT_PARTS:
                continue
            node = nodes
            for part in name.split("."):
                node = node.setdefault(part, {})
            # A column may be called as what others begin with
            node[""] = name
        self.names: list[str] = []
        self._units, self._make = units, list[tuple[str, Any]]()
        self.schema = schema_of({"status": ""}, TICK_SCHEMA)
        for key, node in nodes.items():
            self.schema["properties"][key], shape = self._laid_out(node)
            self._make.append((key, shape))

    def _laid_out(self, node: dict[str, Any]) -> tuple[dict[str, Any], Any]:
        """(schema, shape) of a node; a shape is a place, a slice, or shapes by key."""
        begin, columns = len(self.names), {key: _column(below) for key, below in node.items()}
        if "" in node and len(node) == 1:
            self.names.append(node[""])
            unit = self._units[node[""]]
            return schema_of(0.0) | ({"description": f"[{unit}]"} if unit else {}), begin
        if len(node) > NAMED and all(columns.values()):
            self.names += columns.values()
            said = [f"{key} [{unit}]" if (unit := self._units[name]) else key for key, name in columns.items()]
            return schema_of([0.0]) | {"description": ", ".join(said)}, slice(begin, len(self.names))
        parts = {key: self._laid_out({"": below} if key == "" else below) for key, below in node.items()}
        schemas = {key: schema for key, (schema, _) in parts.items()}
        return {"type": "object", "properties": schemas}, {key: shape for key, (_, shape) in parts.items()}

    def tick(self, numbers: list[float]) -> dict[str, Any]:
        """The message of a tick, from its numbers in the order of :attr:`names`."""
        return {key: _filled(shape, numbers) for key, shape in self._make}


def _column(node: Any) -> str:
    """The column that a node is, or ""."""
    return node if isinstance(node, str) else str(node.get("", "")) if len(node) == 1 else ""


def _filled(shape: Any, numbers: list[float]) -> Any:
    if isinstance(shape, dict):
        return {key: _filled(below, numbers) for key, below in shape.items()}
    return numbers[shape]


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


def of_scene(run: Run, time: int = 0) -> Iterator[Message]:
    """What stays as it is, once: bodies of links and obstacles in their frames, and the axes of targets."""
    entities = [_body(link, mesh, time) for link, mesh in run.meshes.items()]
    entities += [_body(f"obstacle/{name}", mesh, time) for name, mesh in run.obstacles.items()]
    if entities:
        yield Message("/scene", time, {"deletions": [], "entities": entities})


def of_seen(seen: SeenTick) -> Iterator[Message]:
    """The messages of what is seen of a tick."""
    time = int(nanoseconds(np.array([seen.t]))[0])
    placed = {**seen.frames}
    placed |= {f"target/{name}": pose for name, pose in seen.targets.items()}
    placed |= {f"obstacle/{name}": pose for name, pose in seen.obstacles.items()}
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


def _named(numbers: Array) -> dict[str, float]:
    return dict(zip("xyzw", numbers.tolist(), strict=False))


def _body(frame: str, mesh: DrawnMesh, time: int) -> dict[str, Any]:
    surface = {
        "pose": _pose(TURNS[0]),
        "points": [_named(point) for point in mesh.corners.round(5).astype(float)],
        "color": _colour([part / 255.0 for part in mesh.colour]),
        "indices": mesh.triangles.ravel().tolist(),
    }
    return _entity(frame, f"body/{frame}", time) | {"triangles": [surface]}


def _target(name: str, time: int) -> dict[str, Any]:
    """The three axes of a target."""
    sizes = {"shaft_length": 0.8, "shaft_diameter": 0.05, "head_length": 0.2, "head_diameter": 0.1}
    arrow = {name: AXIS * share for name, share in sizes.items()}
    axes = [{"pose": _pose(turn)} | arrow | {"color": _colour(np.eye(3)[k])} for k, turn in enumerate(TURNS)]
    return _entity(f"target/{name}", f"target/{name}", time) | {"arrows": axes}


def _pose(turn: Sequence[float]) -> dict[str, Any]:
    return {"position": _named(np.zeros(3)), "orientation": _named(np.array(turn))}


def _colour(numbers: Iterable[float]) -> dict[str, float]:
    return dict(zip("rgba", [*map(float, numbers), 1.0], strict=True))


def _entity(frame: str, name: str, time: int) -> dict[str, Any]:
    still = {"lifetime": {"sec": 0, "nsec": 0}, "frame_locked": True}
    return {"timestamp": stamp(time), "frame_id": frame, "id": name} | still


class MessageSink(ABC):
    """A :class:`~wbc.formats.conversion.Sink` of messages by their times; who inherits has channels to put them in."""

    def begin(self, run: Run) -> None:
        """Schemas, and bodies."""
        self._tree = TickTree(run.units)
        for topic, schema in {TICK: self._tree.schema, **SCHEMAS}.items():
            self._open(topic, schema)
        self._bodies = list(of_scene(run))
        for message in self._bodies:
            self._put(message)

    def write(self, log: Log, seen: list[SeenTick]) -> None:
        """Ticks, and what is seen of some of them."""
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
    scene = {"deletions": [{"id": ""}], "entities": [_body("link", mesh, 0) | _target("target", 0)]}
    state: dict[str, Any] = {"name": ""} | dict.fromkeys(JOINT_PARTS.values(), 0.0)
    return {
        "/joint_states": schema_of({"timestamp": stamp(0), "joints": [state]}, "foxglove.JointStates"),
        "/tf": schema_of(said["/tf"], "foxglove.FrameTransforms"),
        "/scene": schema_of(scene, "foxglove.SceneUpdate"),
        "/why": schema_of(said["/why"], "foxglove.Log"),
    }


#: Topic -> schema of its messages, all but that of ticks, which each run has of its own
SCHEMAS = _schemas()
