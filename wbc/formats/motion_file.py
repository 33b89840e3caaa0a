"""Joint states and transforms of MCAP files and ROS bags."""

from __future__ import annotations

import contextlib
import itertools
import json
import math
import os
import pathlib
import struct
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
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
#: Message types of joints that are read, without the package's folder "msg"
JOINTS = ("sensor_msgs/JointState", "foxglove.JointStates")
#: Of one transform
SINGLE = ("geometry_msgs/TransformStamped", "foxglove.FrameTransform")
#: All that are read
KINDS_READ = (*JOINTS, *SINGLE, "tf2_msgs/TFMessage", "foxglove.FrameTransforms")
#: A message of a file: its topic, type, time of recording [s], and fields by attribute
FoundMessage = tuple[str, str, float, Any]
#: A joint, or a frame and its parent
Way = tuple[str, str | None]


def read_motion(path: str | os.PathLike[str], topics: Sequence[str] = ()) -> RecordedMotion:
    """Joint states and transforms of an MCAP file or a ROS bag (1 or 2), without ROS.

        motion = wbc.formats.read_motion("bag")             # a folder of ROS 2, a .bag, or a .mcap
        controller["hand"].target = motion.pose("tool0", t)

    Args:
        topics: those that are read; default: all of :data:`KINDS_READ`.

    Raises:
        MissingPackageError: the packages of the extra are not installed.
        FormatError: no such file or topic, damaged, no such messages in it, a number that is none, a frame with two
            parents, a joint with two states at once.
    """
    extras.require("formats", "a recording of another program")
    place = validation.file_path("path", path)
    if not validation.exists("path", place):
        raise FormatError("path", str(place), validation.no_such(place, "there is no such file or folder"))
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
            kind, encoding = schema.name.replace("/msg/", "/") if schema else "", channel.message_encoding
            if channel.id not in decoders:
                wanted = _wanted(kind, channel.topic, topics)
                decoders[channel.id] = _decoder(schema, encoding) if wanted else None
            if (decoder := decoders[channel.id]) is not None:
                yield channel.topic, kind, message.log_time / NANO, decoder(message.data)
            else:
                others[channel.topic] = f"{kind or 'no schema'} in {encoding or 'no encoding'}"


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
        for connection, time, data in reader.messages(chosen) if chosen else ():
            fields = reader.deserialize(data, connection.msgtype)
            yield connection.topic, kinds[connection.id], time / NANO, fields


def ros2_types() -> Any:
    """Types of the messages of ROS 2, by which rosbags reads and writes them."""
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_JAZZY)


def _wanted(kind: str, topic: str, topics: Sequence[str]) -> bool:
    return kind in KINDS_READ and (not topics or topic in topics)


def _gathered(
    messages: Iterator[FoundMessage], path: pathlib.Path, others: dict[str, str], topics: Sequence[str]
) -> RecordedMotion:
    # A moment is a clock, of a topic's joints or of one frame, the time that a message says, and that of the recording;
    # a row is the number of its moment, and where a joint or frame was
    clocks, moments = dict[tuple[str, str], int](), list[tuple[int, float, float]]()
    ways, seen = defaultdict[Way, list[tuple[float, ...]]](list), set[str]()
    for topic, kind, recorded, fields in messages:
        seen.add(topic)
        try:
            for frame, stamped, rows in _parts(fields, topic, kind):
                for way, row in rows.items():
                    ways[way].append((len(moments), *row))
                clock = clocks.setdefault((topic, frame), len(clocks))
                moments.append((clock, _stamp(stamped), recorded))
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            raise FormatError(topic, f"message at {recorded:.9g} s", f"is no {kind}: {error}") from error
    if missing := [topic for topic in topics if topic not in seen]:
        raise FormatError("topics", missing[0], "no messages of a type that is read", sorted(seen | others.keys()))
    if not moments:
        said = "; ".join(f"{topic} ({kind})" for topic, kind in others.items()) or "no messages at all"
        raise FormatError("path", str(path), f"has neither joint states nor transforms, but {said}")
    numbers, own, recordings = np.array(moments).T
    # Those of the recording where no message of a clock says one; a simulation's first one may say 0
    times = np.where(np.isin(numbers, numbers[own != 0.0]), own, recordings)
    remarks = [f"not read: {topic} ({kind})" for topic, kind in sorted(others.items())]
    remarks += _odd_times({" ".join(key).strip(): times[numbers == number] for key, number in clocks.items()})
    ways_by_time = {way: (times[[int(k) for k, *_ in rows]], np.array(rows)[:, 1:]) for way, rows in ways.items()}
    return _motion(ways_by_time, remarks)


def _motion(ways: dict[Way, tuple[Array, Array]], remarks: list[str]) -> RecordedMotion:
    """A motion of the times and numbers of joints and frames."""
    # What stands may have been said long before the recording began
    begin = min(t.min() for t in [t for t, _ in ways.values() if len(t) > 1] or [t for t, _ in ways.values()])
    joints, frames, twice = dict[str, tuple[Array, Array]](), dict[str, Path6](), list[str]()
    for (name, parent), (stamps, numbers) in ways.items():
        order = np.argsort(stamps, kind="stable")
        t, numbers = stamps[order] - begin, numbers[order]
        again = np.diff(t) == 0.0
        if not np.array_equal(numbers[:-1][again], numbers[1:][again], equal_nan=True):
            twice.append(name)
        t, numbers = t[np.append(~again, True)], numbers[np.append(~again, True)]
        if parent is None:
            joints[name] = t, numbers
        elif name in frames:
            reason = f"is a second parent of {name!r}, which {frames[name].parent!r} places as well"
            raise FormatError("path", parent, reason)
        else:
            numbers[:, 3:] /= np.linalg.norm(numbers[:, 3:], axis=1, keepdims=True)
            frames[name] = Path6(parent, t, numbers)
    if twice:
        remarks.append(f"several states at one time, of which the last is taken: {', '.join(twice)}")
    # A row whenever a joint is named, from when all are known
    t = np.unique(np.concatenate([np.zeros(0), *(own for own, _ in joints.values())]))
    t = t[t >= max((own[0] for own, _ in joints.values()), default=0.0)]
    held = [numbers[np.searchsorted(own, t, side="right") - 1] for own, numbers in joints.values()]
    q, v = np.array(held).reshape(len(joints), len(t), 2).T.copy()
    known = len(t) > 0 and not np.isnan(v).any()
    return RecordedMotion(tuple(joints), t, q, v if known else None, frames, tuple(remarks))


def _odd_times(clocks: dict[str, Array]) -> Iterator[str]:
    for name, t in clocks.items():
        if (back := -np.diff(t).min(initial=0.0)) > 0.0:
            yield f"{name}: time goes back, by {back:.3g} s at most; messages are taken in the order of their times"
    if spans := [(t.min(), t.max(), name) for name, t in clocks.items() if len(t) > 1]:
        (_, ended, first), (began, _, last) = min(spans, key=lambda span: span[1]), max(spans)
        if began - ended > max(end - start for start, end, _ in spans):
            yield f"{last} begins {began - ended:.6g} s after {first} ends: are they of one clock?"


def _parts(fields: Any, topic: str, kind: str) -> Iterator[tuple[str, Any, dict[Way, tuple[float, ...]]]]:
    """Frame, "" of joints, what has its stamp, and numbers: q, v, or x, y, z [m], quaternion x, y, z, w."""
    if kind in JOINTS:
        if state := _state(fields, topic, kind):
            yield "", fields, {(name, None): row for name, row in state.items()}
        return
    for placed in [fields] if kind in SINGLE else fields.transforms:
        # What Foxglove has flat, ROS has in parts
        place, parent = getattr(placed, "transform", placed), getattr(placed, "parent_frame_id", None)
        child, parent = str(placed.child_frame_id), str(placed.header.frame_id if parent is None else parent)
        row = [float(getattr(place.translation, x)) for x in "xyz"]
        row += [float(getattr(place.rotation, x)) for x in "xyzw"]
        if not np.isfinite(row).all() or abs(np.linalg.norm(row[3:]) - 1.0) > UNIT:
            raise FormatError(topic, row, f"the pose of {child!r} is none: a position and a unit quaternion")
        yield child, placed, {(child, parent): tuple(row)}


def _state(fields: Any, topic: str, kind: str) -> dict[str, tuple[float, float]]:
    """Joint -> its position, and its velocity, NaN where it is not given."""
    if kind.startswith("foxglove"):
        parts = [(each.name, _optional(each, "position"), _optional(each, "velocity")) for each in fields.joints]
    else:
        if sizes := {len(fields.position), len(fields.velocity)} - {0, len(fields.name)}:
            raise FormatError(topic, sizes, f"numbers for {len(fields.name)} joints were due")
        parts = list(itertools.zip_longest(fields.name, fields.position, fields.velocity))
    out: dict[str, tuple[float, float]] = {}
    for name, position, velocity in parts:
        if position is None:
            continue
        if not isinstance(name, str):
            raise FormatError(topic, name, "is no name of a joint")
        if name in out:
            raise FormatError(topic, name, "has two states in one message")
        # NaN is also what ros2_control writes for what it does not measure
        out[name] = float(position), math.nan if velocity is None else float(velocity)
        if not math.isfinite(out[name][0]) or math.isinf(out[name][1]):
            raise FormatError(topic, out[name], f"the state of {name!r} is no finite number")
    return out


def _optional(fields: Any, name: str) -> Any:
    """A field, or None; protobuf has a number where there is none."""
    return None if hasattr(fields, "HasField") and not fields.HasField(name) else getattr(fields, name, None)


def _stamp(fields: Any) -> float:
    """The message's own time [s]; 0 where it has none."""
    own = getattr(getattr(fields, "header", None), "stamp", getattr(fields, "timestamp", None))
    if own is None:
        return 0.0
    # As JSON, ROS and protobuf call them
    seconds, part = (
        getattr(own, name) for name in ("sec", "seconds", "nsec", "nanosec", "nanos") if hasattr(own, name)
    )
    if not math.isfinite(value := float(seconds + part / NANO)):
        raise FormatError("timestamp", value, "is no finite number")
    return value
