"""Motions that other programs recorded: joint states and transforms of MCAP files and ROS bags."""

from __future__ import annotations

import contextlib
import fnmatch
import itertools
import json
import logging
import os
import pathlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

from wbc import extras, validation
from wbc.errors import UnknownNameError
from wbc.formats.errors import FormatError
from wbc.formats.messages import NANO
from wbc.multibody import pin
from wbc.robot.robot import Robot, checked_robot
from wbc.validation import Array

log = logging.getLogger("wbc")

#: Largest difference of a quaternion's length from 1
UNIT = 1e-3
#: Message types of joints that are read, without the package's folder "msg"
JOINTS = ("sensor_msgs/JointState", "foxglove.JointStates")
#: Of transforms
TRANSFORMS = ("tf2_msgs/TFMessage", "foxglove.FrameTransforms")
#: Of one transform
SINGLE = ("geometry_msgs/TransformStamped", "foxglove.FrameTransform")
#: Joint -> its position and velocity
State = dict[str, tuple[float, float | None]]
#: A message of a file: its topic, type, time of recording [s], and fields by attribute
FoundMessage = tuple[str, str, float, Any]


@dataclass(frozen=True, eq=False)
class Path6:
    """A frame in its parent over time: ``t`` [n] s, ``poses`` [n x 7]: x, y, z [m], quaternion x, y, z, w."""

    parent: str
    t: Array
    poses: Array

    def at(self, time: float) -> pin.SE3:
        """The pose at a time [s], along the screw between its neighbours; before and after them theirs."""
        k = int(np.clip(np.searchsorted(self.t, time, side="right") - 1, 0, len(self.t) - 1))
        if k + 1 == len(self.t) or time <= self.t[k]:
            return pin.XYZQUATToSE3(self.poses[k])
        share = (time - self.t[k]) / (self.t[k + 1] - self.t[k])
        return pin.SE3.Interpolate(*map(pin.XYZQUATToSE3, self.poses[k : k + 2]), share)


@dataclass(frozen=True, eq=False)
class RecordedMotion:
    """Joints and frames over time.

    Attributes:
        joints: names. t: times of ``q`` [n], from the first message of the file on [s].
        q: positions [n x joints, rad or m]; a joint that a message does not name has its last one.
        v: velocities [n x joints, rad/s or m/s]; None where a message gives none.
        frames: name -> the frame in its parent.
        remarks: topics that are not read, and why.
    """

    joints: tuple[str, ...]
    t: Array
    q: Array
    v: Array | None
    frames: Mapping[str, Path6]
    remarks: tuple[str, ...] = ()

    def pose(self, frame: str, time: float, relative_to: str = "") -> pin.SE3:
        """A frame at a time [s], as a target: in the root of its tree, or in a frame above it.

        Raises:
            UnknownNameError: no such frame. FormatError: frames that are each other's parents, or no such one above.
        """
        validation.one_of("frame", frame, self.frames)
        out, above, passed = pin.SE3.Identity(), frame, set[str]()
        while above in self.frames and above != relative_to:
            if above in passed:
                raise FormatError("frame", frame, f"is placed in a circle through {above}")
            passed.add(above)
            out, above = self.frames[above].at(time) * out, self.frames[above].parent
        if relative_to and above != relative_to:
            raise FormatError("relative_to", relative_to, f"{frame} does not hang on it, but on {above}")
        return out

    def at(self, time: float) -> Array:
        """Positions of all joints at a time [s], linear between messages, at the ends theirs."""
        return np.array([np.interp(time, self.t, column) for column in self.q.T])

    def configurations(self, robot: Robot, ignored: Sequence[str] = ()) -> Array:
        """Configurations [n, nq]; joints of the robot that nothing is recorded of stand as in its neutral one.

        Args:
            ignored: names or patterns of recorded joints that the robot need not have.

        Raises:
            UnknownNameError: a recorded joint that the robot has not. FormatError: one with several coordinates.
        """
        robot = checked_robot(robot)
        model, out = robot.model, np.tile(robot.neutral, (len(self.t), 1))
        for name, values in zip(self.joints, self.q.T, strict=True):
            if not model.existJointName(name):
                if any(fnmatch.fnmatch(name, pattern) for pattern in ignored):
                    continue
                raise UnknownNameError("joint", name, robot.joint_names)
            number = model.getJointId(name)
            first = int(model.idx_qs[number])
            if model.nvs[number] != 1:
                raise FormatError("joint", name, "has several degrees of freedom; its state is no one number")
            out[:, first] = values
            if model.nqs[number] == 2:
                out[:, first], out[:, first + 1] = np.cos(values), np.sin(values)
        if still := [name for name in robot.joint_names if name not in self.joints]:
            log.warning("nothing is recorded of these joints, which stand as in neutral: %s", ", ".join(still))
        return out


def read_motion(path: str | os.PathLike[str], topics: Sequence[str] = ()) -> RecordedMotion:
    """Joint states and transforms of an MCAP file or a ROS bag (1 or 2), without ROS.

        motion = wbc.formats.read_motion("bag")             # a folder of ROS 2, a .bag, or a .mcap
        controller["hand"].target = motion.pose("tool0", t)

    Read are ``sensor_msgs/JointState``, ``tf2_msgs/TFMessage`` and ``geometry_msgs/TransformStamped`` of ROS, and
    ``foxglove.JointStates``, ``foxglove.FrameTransforms`` and ``foxglove.FrameTransform`` in JSON.

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
    files = [place] if place.is_file() else sorted(place.glob("*.mcap"))
    # A folder whose recorder was killed has no metadata, but its files can be read
    loose = files and files[0].suffix == ".mcap" and not (place / "metadata.yaml").exists()
    read = (_mcap(file, topics, others) for file in files) if loose else [_bag(place, topics, others)]
    try:
        return _gathered(itertools.chain.from_iterable(read), place, others, topics)
    except (FormatError, UnknownNameError):
        raise
    except Exception as error:
        raise FormatError("path", str(place), f"cannot be read: {type(error).__name__}: {error}") from error


def _mcap(path: pathlib.Path, topics: Sequence[str], others: dict[str, str]) -> Iterator[FoundMessage]:
    from mcap.exceptions import EndOfFile
    from mcap.reader import NonSeekingReader
    from rosbags.typesys import Stores, get_typestore

    store = None
    # A file whose writer was killed gives its whole chunks
    with path.open("rb") as file, contextlib.suppress(EndOfFile):
        for schema, channel, message in NonSeekingReader(file).iter_messages(log_time_order=False):
            kind = schema.name.replace("/msg/", "/") if schema is not None else ""
            coded = channel.message_encoding
            if not _wanted(kind, channel.topic, topics) or coded not in ("json", "cdr"):
                others[channel.topic] = f"{kind or 'no schema'} in {coded or 'no encoding'}"
                continue
            if coded == "json":
                fields: Any = json.loads(message.data, object_hook=lambda found: SimpleNamespace(**found))
            else:
                store = store or get_typestore(Stores.ROS2_HUMBLE)
                fields = store.deserialize_cdr(message.data, kind.replace("/", "/msg/"))
            yield channel.topic, kind, message.log_time / NANO, fields


def _bag(path: pathlib.Path, topics: Sequence[str], others: dict[str, str]) -> Iterator[FoundMessage]:
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        kinds = {connection.id: connection.msgtype.replace("/msg/", "/") for connection in reader.connections}
        chosen = [one for one in reader.connections if _wanted(kinds[one.id], one.topic, topics)]
        others |= {one.topic: kinds[one.id] for one in reader.connections if one not in chosen}
        for connection, time, data in reader.messages(chosen) if chosen else ():
            fields = reader.deserialize(data, connection.msgtype)
            yield connection.topic, kinds[connection.id], time / NANO, fields


def _wanted(kind: str, topic: str, topics: Sequence[str]) -> bool:
    return kind in (*JOINTS, *TRANSFORMS, *SINGLE) and (not topics or topic in topics)


def _gathered(
    messages: Iterator[FoundMessage], path: pathlib.Path, others: dict[str, str], topics: Sequence[str]
) -> RecordedMotion:
    states: list[tuple[float, State]] = []
    poses: dict[str, tuple[str, list[tuple[float, list[float]]]]] = {}
    seen = set[str]()
    for topic, kind, time, fields in messages:
        seen.add(topic)
        if kind in JOINTS:
            if state := _state(fields, topic):
                states.append((_stamp(fields, time), state))
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
            moves.append((_stamp(placed, time), numbers))
    if missing := [topic for topic in topics if topic not in seen]:
        raise FormatError("topics", missing[0], "no messages of a type that is read", sorted(seen | others.keys()))
    if not states and not poses:
        said = "; ".join(f"{topic} ({kind})" for topic, kind in others.items()) or "no messages at all"
        raise FormatError("path", str(path), f"has neither joint states nor transforms, but {said}")
    begin = min(time for time, _ in [*states, *(move for _, moves in poses.values() for move in moves)])
    frames = {}
    for child, (parent, moves) in poses.items():
        t, rows = _by_time([time - begin for time, _ in moves], np.array([numbers for _, numbers in moves]))
        rows[:, 3:] /= np.linalg.norm(rows[:, 3:], axis=1, keepdims=True)
        frames[child] = Path6(parent, t, rows)
    remarks = tuple(f"not read: {topic} ({kind})" for topic, kind in sorted(others.items()))
    return RecordedMotion(*_rows(states, begin), frames, remarks)


def _state(fields: Any, topic: str) -> State:
    if isinstance(fields, SimpleNamespace):
        parts = [(x.name, getattr(x, "position", None), getattr(x, "velocity", None)) for x in fields.joints]
    else:
        columns = [
            fields.name,
            *([*numbers] or [None] * len(fields.name) for numbers in (fields.position, fields.velocity)),
        ]
        if len(sizes := {len(column) for column in columns}) > 1:
            raise FormatError(topic, sizes, f"numbers for {len(fields.name)} joints were due")
        parts = list(zip(*columns, strict=True))
    out: State = {}
    for name, position, velocity in parts:
        if position is None:
            continue
        if not isinstance(name, str):
            raise FormatError(topic, name, "is no name of a joint")
        if not np.isfinite([position, velocity or 0.0]).all():
            raise FormatError(topic, (position, velocity), f"the state of {name!r} is no finite number")
        if name in out:
            raise FormatError(topic, name, "has two states in one message")
        out[name] = float(position), None if velocity is None else float(velocity)
    return out


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


def _stamp(fields: Any, time: float) -> float:
    """The message's own time [s], that of its recording where it has none."""
    own = getattr(fields, "timestamp", None) if isinstance(fields, SimpleNamespace) else fields.header.stamp
    if own is None:
        return time
    seconds = float(own.sec + (own.nsec if hasattr(own, "nsec") else own.nanosec) / NANO)
    if not np.isfinite(seconds):
        raise FormatError("timestamp", seconds, "is no finite number")
    return seconds or time
