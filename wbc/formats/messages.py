"""A run as messages in JSON with Foxglove's schemas, for files of MCAP and connections alike."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from operator import itemgetter
from typing import Any

import numpy as np

from wbc.formats.run import Piece, Run, SeenTick
from wbc.log import Log
from wbc.tick.outcome import STATUSES
from wbc.validation import Array
from wbc.viewer.bodies import DrawnMesh

#: Nanoseconds of a second
NANO = 1_000_000_000
#: Group of columns -> field of a joint's state
JOINT_PARTS = {"q": "position", "v": "velocity", "a": "acceleration"}
#: Pose of a frame in itself
IDENTITY = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
#: Topic of ticks
TICK = "/tick"
#: Topic of what is said once
SCENE = "/scene"
#: Topics -> Foxglove's name of their messages, but of ticks
KINDS = {"/joint_states": "JointStates", "/tf": "FrameTransforms", SCENE: "SceneUpdate", "/why": "Log"}
#: Members of a group that keep their names in each tick, at most
NAMED = 3
#: Topic, time since the run began [ns], and plain data
Message = tuple[str, int, dict[str, Any]]


class TickTree:
    """A run's columns ``group.member``, but those ``apart``, as nested objects; where more than :data:`NAMED` members
    stand alone beside each other they are an array, as names would take a third of a file.

    Attributes:
        names: columns in the order of the numbers of a tick. schema: of its messages.
    """

    def __init__(self, columns: Iterable[str], apart: Collection[str] = ()) -> None:
        self.names = list[str]()
        groups = by_first({name: name for name in columns if name not in apart})
        self._groups = {key: self._laid_out(members) for key, members in groups.items()}
        self.schema = schema_of(self.tick([0.0] * len(self.names)) | {"status": ""}, "wbc.Tick")

    def tick(self, numbers: list[float]) -> dict[str, Any]:
        """The message of a tick, from its numbers in the order of :attr:`names`."""
        return {key: group(numbers) for key, group in self._groups.items()}

    def _laid_out(self, members: dict[str, str]) -> Callable[[list[float]], Any]:
        """What takes columns, given by the rests of their names, out of a tick's numbers."""
        begin, parts = len(self.names), by_first(members)
        if members.keys() == {""}:
            self.names.append(members[""])
            return itemgetter(begin)
        if len(parts) > NAMED and all(below.keys() == {""} for below in parts.values()):
            self.names += members.values()
            return itemgetter(slice(begin, len(self.names)))
        each = {key: self._laid_out(below) for key, below in parts.items()}
        return lambda numbers: {key: part(numbers) for key, part in each.items()}


def by_first(members: dict[str, str]) -> dict[str, dict[str, str]]:
    """First part of a name -> rest of the name -> column. A column may be called as what others begin with."""
    out: dict[str, dict[str, str]] = {}
    for name, column in members.items():
        first, _, rest = name.partition(".")
        out.setdefault(first, {})[rest] = column
    return out


def schema_of(example: Any, title: str = "") -> dict[str, Any]:
    """The schema of messages such as an example."""
    if isinstance(example, dict):
        made = {"type": "object", "properties": {key: schema_of(part) for key, part in example.items()}}
        return made | ({"title": title} if title else {})
    if isinstance(example, list):
        return {"type": "array", "items": schema_of(example[0]) if example else {}}
    return {"type": {bool: "boolean", int: "integer", float: "number", str: "string"}[type(example)]}


class RunMessages:
    """What a run says.

    Attributes:
        tree: of its ticks. scene: what is drawn, said once. schemas: topic -> of its messages.
    """

    def __init__(self, run: Run) -> None:
        joints, self.scene = single_joints(run.units), of_bodies(run.bodies)
        self.tree = TickTree(run.units, {f"{group}.{name}" for name in joints for group in JOINT_PARTS})
        # Schemas are those of examples, made as messages are
        corner = DrawnMesh(np.zeros((1, 3)), np.zeros((1, 3), dtype=np.uint32), (0, 0, 0))
        state: dict[str, Any] = {"name": ""} | dict.fromkeys(JOINT_PARTS.values(), 0.0)
        examples = {"/joint_states": _stamped(0.0, joints=[state]), SCENE: of_bodies({"link": [corner]})}
        examples |= {topic: data for topic, _, data in of_seen(SeenTick(0.0, {"link": IDENTITY}, why="why"))}
        self.schemas = {topic: schema_of(examples[topic], f"foxglove.{kind}") for topic, kind in KINDS.items()}
        self.schemas[TICK] = self.tree.schema

    def of(self, piece: Piece) -> list[Message]:
        """The messages of some ticks by their times."""
        log, seen = piece
        messages = [*of_ticks(log, self.tree), *(message for tick in seen for message in of_seen(tick))]
        return sorted(messages, key=itemgetter(1))


def of_ticks(log: Log, tree: TickTree) -> Iterator[Message]:
    """Two messages for each tick: all its numbers, and its joints. What is not finite is null."""
    rows, joints = _plain(np.column_stack([log[name] for name in tree.names])), _joints(log)
    codes = log["flag"].tolist() if "flag" in log else None
    for k, t in enumerate(log["t"].tolist()):
        said = {"status": str(STATUSES[codes[k]])} if codes else {}
        yield TICK, round(t * NANO), tree.tick(rows[k]) | said
        if joints:
            states = [{"name": name} | {part: row[k] for part, row in parts.items()} for name, parts in joints.items()]
            yield "/joint_states", round(t * NANO), _stamped(t, joints=states)


def single_joints(units: Mapping[str, str]) -> list[str]:
    """Joints with one coordinate, of the units of columns."""
    return [name[2:] for name, unit in units.items() if name.startswith("q.") and unit in ("rad", "m")]


def _joints(log: Log) -> dict[str, dict[str, list[Any]]]:
    """Joint -> field of its state -> a number a tick; the two coordinates of one without end are an angle."""
    out: dict[str, dict[str, list[Any]]] = {name: {} for name in single_joints(log.units)}
    for name in [name[2:-2] for name in log.units if name.startswith("q.") and name.endswith(".1")]:
        if name and f"q.{name}.2" not in log:
            out[name] = {"position": _plain(np.arctan2(log[f"q.{name}.1"], log[f"q.{name}.0"]))}
    for group, part in JOINT_PARTS.items():
        for name, row in log.group(group).items():
            if name in out:
                out[name][part] = _plain(row)
    return out


def _plain(numbers: Array) -> Any:
    """Numbers as JSON has them: what is not finite is None."""
    if (finite := np.isfinite(numbers)).all():
        return numbers.tolist()
    return np.where(finite, numbers, np.array(None)).tolist()


def of_bodies(bodies: Mapping[str, list[DrawnMesh]]) -> dict[str, Any]:
    """What is drawn in each frame, which stays as it is."""
    entities = []
    for frame, meshes in bodies.items():
        surfaces, pose = [], {"position": _named(IDENTITY[:3]), "orientation": _named(IDENTITY[3:])}
        for corners, triangles, colour in meshes:
            points = [_named(point) for point in corners.round(5).astype(float)]
            surface = {"pose": pose, "points": points, "color": _named(np.array([*colour, 255]) / 255.0, "rgba")}
            surfaces.append(surface | {"indices": triangles.ravel().tolist()})
        kept = {"lifetime": {"sec": 0, "nsec": 0}, "frame_locked": True, "triangles": surfaces}
        entities.append(_stamped(0.0, frame_id=frame.removeprefix("robot/"), id=f"body/{frame}") | kept)
    return {"deletions": [], "entities": entities}


def of_seen(seen: SeenTick) -> Iterator[Message]:
    """The messages of what is seen of a tick."""
    transforms, now = [], round(seen.t * NANO)
    for frame, pose in seen.poses.items():
        if frame != "robot/world":
            place = {"translation": _named(pose[:3]), "rotation": _named(pose[3:])}
            frames = {"parent_frame_id": "world", "child_frame_id": frame.removeprefix("robot/")}
            transforms.append(_stamped(seen.t, **frames, **place))
    if transforms:
        yield "/tf", now, {"transforms": transforms}
    if seen.why:
        rows = f"binding: {', '.join(seen.binding)}" if seen.binding else "nothing binds"
        # Levels of foxglove.Log: information, and a warning
        said = {"level": 2 if seen.status == "solved" else 3, "message": f"{seen.why} ({rows})", "name": seen.status}
        yield "/why", now, _stamped(seen.t, **said)


def _stamped(seconds: float, **data: Any) -> dict[str, Any]:
    whole, part = divmod(round(seconds * NANO), NANO)
    return {"timestamp": {"sec": whole, "nsec": part}} | data


def _named(numbers: Array, names: str = "xyzw") -> dict[str, float]:
    return dict(zip(names, numbers.tolist(), strict=False))
