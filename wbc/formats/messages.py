"""A run as messages in JSON with Foxglove's schemas, for files of MCAP and connections alike."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from operator import itemgetter
from typing import Any, TypeVar

import numpy as np

from wbc.formats.run import Piece, Run, SeenTick
from wbc.log import Log
from wbc.tick.outcome import STATUSES
from wbc.validation import Array
from wbc.viewer.bodies import DrawnMesh

T = TypeVar("T")
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
#: Topics -> names of the schemas of their messages
KINDS = {
    TICK: "wbc.Tick",
    "/joint_states": "foxglove.JointStates",
    "/tf": "foxglove.FrameTransforms",
    SCENE: "foxglove.SceneUpdate",
    "/why": "foxglove.Log",
}
#: Members of a group that keep their names in each tick, at most
NAMED = 3
#: Topic, time since the run began [ns], and plain data
Message = tuple[str, int, dict[str, Any]]


class RunMessages:
    """What a run says.

    Attributes:
        scene: what is drawn, said once. schemas: topic -> of its messages. names: of columns, nested as their numbers.
    """

    def __init__(self, run: Run) -> None:
        self.scene = of_bodies(run.bodies)
        # Schemas are those of examples, made as messages are
        units = dict.fromkeys([f"{group}.any joint" for group in JOINT_PARTS], "rad") | dict(run.units)
        numbers = Log({name: np.zeros(1) for name in units | {"t": "s"}}, units, {})
        corner = DrawnMesh(np.zeros((1, 3)), np.zeros((1, 3), dtype=np.uint32), (0, 0, 0))
        said = *of_ticks(numbers), *of_seen(SeenTick(0.0, {"link": IDENTITY}, why="why"))
        examples = {topic: data for topic, _, data in said} | {SCENE: of_bodies({"link": corner})}
        self.schemas = {topic: schema_of(examples[topic], kind) for topic, kind in KINDS.items()}
        self.names = nested(_other_columns({name: np.array([name]) for name in run.units}, _joints(numbers)))[0]

    def of(self, piece: Piece) -> list[Message]:
        """The messages of some ticks by their times."""
        log, seen = piece
        messages = [*of_ticks(log), *(message for tick in seen for message in of_seen(tick))]
        return sorted(messages, key=itemgetter(1))


def schema_of(example: Any, title: str = "") -> dict[str, Any]:
    """The schema of messages such as an example."""
    if isinstance(example, dict):
        made = {"type": "object", "properties": {key: schema_of(part) for key, part in example.items()}}
        return made | ({"title": title} if title else {})
    if isinstance(example, list):
        return {"type": "array", "items": schema_of(example[0]) if example else {}}
    return {"type": {bool: "boolean", int: "integer", float: "number", str: "string"}[type(example)]}


def by_first(members: Mapping[str, T]) -> dict[str, dict[str, T]]:
    """First part of a name -> rest of the name -> value. A column may be called as what others begin with."""
    out: dict[str, dict[str, T]] = {}
    for name, value in members.items():
        first, _, rest = name.partition(".")
        out.setdefault(first, {})[rest] = value
    return out


def nested(columns: Mapping[str, Array], depth: int = 0) -> list[Any]:
    """Columns ``group.member`` as nested objects, one a row; where more than :data:`NAMED` members of a group stand
    alone beside each other they are an array, as names would take a third of a file. What is not finite is None.
    """
    parts = by_first(columns)
    if depth and columns.keys() == {""}:
        return _plain(columns[""])
    if depth and len(parts) > NAMED and all(below.keys() == {""} for below in parts.values()):
        return _plain(np.column_stack(list(columns.values())))
    each = {key: nested(below, depth + 1) for key, below in parts.items()}
    return [dict(zip(each, row, strict=True)) for row in zip(*each.values(), strict=True)]


def of_ticks(log: Log) -> Iterator[Message]:
    """Two messages for each tick: its joints, and all its other numbers."""
    joints = _joints(log)
    ticks = nested(_other_columns(log.columns, joints))
    statuses = [str(STATUSES[int(code)]) for code in log["flag"]] if "flag" in log else []
    for k, t in enumerate(log["t"].tolist()):
        yield TICK, round(t * NANO), ticks[k] | ({"status": statuses[k]} if statuses else {})
        if joints:
            states = [{"name": name} | {part: row[k] for part, row in parts.items()} for name, parts in joints.items()]
            yield "/joint_states", round(t * NANO), _stamped(t, joints=states)


def _joints(log: Log) -> dict[str, dict[str, list[Any]]]:
    """Joint -> field of its state -> a number a tick; the two coordinates of one without end are an angle."""
    coordinates = {name[2:]: unit for name, unit in log.units.items() if name.startswith("q.")}
    out: dict[str, dict[str, list[Any]]] = {name: {} for name, unit in coordinates.items() if unit in ("rad", "m")}
    for name in [name[:-2] for name in coordinates if name.endswith(".1")]:
        if name and f"{name}.2" not in coordinates:
            out[name] = {"position": _plain(np.arctan2(log[f"q.{name}.1"], log[f"q.{name}.0"]))}
    for group, part in JOINT_PARTS.items():
        for name, row in log.group(group).items():
            if name in out:
                out[name][part] = _plain(row)
    return out


def _other_columns(columns: Mapping[str, Array], joints: Collection[str]) -> dict[str, Array]:
    """Those that are not of the states of joints."""
    apart = {f"{group}.{name}" for name in joints for group in JOINT_PARTS}
    return {name: column for name, column in columns.items() if name not in apart}


def _plain(numbers: Array) -> list[Any]:
    """Numbers as JSON has them: what is not finite is None."""
    if numbers.dtype.kind == "U" or (finite := np.isfinite(numbers)).all():
        return list((numbers if numbers.dtype.kind == "U" else numbers.astype(np.float64)).tolist())
    return list(np.where(finite, numbers, np.array(None)).tolist())


def of_bodies(bodies: Mapping[str, DrawnMesh]) -> dict[str, Any]:
    """What is drawn in each frame, which stays as it is."""
    entities = []
    for frame, (corners, triangles, colour) in bodies.items():
        points = [_named(point) for point in corners.round(5).astype(float)]
        pose = {"position": _named(IDENTITY[:3]), "orientation": _named(IDENTITY[3:])}
        surface: dict[str, Any] = {"pose": pose, "points": points}
        surface |= {"color": _named(np.array([*colour, 255]) / 255.0, "rgba"), "indices": triangles.ravel().tolist()}
        kept = {"lifetime": {"sec": 0, "nsec": 0}, "frame_locked": True, "triangles": [surface]}
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
