"""Joint states and transforms of MCAP files and ROS bags."""

from __future__ import annotations

import contextlib
import itertools
import json
import math
import os
import pathlib
import struct
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


class Clock:
    """Times of the messages of a topic, or of one frame of it.

    Attributes:
        said: what they say [s], 0 where they say nothing. recorded: when they were recorded [s].
    """

    def __init__(self) -> None:
        self.said, self.recorded = list[float](), list[float]()

    @property
    def times(self) -> list[float]:
        """Their own [s]; those of the recording where none has one. A simulation's first message may say 0."""
        return self.said if any(self.said) else self.recorded

    @property
    def goes_back(self) -> float:
        """By how much a message is before the one that came before it, at most [s]."""
        return float(max(0.0, -np.diff(self.times).min(initial=0.0)))


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
    with path.open("rb") as file, contextlib.suppress(EndOfFile, struct.error):
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
    clocks = dict[tuple[str, str], Clock]()
    states: list[tuple[Clock, int, State]] = []
    poses: dict[str, tuple[str, list[tuple[Clock, int, list[float]]]]] = {}
    seen = set[str]()

    def stamped(topic: str, child: str, fields: Any, time: float) -> tuple[Clock, int]:
        clock = clocks.setdefault((topic, child), Clock())
        clock.said.append(_stamp(fields, kind))
        clock.recorded.append(time)
        return clock, len(clock.said) - 1

    for topic, kind, time, fields in messages:
        seen.add(topic)
        try:
            if kind in JOINTS:
                if state := _state(fields, topic, kind):
                    states.append((*stamped(topic, "", fields, time), state))
                continue
            for placed in [fields] if kind in SINGLE else fields.transforms:
                parent, child, numbers = _placed(placed, topic)
                known, moves = poses.setdefault(child, (parent, []))
                if known != parent:
                    reason = f"is a second parent of {child!r}, which {known!r} has placed before"
                    raise FormatError(topic, parent, reason)
                moves.append((*stamped(topic, child, placed, time), numbers))
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            if isinstance(error, WbcError):
                raise
            raise FormatError(topic, f"message at {time:.9g} s", f"is no {kind}: {error}") from error
    if missing := [topic for topic in topics if topic not in seen]:
        raise FormatError("topics", missing[0], "no messages of a type that is read", sorted(seen | others.keys()))
    if not states and not poses:
        said = "; ".join(f"{topic} ({kind})" for topic, kind in others.items()) or "no messages at all"
        raise FormatError("path", str(path), f"has neither joint states nor transforms, but {said}")
    dated = [(clock.times[k], state) for clock, k, state in states]
    moved = {child: [(clock.times[k], row) for clock, k, row in moves] for child, (_, moves) in poses.items()}
    # What stands may have been said long before the recording began
    times = [[time for time, _ in dated], *([time for time, _ in way] for way in moved.values())]
    begin = min(min(each) for each in [each for each in times if len(each) > 1] or times if each)
    remarks = [f"not read: {topic} ({kind})" for topic, kind in sorted(others.items())]
    remarks += [
        f"{topic}{f', {child}' if child else ''}: time goes back, by {back:.3g} s at most; messages are taken in the "
        "order of their times"
        for (topic, child), clock in clocks.items()
        if (back := clock.goes_back)
    ]
    spans = {key: (min(clock.times), max(clock.times)) for key, clock in clocks.items() if len(clock.times) > 1}
    if spans:
        first, last = min(spans, key=lambda key: spans[key][1]), max(spans, key=lambda key: spans[key][0])
        if (apart := spans[last][0] - spans[first][1]) > max(end - start for start, end in spans.values()):
            ends, begins = (" ".join(key).strip() for key in (first, last))
            remarks.append(f"{begins} begins {apart:.6g} s after {ends} ends: are they of one clock?")
    frames = {}
    for child, way in moved.items():
        values = np.array([numbers for _, numbers in way])
        t, rows = _by_time([time - begin for time, _ in way], values)
        if len(t) < len(np.unique(np.column_stack([[time for time, _ in way], values]), axis=0)):
            remarks.append(f"{child} has several poses at one time, of which the last is taken")
        rows[:, 3:] /= np.linalg.norm(rows[:, 3:], axis=1, keepdims=True)
        frames[child] = Path6(poses[child][0], t, rows)
    return RecordedMotion(*_rows(dated, begin, remarks), frames, tuple(remarks))


def _placed(placed: Any, topic: str) -> tuple[str, str, list[float]]:
    """Parent, child, and x, y, z [m], quaternion x, y, z, w of a transform."""
    # What Foxglove has flat, ROS has in parts
    place, parent = getattr(placed, "transform", placed), getattr(placed, "parent_frame_id", None)
    child = str(placed.child_frame_id)
    numbers = [float(getattr(place.translation, x)) for x in "xyz"]
    numbers += [float(getattr(place.rotation, x)) for x in "xyzw"]
    if not np.isfinite(numbers).all() or abs(np.linalg.norm(numbers[3:]) - 1.0) > UNIT:
        raise FormatError(topic, numbers, f"the pose of {child!r} is none: a position and a unit quaternion")
    return str(placed.header.frame_id if parent is None else parent), child, numbers


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
        position, velocity = float(position), math.nan if velocity is None else float(velocity)
        if not math.isfinite(position) or math.isinf(velocity):
            raise FormatError(topic, (position, velocity), f"the state of {name!r} is no finite number")
        if name in out:
            raise FormatError(topic, name, "has two states in one message")
        # NaN is what ros2_control writes for what it does not measure
        out[name] = position, None if math.isnan(velocity) else velocity
    return out


def _optional(fields: Any, name: str) -> Any:
    """A field, or None; protobuf has a number where there is none."""
    return None if hasattr(fields, "HasField") and not fields.HasField(name) else getattr(fields, name, None)


def _rows(
    states: list[tuple[float, State]], begin: float, remarks: list[str]
) -> tuple[tuple[str, ...], Array, Array, Array | None]:
    """Joints, times, positions and velocities: a row a message, from the first on after which all joints are known."""
    joints = tuple(dict.fromkeys(name for _, state in states for name in state))
    last: State = {}
    times, rows, twice = list[float](), list[list[tuple[float, float | None]]](), dict[str, None]()
    at_once, since = State(), -np.inf
    for time, state in sorted(states, key=lambda pair: pair[0]):
        at_once, since = at_once if time == since else {}, time
        twice |= dict.fromkeys(name for name in state if at_once.get(name, state[name]) != state[name])
        at_once |= state
        last |= state
        if len(last) == len(joints):
            times.append(time - begin)
            rows.append([last[name] for name in joints])
    if twice:
        remarks.append(f"several states at one time, of which the last is taken: {', '.join(twice)}")
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


def _stamp(fields: Any, kind: str) -> float:
    """The message's own time [s]; 0 where it has none."""
    own = getattr(fields, "timestamp", None) if kind.startswith("foxglove") else fields.header.stamp
    if own is None:
        return 0.0
    names = next((names for names in STAMPS if all(hasattr(own, name) for name in names)), STAMPS[0])
    seconds, nanoseconds = (getattr(own, name) for name in names)
    value = float(seconds + nanoseconds / NANO)
    if not np.isfinite(value):
        raise FormatError("timestamp", value, "is no finite number")
    return value
