"""Recordings of other programs, written by these formats' own writers, are read as they were written."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.writer import CompressionType, Writer
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin, Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

import wbc
from tests.formats.runs import recorded
from tests.refusals import assert_refused
from tests.repeats import repeats
from wbc.errors import UnknownNameError
from wbc.formats import FormatError, PlayedPlant, RecordedMotion, convert, read_motion
from wbc.multibody import pin
from wbc.simulation import Connection

NANO = 1_000_000_000


def states(
    rng: np.random.Generator, joints: list[str], count: int
) -> list[tuple[int, list[str], np.ndarray, np.ndarray]]:
    """Joint states of two publishers, each of some joints, in random order: time [ns], names, positions, velocities."""
    cut = int(rng.integers(1, len(joints)))
    out = []
    for k in range(count):
        names = joints[:cut] if k % 2 else joints[cut:]
        names = [str(name) for name in rng.permutation(names)]
        out.append((10 * NANO + k * 1_000_003, names, rng.normal(size=len(names)), rng.normal(size=len(names))))
    return out


def held(written: list[Any], joints: list[str]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What is known after each message, from the first on after which all joints are."""
    last, rows, times, rates = {}, [], [], []
    for time, names, q, v in written:
        last |= {name: (a, b) for name, a, b in zip(names, q, v, strict=True)}
        if len(last) == len(joints):
            times.append(time)
            rows.append([last[name][0] for name in joints])
            rates.append([last[name][1] for name in joints])
    return (np.array(times) - written[0][0]) / NANO, np.array(rows), np.array(rates)


def write_ros(folder: Path, kind: str, written: list[Any], tf: dict[str, Any]) -> Path:
    """A bag by rosbags: ROS 1, or ROS 2 in one of its storages."""
    store = get_typestore(Stores.ROS1_NOETIC if kind == "ros1" else Stores.ROS2_HUMBLE)
    if kind == "ros1":
        store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage"))
    types = store.types
    path = folder / ("x.bag" if kind == "ros1" else kind)
    writer = Writer1(path) if kind == "ros1" else Writer2(path, version=9, storage_plugin=StoragePlugin[kind.upper()])
    more = {"seq": 0} if kind == "ros1" else {}

    def header(time: int, frame: str) -> Any:
        stamp = types["builtin_interfaces/msg/Time"](time // NANO, time % NANO)
        return types["std_msgs/msg/Header"](stamp=stamp, frame_id=frame, **more)

    def data(message: Any, name: str) -> bytes:
        return bytes((store.serialize_ros1 if kind == "ros1" else store.serialize_cdr)(message, name))

    with writer:
        channel = {
            topic: writer.add_connection(topic, name, typestore=store)
            for topic, name in (("/joint_states", "sensor_msgs/msg/JointState"), ("/tf", "tf2_msgs/msg/TFMessage"))
        }
        for time, names, q, v in written:
            message = types["sensor_msgs/msg/JointState"](header(time, ""), names, q, v, np.zeros(0))
            writer.write(channel["/joint_states"], time, data(message, "sensor_msgs/msg/JointState"))
        for child, (parent, times, poses) in tf.items():
            for time, pose in zip(times, poses, strict=True):
                move = types["geometry_msgs/msg/Vector3"](*pose[:3])
                turn = types["geometry_msgs/msg/Quaternion"](*pose[3:])
                one = types["geometry_msgs/msg/TransformStamped"](
                    header(time, parent), child, types["geometry_msgs/msg/Transform"](move, turn)
                )
                message = types["tf2_msgs/msg/TFMessage"]([one])
                writer.write(channel["/tf"], time, data(message, "tf2_msgs/msg/TFMessage"))
    return path if kind != "mcap" else next(path.glob("*.mcap")) if len(written) % 2 else path


@pytest.mark.parametrize("kind", ["ros1", "sqlite3", "mcap"])
@pytest.mark.parametrize("seed", range(repeats(3)))
def test_bags_are_read_as_they_were_written(kind: str, seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(seed)
    joints = [f"j{k}" for k in range(int(rng.integers(2, 9)))]
    written = states(rng, joints, int(rng.integers(4, 40)))
    times = [written[0][0] + 7_000_000 * k for k in range(5)]
    poses = [pin.SE3ToXYZQUAT(pin.SE3.Random()) for _ in range(10)]
    tf = {"a": ("map", times, poses[:5]), "b": ("a", times, poses[5:])}
    motion = read_motion(write_ros(tmp_path, kind, written, tf))
    t, q, v = held(written, joints)
    order = [motion.joints.index(name) for name in joints]
    assert np.allclose(motion.t, t, atol=1e-6)
    assert np.array_equal(motion.q[:, order], q)
    assert motion.v is not None
    assert np.array_equal(motion.v[:, order], v)
    for k in range(5):
        at = motion.frames["b"].t[k]
        due = pin.XYZQUATToSE3(poses[k]) * pin.XYZQUATToSE3(poses[5 + k])
        assert np.allclose(motion.pose("b", at).homogeneous, due.homogeneous)
        assert np.allclose(motion.pose("b", at, "a").homogeneous, pin.XYZQUATToSE3(poses[5 + k]).homogeneous)
    half = motion.pose("a", 0.0035)
    ends = [pin.XYZQUATToSE3(pose) for pose in poses[:2]]
    assert np.allclose(half.homogeneous, (ends[0] * pin.exp6(0.5 * pin.log6(ends[0].inverse() * ends[1]))).homogeneous)
    assert_refused(lambda: motion.pose("c", 0.0), UnknownNameError, "frame")
    assert_refused(lambda: motion.pose("a", 0.0, "b"), FormatError, "hang")


def foxglove(file: Path, topics: dict[str, tuple[str, list[dict[str, Any]]]], encoding: str = "json") -> Path:
    """An MCAP file of JSON messages, by the package mcap."""
    with file.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        for topic, (name, said) in topics.items():
            schema = writer.register_schema(name, "jsonschema", b"{}")
            channel = writer.register_channel(topic, encoding, schema)
            for k, message in enumerate(said):
                writer.add_message(channel, k * NANO, json.dumps(message).encode(), k * NANO)
        writer.finish()
    return file


def state(**positions: Any) -> dict[str, Any]:
    return {"joints": [{"name": name, "position": value} for name, value in positions.items()]}


def stated(time: float, **positions: Any) -> dict[str, Any]:
    return state(**positions) | {"timestamp": {"sec": int(time), "nsec": round(time % 1 * NANO)}}


PLACED = {"parent_frame_id": "m", "child_frame_id": "c", "translation": dict.fromkeys("xyz", 0.0)}
PLACED |= {"rotation": dict.fromkeys("xyz", 0.0) | {"w": 1.0}}


@pytest.mark.parametrize(
    ("times", "t", "remark"),
    [
        ([0, 1, 2], [0, 1, 2], ""),  # a simulation, whose first message says 0
        ([1, 2, 0], [0, 1, 2], "s: time goes back, by 2 s at most"),
        ([1, 1, 2], [0, 1], "several states at one time, of which the last is taken: a"),
        ([50, 51, 52], [50, 51, 52], "s begins 48 s after c c ends: are they of one clock?"),
    ],
)
def test_times_that_are_odd_are_said(times: list[float], t: list[float], remark: str, tmp_path: Path) -> None:
    joints = ("foxglove.JointStates", [stated(time, a=k) for k, time in enumerate(times)])
    other = {"c": ("foxglove.FrameTransform", [PLACED] * 3)} if remark.startswith("s begins") else {}
    motion = read_motion(foxglove(tmp_path / "x.mcap", {"s": joints, **other}))
    assert motion.t.tolist() == t
    assert [said[: len(remark)] for said in motion.remarks] == [remark] * bool(remark)


def test_a_message_that_is_none_is_named(tmp_path: Path) -> None:
    file = foxglove(tmp_path / "x.mcap", {"s": ("foxglove.JointStates", [state(a=0.0), {}])})
    assert_refused(lambda: read_motion(file), FormatError, "s: is no foxglove.JointStates")


def test_a_file_cut_anywhere_gives_its_whole_chunks(tmp_path: Path) -> None:
    """As a killed recorder leaves it: every cut is read, or refused as one without messages."""
    whole = foxglove(tmp_path / "x.mcap", {"s": ("foxglove.JointStates", [state(a=float(k)) for k in range(3)])})
    data, counts, reasons = whole.read_bytes(), list[int](), list[str]()
    for size in range(8, len(data)):
        whole.write_bytes(data[:size])
        try:
            counts.append(len(read_motion(whole).t))
        except FormatError as error:
            reasons.append(str(error))
            counts.append(0)
    assert counts == sorted(counts)
    assert counts[-1] == 3
    assert all("has neither" in reason for reason in reasons)


def test_what_is_no_motion_is_refused(tmp_path: Path) -> None:
    def read(**topics: Any) -> RecordedMotion:
        return read_motion(foxglove(tmp_path / "x.mcap", topics))

    good = ("foxglove.JointStates", [state(a=0.0), state(a=1.0)])
    motion = read(states=good, other=("foxglove.Log", [{}]))
    assert motion.remarks == ("not read: other (foxglove.Log in json)",)
    assert motion.at(0.25).tolist() == [0.25]
    assert_refused(lambda: read(other=("foxglove.Log", [{}])), FormatError, "other (foxglove.Log")
    assert_refused(lambda: read(states=("foxglove.JointStates", [state(a=float("nan"))])), FormatError, "finite")
    turned = {"parent_frame_id": "a", "child_frame_id": "b", "translation": dict.fromkeys("xyz", 0.0)}
    bad = turned | {"rotation": dict.fromkeys("xyzw", 0.0)}
    assert_refused(lambda: read(tf=("foxglove.FrameTransform", [bad])), FormatError, "unit quaternion")
    unit = turned | {"rotation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}}
    circle = read(
        tf=(
            "foxglove.FrameTransforms",
            [{"transforms": [unit, unit | {"parent_frame_id": "b", "child_frame_id": "a"}]}],
        )
    )
    assert_refused(lambda: circle.pose("a", 0.0), FormatError, "circle")
    assert_refused(lambda: read_motion(tmp_path / "x.mcap", ["/no"]), FormatError, "/no")
    assert_refused(lambda: read_motion(tmp_path / "no.mcap"), FormatError, "no such file")
    (tmp_path / "junk.mcap").write_bytes(b"junk" * 100)
    assert_refused(lambda: read_motion(tmp_path / "junk.mcap"), FormatError, "cannot be read")
    assert_refused(lambda: read_motion(foxglove(tmp_path / "x.mcap", {"s": good}, "cbor")), FormatError, "in cbor")
    robot = wbc.robots.load("ur5")
    assert_refused(lambda: motion.configurations(robot), UnknownNameError, "shoulder_pan_joint")
    assert motion.configurations(robot, ["a"]).tolist() == [robot.neutral.tolist()] * 2


MOVED = {"translation": dict.fromkeys("xyz", 0.0), "rotation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}}


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        ("{", "JSONDecodeError"),
        ("[]", "is no foxglove.JointStates"),
        ("{}", "no attribute 'joints'"),
        ('{"joints": []}', "neither joint states"),
        ('{"joints": [{"name": null, "position": 1}]}', "no name"),
        ('{"joints": [{"name": "a", "position": "far"}]}', "could not convert string"),
        ('{"joints": [{"name": "a", "position": 1}, {"name": "a", "position": 2}]}', "two states"),
        ('{"timestamp": {"sec": 1e400, "nsec": 0}, "joints": [{"name": "a", "position": 1}]}', "timestamp"),
        ([MOVED | {"parent_frame_id": name, "child_frame_id": "b"} for name in "ac"], "second parent of 'b'"),
    ],
)
def test_messages_of_strangers_are_refused_by_name(message: Any, reason: str, tmp_path: Path) -> None:
    kind = "foxglove.JointStates" if isinstance(message, str) else "foxglove.FrameTransforms"
    said = message if isinstance(message, str) else json.dumps({"transforms": message})
    file = written(tmp_path / "x.mcap", [(0, kind, said)])
    assert_refused(lambda: read_motion(file), FormatError, reason)


def written(file: Path, messages: list[tuple[int, str, str]], **how: Any) -> Path:
    """An MCAP file: time [s], type and text of each message."""
    with file.open("wb") as stream:
        writer = Writer(stream, **how)
        writer.start()
        channels: dict[str, int] = {}
        for time, kind, text in messages:
            if kind not in channels:
                channels[kind] = writer.register_channel("", "json", writer.register_schema(kind, "jsonschema", b""))
            writer.add_message(channels[kind], time * NANO, text.encode(), time * NANO)
        writer.finish()
    return file


@pytest.mark.parametrize("how", [{"compression": kind} for kind in CompressionType] + [{"use_chunking": False}])
def test_files_of_strangers_are_read_however_they_are_packed(how: Any, tmp_path: Path) -> None:
    """Topics without a name, and messages in no order, of which of those at one time the last counts."""
    times = [3, 1, 2, 0, 1]
    messages = [(t, "foxglove.JointStates", json.dumps(state(a=10.0 * k + t))) for k, t in enumerate(times)]
    motion = read_motion(written(tmp_path / "x.mcap", messages, **how))
    assert (motion.t.tolist(), motion.q[:, 0].tolist()) == ([0.0, 1.0, 2.0, 3.0], [30.0, 41.0, 22.0, 3.0])


def test_frames_that_stand_do_not_say_when_a_recording_began(tmp_path: Path) -> None:
    """Their stamps may be hours old; velocities of ros2_control are NaN where nobody measures them."""
    stands = MOVED | {"parent_frame_id": "map", "child_frame_id": "base", "timestamp": {"sec": 5, "nsec": 0}}
    joints = [state(a=0.5) | {"timestamp": {"sec": 9000 + k, "nsec": 0}} for k in range(3)]
    for said in joints:
        said["joints"][0]["velocity"] = float("nan")
    topics = {"tf": ("foxglove.FrameTransform", [stands]), "j": ("foxglove.JointStates", joints)}
    motion = read_motion(foxglove(tmp_path / "x.mcap", topics))
    assert (motion.t.tolist(), motion.v) == ([0.0, 1.0, 2.0], None)
    assert np.array_equal(motion.pose("base", 1.0).homogeneous, np.eye(4))


def test_a_bag_whose_recorder_was_killed_is_read_as_far_as_it_came(tmp_path: Path) -> None:
    """It has no metadata, and its file ends anywhere."""
    rng = np.random.default_rng(0)
    first = states(rng, ["a", "b"], 40)
    folder = tmp_path / "mcap"
    write_ros(tmp_path, "mcap", first, {})
    whole = read_motion(folder)
    (folder / "metadata.yaml").unlink()
    file = next(folder.glob("*.mcap"))
    data = file.read_bytes()
    assert np.array_equal(read_motion(folder).q, whole.q)
    for cut in rng.integers(0, len(data), 30):
        file.write_bytes(data[:cut])
        try:
            some = read_motion(folder)
        except FormatError:
            continue
        assert np.array_equal(some.q, whole.q[: len(some.q)])
    file.unlink()
    assert_refused(lambda: read_motion(folder), FormatError, "cannot be read")
    write_ros(tmp_path, "sqlite3", first, {})
    (tmp_path / "sqlite3" / "metadata.yaml").unlink()
    assert np.array_equal(read_motion(tmp_path / "sqlite3").q, whole.q)


def test_foxglove_s_own_files_are_read(tmp_path: Path) -> None:
    """In protobuf; positions that are zero are there, velocities that are not given are not."""
    import foxglove
    import mcap_protobuf  # noqa: F401
    from foxglove import messages
    from foxglove.channels import FrameTransformsChannel, JointStatesChannel

    context, path = foxglove.Context(), tmp_path / "x.mcap"
    with foxglove.open_mcap(path, context=context):
        joints, frames = JointStatesChannel("/j", context=context), FrameTransformsChannel("/tf", context=context)
        for k in range(3):
            one = [messages.JointState(name="a", position=float(k)), messages.JointState(name="b", position=0.0)]
            joints.log(messages.JointStates(joints=one), log_time=k * NANO)
            move, turn = messages.Vector3(x=k, y=0.0, z=0.0), messages.Quaternion(x=0.0, y=0.0, z=0.0, w=1.0)
            placed = {"parent_frame_id": "map", "child_frame_id": "c", "translation": move, "rotation": turn}
            stamp = messages.Timestamp(sec=k, nsec=0)
            transforms = [messages.FrameTransform(timestamp=stamp, **placed)]
            frames.log(messages.FrameTransforms(transforms=transforms), log_time=9 * NANO)
    motion = read_motion(path)
    assert (motion.joints, motion.t.tolist(), motion.v) == (("a", "b"), [0.0, 1.0, 2.0], None)
    assert motion.q.tolist() == [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]]
    assert motion.pose("c", 1.5).translation.tolist() == [1.5, 0.0, 0.0]


@pytest.mark.parametrize("seed", [0, 2])
def test_the_same_stack_would_have_done_the_same(seed: int, tmp_path: Path) -> None:
    """Joints with two numbers each among them; what another one would have done is another thing."""
    recording = wbc.Recording(recorded(tmp_path, seed))
    motion = read_motion(convert(recording.path, "mcap")[0])
    controller = wbc.replaying.ticks.compiled(recording, backend="vm")
    robot, targets = controller.stack.robot, recording.inputs["hand.target"]
    q = motion.configurations(robot)
    assert np.allclose(q, recording["q"])

    def answered(aimed: bool) -> np.ndarray:
        controller.reset(q[0])
        rows = []
        for state in PlayedPlant(robot, motion).states(controller.stack.dt):
            place = targets[len(rows) if aimed else 0]
            controller["hand"].target = pin.SE3(place[:9].reshape(3, 3, order="F"), place[9:])
            rows.append([state.time, *controller.step(state.q, state.v).v])
        return np.array(rows)

    times, commands = np.split(answered(True), [1], axis=1)
    assert np.allclose(times[:, 0], motion.t)
    # How it came to its first state nobody knows
    assert np.allclose(commands[1:], recording["v"][1:], atol=1e-6)
    assert np.abs(answered(False)[:, 1:] - recording["v"]).max() > 1e-3


def test_states_have_times_of_the_recording() -> None:
    """Joints that are known after frames are, as those of two publishers: time counts from the first message."""
    motion = RecordedMotion(("elbow_joint",), np.array([0.5, 0.8]), np.zeros((2, 1)), None, {})
    plant = PlayedPlant(wbc.robots.load("ur5"), motion)
    # Each time from the first state on
    for _ in range(2):
        assert np.allclose([state.time for state in plant.states(0.1)], [0.5, 0.6, 0.7, 0.8])


def test_a_played_plant_goes_its_own_way(tmp_path: Path) -> None:
    motion = read_motion(
        foxglove(tmp_path / "x.mcap", {"s": ("foxglove.JointStates", [state(elbow_joint=x) for x in (0.0, 1.0)])})
    )
    robot = wbc.robots.load("ur5")
    plant = PlayedPlant(robot, motion)
    connection, place = Connection(plant, robot, 0.25), list(robot.joint_names).index("elbow_joint")
    seen = [connection.reset(robot.neutral)]
    seen += [connection.drive(np.full(robot.nv, 0.1)) for _ in range(4)]
    assert np.allclose([one.q[place] for one in seen], [0.0, 0.25, 0.5, 0.75, 1.0])
    assert np.allclose([one.v[place] for one in seen], 1.0)
    plant.advance(0.25)
    assert not plant.read().valid
    short = RecordedMotion(("elbow_joint",), np.zeros(1), np.zeros((1, 1)), None, {})
    assert_refused(lambda: PlayedPlant(robot, short), FormatError, "two joint states")
