"""Joint states and transforms of MCAP files and ROS bags."""

from __future__ import annotations

import contextlib
import itertools
import json
import os
import pathlib
from collections.abc import Callable, Iterator, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np

from wbc import extras, validation
from wbc.errors import WbcError
from wbc.extras import MissingPackageError
from wbc.formats.errors import FormatError
from wbc.formats.messages import NANO
from wbc.formats.motion import Path6, RecordedMotion
from wbc.validation import Array

#: Largest difference of a quaternion's length from 1
UNIT = 1e-3
#: Message types of joints that are read, without the package's folder "msg"
JOINTS = ("sensor_msgs/JointState", "foxglove.JointStates")
#: Of one transform
SINGLE = ("geometry_msgs/TransformStamped", "foxglove.FrameTransform")
#: All that are read
KINDS_READ = (*JOINTS, *SINGLE, "tf2_msgs/TFMessage", "foxglove.FrameTransforms")
#: Fields of a time, in seconds and nanoseconds, of JSON, ROS and protobuf
STAMPS = (("sec", "nsec"), ("sec", "nanosec"), ("seconds", "nanos"))
#: Joint -> its position and velocity
State = dict[str, tuple[float, float | None]]
#: A message of a file: its topic, type, time of recording [s], and fields by attribute
FoundMessage = tuple[str, str, float, Any]


def read_motion(path: str | os.PathLike[str], topics: Sequence[str] = ()) -> RecordedMotion:
    """Joint states and transforms of an MCAP file or a ROS bag (1 or 2), without ROS.

        motion = wbc.formats.read_motion("bag")             # a folder of ROS 2, a .bag, or a .mcap
        controller["hand"].target = motion.pose("tool0", t)

    Read are ``sensor_msgs/JointState``, ``tf2_msgs/TFMessage`` and ``geometry_msgs/TransformStamped`` of ROS, and
    ``foxglove.JointStates``, ``foxglove.FrameTransforms`` and ``foxglove.FrameTransform`` in JSON or protobuf.

    Args:
        topics: those that are read; default: all of these types.

    Raises:
        MissingPackageError: the packages of the extra are not installed.
        FormatError: no such file or topic, damaged, no such messages in it, a number that is none, a frame with two
            parents, a joint with two states at once.
    """
    extras.require("formats", "a recording of another program")
    place = validation.file_path("path", path)
    if not validation.exists("path", place):
        raise FormatError("path", str(place), validation.no_such(place, "there is no such file or folder"))
    others: dict[str, str] = {}
    # Files of a folder whose recorder was killed, which has no metadata, can be read
    loose = [] if (place / "metadata.yaml").exists() else sorted(place.glob("*.mcap")) or sorted(place.glob("*.db3"))
    files = loose or [place]
    read = (
        (_mcap(file, topics, others) for file in files) if files[0].suffix == ".mcap" else [_bag(files, topics, others)]
    )
    try:
        return _gathered(itertools.chain.from_iterable(read), place, others, topics)
    except WbcError:
        raise
    except Exception as error:
        raise FormatError("path", str(place), f"cannot be read: {type(error).__name__}: {error}") from error


def _mcap(path: pathlib.Path, topics: Sequence[str], others: dict[str, str]) -> Iterator[FoundMessage]:
    from mcap.exceptions import EndOfFile
    from mcap.reader import NonSeekingReader

    decoders = dict[int, Callable[[bytes], Any]]()
    # A file whose writer was killed gives its whole chunks
    with path.open("rb") as file, contextlib.suppress(EndOfFile):
        for schema, channel, message in NonSeekingReader(file).iter_messages(log_time_order=False):
            kind = schema.name.replace("/msg/", "/") if schema is not None else ""
            if channel.id not in decoders:
                said, decoder = f"{kind or 'no schema'} in {channel.message_encoding or 'no encoding'}", None
                if _wanted(kind, channel.topic, topics):
                    try:
                        decoder = _decoder(schema, channel.message_encoding)
                    except MissingPackageError as error:
                        said = f"{said}; {error}"
                if decoder is None:
                    others[channel.topic] = said
                    continue
                decoders[channel.id] = decoder
            yield channel.topic, kind, message.log_time / NANO, decoders[channel.id](message.data)


def _decoder(schema: Any, encoding: str) -> Callable[[bytes], Any] | None:
    """What makes the fields of messages of their bytes; None: nothing here does.

    Raises:
        MissingPackageError: what would is not installed.
    """
    if encoding == "json":
        return lambda data: json.loads(data, object_hook=lambda fields: SimpleNamespace(**fields))
    if encoding == "cdr":
        from rosbags.typesys import Stores, get_typestore

        store = get_typestore(Stores.ROS2_HUMBLE)
        return lambda data: store.deserialize_cdr(data, schema.name)
    if encoding == "protobuf":
        extras.require("protobuf", "a recording of Foxglove in protobuf")
        from mcap_protobuf.decoder import DecoderFactory

        decoder: Callable[[bytes], Any] | None = DecoderFactory().decoder_for(encoding, schema)
        return decoder
    return None


def _bag(paths: Sequence[pathlib.Path], topics: Sequence[str], others: dict[str, str]) -> Iterator[FoundMessage]:
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    with AnyReader(paths, default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        kinds = {connection.id: connection.msgtype.replace("/msg/", "/") for connection in reader.connections}
        chosen = [one for one in reader.connections if _wanted(kinds[one.id], one.topic, topics)]
        others |= {one.topic: kinds[one.id] for one in reader.connections if one not in chosen}
        for connection, time, data in reader.messages(chosen) if chosen else ():
            fields = reader.deserialize(data, connection.msgtype)
            yield connection.topic, kinds[connection.id], time / NANO, fields


def _wanted(kind: str, topic: str, topics: Sequence[str]) -> bool:
    return kind in KINDS_READ and (not topics or topic in topics)


def _gathered(
    messages: Iterator[FoundMessage], path: pathlib.Path, others: dict[str, str], topics: Sequence[str]
) -> RecordedMotion:
    states: list[tuple[float, State]] = []
    poses: dict[str, tuple[str, list[tuple[float, list[float]]]]] = {}
    seen = set[str]()
    for topic, kind, time, fields in messages:
        seen.add(topic)
        if kind in JOINTS:
            if state := _state(fields, topic, kind):
                states.append((_stamp(fields, kind, time), state))
            continue
        for placed in [fields] if kind in SINGLE else fields.transforms:
            # What Foxglove has flat, ROS has in parts
            place, parent = getattr(placed, "transform", placed), getattr(placed, "parent_frame_id", None)
            child = str(placed.child_frame_id)
            numbers = [float(getattr(place.translation, x)) for x in "xyz"]
            numbers += [float(getattr(place.rotation, x)) for x in "xyzw"]
            if not np.isfinite(numbers).all() or abs(np.linalg.norm(numbers[3:]) - 1.0) > UNIT:
                raise FormatError(topic, numbers, f"the pose of {child!r} is none: a position and a unit quaternion")
            parent = str(placed.header.frame_id if parent is None else parent)
            known, moves = poses.setdefault(child, (parent, []))
            if known != parent:
                raise FormatError(topic, parent, f"is a second parent of {child!r}, which {known!r} has placed before")
            moves.append((_stamp(placed, kind, time), numbers))
    if missing := [topic for topic in topics if topic not in seen]:
        raise FormatError("topics", missing[0], "no messages of a type that is read", sorted(seen | others.keys()))
    if not states and not poses:
        said = "; ".join(f"{topic} ({kind})" for topic, kind in others.items()) or "no messages at all"
        raise FormatError("path", str(path), f"has neither joint states nor transforms, but {said}")
    # What stands may have been said long before the recording began
    dated: list[Sequence[tuple[float, Any]]] = [states, *(moves for _, moves in poses.values())]
    times = [[time for time, _ in each] for each in dated if each]
    begin = min(min(each) for each in [each for each in times if len(each) > 1] or times)
    frames = {}
    for child, (parent, moves) in poses.items():
        t, rows = _by_time([time - begin for time, _ in moves], np.array([numbers for _, numbers in moves]))
        rows[:, 3:] /= np.linalg.norm(rows[:, 3:], axis=1, keepdims=True)
        frames[child] = Path6(parent, t, rows)
    remarks = tuple(f"not read: {topic} ({kind})" for topic, kind in sorted(others.items()))
    return RecordedMotion(*_rows(states, begin), frames, remarks)


def _state(fields: Any, topic: str, kind: str) -> State:
    if kind.startswith("foxglove"):
        parts = [(x.name, _optional(x, "position"), _optional(x, "velocity")) for x in fields.joints]
    else:
        count = len(fields.name)
        columns = [fields.name, *([*part] or [None] * count for part in (fields.position, fields.velocity))]
        if len(sizes := {len(column) for column in columns}) > 1:
            raise FormatError(topic, sizes, f"numbers for {count} joints were due")
        parts = list(zip(*columns, strict=True))
    out: State = {}
    for name, position, velocity in parts:
        if position is None:
            continue
        if not isinstance(name, str):
            raise FormatError(topic, name, "is no name of a joint")
        if velocity is not None and np.isnan(velocity):
            # As ros2_control writes what it does not measure
            velocity = None
        if not np.isfinite([position, velocity or 0.0]).all():
            raise FormatError(topic, (position, velocity), f"the state of {name!r} is no finite number")
        if name in out:
            raise FormatError(topic, name, "has two states in one message")
        out[name] = float(position), None if velocity is None else float(velocity)
    return out


def _optional(fields: Any, name: str) -> Any:
    """A field, or None; protobuf has a number where there is none."""
    return None if hasattr(fields, "HasField") and not fields.HasField(name) else getattr(fields, name, None)


def _rows(states: list[tuple[float, State]], begin: float) -> tuple[tuple[str, ...], Array, Array, Array | None]:
    """Joints, times, positions and velocities: a row a message, from the first on after which all joints are known."""
    joints = tuple(dict.fromkeys(name for _, state in states for name in state))
    last: State = {}
    times, rows = list[float](), list[list[tuple[float, float | None]]]()
    for time, state in sorted(states, key=lambda pair: pair[0]):
        last |= state
        if len(last) == len(joints):
            times.append(time - begin)
            rows.append([last[name] for name in joints])
    # A velocity that is not given is NaN here
    t, numbers = _by_time(times, np.array(rows, dtype=np.float64).reshape(len(rows), len(joints), 2))
    known = bool(rows) and not np.isnan(numbers[..., 1]).any()
    return joints, t, numbers[..., 0], numbers[..., 1] if known else None


def _by_time(times: Sequence[float], values: Array) -> tuple[Array, Array]:
    """Sorted by time, of several at one time the last."""
    t = np.asarray(times, dtype=np.float64)
    order = np.argsort(t, kind="stable")
    last = order[np.append(np.diff(t[order]) > 0.0, True)[: len(t)]]
    return t[last], values[last]


def _stamp(fields: Any, kind: str, time: float) -> float:
    """The message's own time [s], that of its recording where it has none."""
    own = getattr(fields, "timestamp", None) if kind.startswith("foxglove") else fields.header.stamp
    if own is None:
        return time
    names = next((names for names in STAMPS if all(hasattr(own, name) for name in names)), STAMPS[0])
    seconds, nanoseconds = (getattr(own, name) for name in names)
    value = float(seconds + nanoseconds / NANO)
    if not np.isfinite(value):
        raise FormatError("timestamp", value, "is no finite number")
    return value or time
