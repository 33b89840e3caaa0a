"""Joint states and transforms of MCAP files and ROS bags."""

from __future__ import annotations

import contextlib
import itertools
import json
import math
import os
import pathlib
import struct
from array import array
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np

from wbc import extras, validation
from wbc.errors import WbcError
from wbc.formats.errors import FormatError
from wbc.formats.messages import NANO
from wbc.formats.motion import Path6, RecordedMotion
from wbc.validation import Array

#: Largest difference of a quaternion's length from 1
UNIT = 1e-3
#: Message types of joints, without the package's folder "msg"
JOINTS = ("sensor_msgs/JointState", "foxglove.JointStates")
#: Of one transform, and of several
FRAMES = ("geometry_msgs/TransformStamped", "foxglove.FrameTransform", "tf2_msgs/TFMessage", "foxglove.FrameTransforms")
#: A message of a file: its topic, type, time of recording [s], and fields by attribute
FoundMessage = tuple[str, str, float, Any]
#: A joint, or a frame and its parent
Way = tuple[str, str | None]


def read_motion(path: str | os.PathLike[str], topics: Sequence[str] = ()) -> RecordedMotion:
    """Joint states and transforms of an MCAP file, or a ROS bag (1 or 2: a ``.bag``, or a folder), without ROS.

    Args:
        topics: those that are read; default: all of the types :data:`JOINTS` and :data:`FRAMES`.

    Raises:
        MissingPackageError: the packages of the extra are not installed.
        FormatError: no such file or topic, damaged, no such messages in it, a number that is none, a frame with two
            parents, a joint with two states at once.
    """
    extras.require("formats", "a recording of another program")
    place = validation.existing("path", path, FormatError)
    # Files of a folder whose recorder was killed, which has no metadata, can be read
    loose = [] if (place / "metadata.yaml").exists() else sorted(place.glob("*.mcap")) or sorted(place.glob("*.db3"))
    files, others = loose or [place], dict[str, str]()
    mcap = files[0].suffix == ".mcap"
    read = [_mcap(file, topics, others) for file in files] if mcap else [_bag(files, topics, others)]
    try:
        return _gathered(itertools.chain.from_iterable(read), place, others, topics)
    except WbcError:
        raise
    except Exception as error:
        raise FormatError("path", str(place), f"cannot be read: {type(error).__name__}: {error}") from error


def _mcap(path: pathlib.Path, topics: Sequence[str], others: dict[str, str]) -> Iterator[FoundMessage]:
    from mcap.exceptions import EndOfFile
    from mcap.reader import NonSeekingReader

    decoders = dict[int, Callable[[bytes], Any] | None]()
    # A file whose writer was killed gives its whole chunks
    with path.open("rb") as file, contextlib.suppress(EndOfFile, struct.error):
        for schema, channel, message in NonSeekingReader(file).iter_messages(log_time_order=False):
            topic, kind = channel.topic, schema.name.replace("/msg/", "/") if schema else "no schema"
            if channel.id not in decoders:
                wanted = _wanted(kind, topic, topics)
                decoders[channel.id] = _decoder(schema, channel.message_encoding) if wanted else None
            if (decoder := decoders[channel.id]) is not None:
                yield topic, kind, message.log_time / NANO, decoder(message.data)
            else:
                others[topic] = f"{kind} in {channel.message_encoding or 'no encoding'}"


def _decoder(schema: Any, encoding: str) -> Callable[[bytes], Any] | None:
    """What makes the fields of messages of their bytes; None: nothing here does."""
    if encoding == "json":
        return lambda data: json.loads(data, object_hook=lambda fields: SimpleNamespace(**fields))
    if encoding == "cdr":
        store = ros2_types()
        return lambda data: store.deserialize_cdr(data, schema.name)
    if encoding == "protobuf":
        extras.require("protobuf", "a recording of Foxglove in protobuf")
        from mcap_protobuf.decoder import DecoderFactory

        decoder: Callable[[bytes], Any] | None = DecoderFactory().decoder_for(encoding, schema)
        return decoder
    return None


def _bag(paths: Sequence[pathlib.Path], topics: Sequence[str], others: dict[str, str]) -> Iterator[FoundMessage]:
    from rosbags.highlevel import AnyReader

    with AnyReader(paths, default_typestore=ros2_types()) as reader:
        kinds = {connection.id: connection.msgtype.replace("/msg/", "/") for connection in reader.connections}
        chosen = [each for each in reader.connections if _wanted(kinds[each.id], each.topic, topics)]
        others |= {each.topic: kinds[each.id] for each in reader.connections if each not in chosen}
        for each, time, data in reader.messages(chosen) if chosen else ():
            yield each.topic, kinds[each.id], time / NANO, reader.deserialize(data, each.msgtype)


def ros2_types() -> Any:
    """Types of the messages of ROS 2, by which rosbags reads and writes them."""
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_JAZZY)


def _wanted(kind: str, topic: str, topics: Sequence[str]) -> bool:
    return kind in JOINTS + FRAMES and (not topics or topic in topics)


def _gathered(
    messages: Iterable[FoundMessage], path: pathlib.Path, others: Mapping[str, str], topics: Sequence[str]
) -> RecordedMotion:
    # A row is the number of a joint or frame, that of its clock (a topic's joints, or one frame), the time that its
    # message says, that of the recording, and a pose, or a position and a velocity
    numbers, ways, clocks, seen = array("d"), dict[Way, int](), dict[tuple[str, str], int](), set[str]()
    for topic, kind, recorded, fields in messages:
        seen.add(topic)
        try:
            for name, parent, stamp, state in _states(fields, kind) if kind in JOINTS else _poses(fields):
                way = ways.setdefault((name, parent), len(ways))
                clock = clocks.setdefault((topic, "" if parent is None else name), len(clocks))
                numbers.extend((way, clock, stamp, recorded, *state))
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            raise FormatError(topic, f"message at {recorded:.9g} s", f"is no {kind}: {error}") from error
    if missing := [topic for topic in topics if topic not in seen]:
        raise FormatError("topics", missing[0], "no messages of a type that is read", sorted(seen | others.keys()))
    if not ways:
        said = "; ".join(f"{topic} ({kind})" for topic, kind in others.items()) or "no messages at all"
        raise FormatError("path", str(path), f"has neither joint states nor transforms, but {said}")
    rows = np.array(numbers).reshape(-1, 11)
    of_way, of_clock, stamps, recordings = rows[:, :4].T
    # Those of the recording where no message of a clock says one; a simulation's first one may say 0
    times = np.where(np.isin(of_clock, of_clock[stamps != 0.0]), stamps, recordings)
    remarks = [f"not read: {topic} ({kind})" for topic, kind in sorted(others.items())]
    remarks += _odd_times({" ".join(key).strip(): times[of_clock == clock] for key, clock in clocks.items()})
    return _motion({way: (times[of_way == k], rows[of_way == k, 4:]) for way, k in ways.items()}, remarks)


def _motion(ways: Mapping[Way, tuple[Array, Array]], remarks: list[str]) -> RecordedMotion:
    """A motion of the times and numbers of joints and frames."""
    # What stands may have been said long before the recording began
    begin = min(t.min() for t in [t for t, _ in ways.values() if len(t) > 1] or [t for t, _ in ways.values()])
    joints, frames, twice = dict[str, tuple[Array, Array]](), dict[str, Path6](), list[str]()
    for (name, parent), (stamps, said) in ways.items():
        t, last = np.unique(stamps[::-1], return_index=True)
        states = said[::-1][last]
        if not np.array_equal(said, states[np.searchsorted(t, stamps)], equal_nan=True):
            twice.append(name)
        if parent is None:
            joints[name] = t - begin, states[:, :2]
        elif name in frames:
            reason = f"is a second parent of {name!r}, which {frames[name].parent!r} places as well"
            raise FormatError("path", parent, reason)
        else:
            states[:, 3:] /= np.linalg.norm(states[:, 3:], axis=1, keepdims=True)
            frames[name] = Path6(parent, t - begin, states)
    if twice:
        remarks.append(f"several states at one time, of which the last is taken: {', '.join(twice)}")
    # A row whenever a joint is named, from when all are known
    t = np.unique(np.concatenate([np.zeros(0), *(own for own, _ in joints.values())]))
    t = t[t >= max((own[0] for own, _ in joints.values()), default=0.0)]
    held = [states[np.searchsorted(own, t, side="right") - 1] for own, states in joints.values()]
    q, v = np.array(held).reshape(len(joints), len(t), 2).T.copy()
    rates = None if len(t) == 0 or np.isnan(v).any() else v
    return RecordedMotion(tuple(joints), t, q, rates, frames, tuple(remarks))


def _odd_times(clocks: Mapping[str, Array]) -> Iterator[str]:
    for name, t in clocks.items():
        if (back := -np.diff(t).min(initial=0.0)) > 0.0:
            yield f"{name}: time goes back, by {back:.3g} s at most; messages are taken in the order of their times"
    if spans := [(t.min(), t.max(), name) for name, t in clocks.items() if np.ptp(t) > 0.0]:
        (_, ended, first), (began, _, last) = min(spans, key=lambda span: span[1]), max(spans)
        if began - ended > max(end - start for start, end, _ in spans):
            yield f"{last} begins {began - ended:.6g} s after {first} ends: are they of one clock?"


#: A joint, or a frame and its parent, the time that a message says [s], and seven numbers: position and velocity, NaN
#: where it is not given, and zeros, or x, y, z [m], quaternion x, y, z, w
State = tuple[str, str | None, float, Sequence[float]]


def _states(fields: Any, kind: str) -> Iterator[State]:
    if kind == "foxglove.JointStates":
        parts: Any = ((each.name, _optional(each, "position"), _optional(each, "velocity")) for each in fields.joints)
    elif sizes := {len(fields.position), len(fields.velocity)} - {0, len(fields.name)}:
        raise ValueError(f"{sizes} numbers for {len(fields.name)} joints")
    else:
        parts = itertools.zip_longest(fields.name, fields.position, fields.velocity)
    stamp, named = _stamp(fields), set[str]()
    for name, position, velocity in parts:
        if position is None:
            continue
        if not isinstance(name, str) or name in named:
            raise ValueError(f"{name!r} " + ("has two states" if name in named else "is no name of a joint"))
        named.add(name)
        # NaN is also what ros2_control writes for what it does not measure
        state = float(position), math.nan if velocity is None else float(velocity)
        if not math.isfinite(state[0]) or math.isinf(state[1]):
            raise ValueError(f"the state {state} of {name!r} is no finite number")
        yield name, None, stamp, (*state, 0.0, 0.0, 0.0, 0.0, 0.0)


def _poses(fields: Any) -> Iterator[State]:
    for placed in getattr(fields, "transforms", [fields]):
        # What Foxglove has flat, ROS has in parts
        place, parent = getattr(placed, "transform", placed), getattr(placed, "parent_frame_id", None)
        child, parent = str(placed.child_frame_id), str(placed.header.frame_id if parent is None else parent)
        pose = [float(getattr(place.translation, x)) for x in "xyz"]
        pose += [float(getattr(place.rotation, x)) for x in "xyzw"]
        if not np.isfinite(pose).all() or abs(np.linalg.norm(pose[3:]) - 1.0) > UNIT:
            raise ValueError(f"the pose {pose} of {child!r} is none: a position and a unit quaternion")
        yield child, parent, _stamp(placed), pose


def _optional(fields: Any, name: str) -> Any:
    """A field, or None; protobuf has a number where there is none."""
    return None if hasattr(fields, "HasField") and not fields.HasField(name) else getattr(fields, name, None)


def _stamp(fields: Any) -> float:
    """The message's own time [s]; 0 where it has none."""
    own = getattr(getattr(fields, "header", None), "stamp", getattr(fields, "timestamp", None))
    # As JSON, ROS and protobuf call them
    names = ("sec", "seconds", "nsec", "nanosec", "nanos")
    seconds, part = [getattr(own, name) for name in names if hasattr(own, name)] or (0, 0)
    if not math.isfinite(value := float(seconds + part / NANO)):
        raise ValueError(f"its timestamp {value} is no finite number")
    return value
