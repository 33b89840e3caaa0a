"""Motions as files: what is read back is what was written."""

from __future__ import annotations

import csv
import json
import pickle
from pathlib import Path
from types import SimpleNamespace

import mujoco
import numpy as np
import pyarrow.parquet as pq
import pytest

import wbc.log
from tests.retarget.fake import humanoid, motion_of
from wbc import robots
from wbc.errors import ClipFileError, RangeError, ShapeError, UnknownNameError
from wbc.multibody import pin
from wbc.retarget.outputs import joint_columns, write_lerobot, write_motion
from wbc.simulation import mujoco_model

MOTION = motion_of(humanoid())


def test_npz(tmp_path: Path) -> None:
    with np.load(write_motion(MOTION, tmp_path / "walk.v2.npz")) as data:
        np.testing.assert_array_equal(data["q"], MOTION.q)
        np.testing.assert_array_equal(data["root_pos"], MOTION.q[:, :3])
        np.testing.assert_array_equal(data["root_rot"], MOTION.q[:, 3:7])
        np.testing.assert_array_equal(data["dof_pos"], MOTION.q[:, 7:])
        assert tuple(data["joint_names"]) == MOTION.robot.dof_names[6:]
        assert data["rate"] == 30.0
        np.testing.assert_array_equal(data["stance.left_leg"], MOTION.stance["left_leg"])


def test_csv_keeps_all_digits(tmp_path: Path) -> None:
    file = write_motion(MOTION, tmp_path / "walk", "csv")
    assert file.name == "walk.csv"
    with file.open(newline="") as stream:
        head, *rows = csv.reader(stream)
    assert head[:5] == ["time", "root.x", "root.y", "root.z", "root.qx"]
    assert head[8:] == list(MOTION.robot.dof_names[6:])
    np.testing.assert_array_equal(np.array(rows, dtype=float)[:, 1:], MOTION.q)


def test_gmr_and_plain_csv_in_a_learners_order(tmp_path: Path) -> None:
    joints = MOTION.robot.dof_names[:5:-1]
    with write_motion(MOTION, tmp_path / "walk", "gmr", joints=joints).open("rb") as stream:
        data = pickle.load(stream)
    assert set(data) >= {"fps", "root_pos", "root_rot", "dof_pos", "local_body_pos", "link_body_list"}
    assert data["fps"] == 30
    assert isinstance(data["fps"], int)
    np.testing.assert_array_equal(data["dof_pos"], MOTION.q[:, :6:-1])
    plain = np.loadtxt(write_motion(MOTION, tmp_path / "walk", "csv-plain", joints=joints), delimiter=",")
    np.testing.assert_allclose(plain, np.concatenate([MOTION.q[:, :7], MOTION.q[:, :6:-1]], axis=1), atol=1e-8)
    with pytest.raises(UnknownNameError, match="joints"):
        write_motion(MOTION, tmp_path / "walk", "gmr", joints=["no_such_joint"])


def test_keyframes_are_read_by_mujoco(tmp_path: Path) -> None:
    file = write_motion(MOTION, tmp_path / "keys", "keyframes")
    spec = mujoco.MjSpec.from_string(mujoco_spec_xml())
    with_keys = mujoco.MjSpec.from_file(str(file))
    for key in with_keys.keys:
        spec.add_key(name=key.name, time=key.time, qpos=key.qpos)
    model = spec.compile()
    assert model.nkey == len(MOTION.q)
    data = mujoco.MjData(model)
    robot = MOTION.robot
    for frame in (0, 11, 29):
        mujoco.mj_resetDataKeyframe(model, data, frame)
        mujoco.mj_kinematics(model, data)
        assert data.time == pytest.approx(MOTION.time[frame])
        pinocchio = robot.model.createData()
        pin.forwardKinematics(robot.model, pinocchio, MOTION.q[frame])
        for joint in range(1, robot.model.njoints):
            number = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, robot.model.names[joint])
            place = data.xpos[model.jnt_bodyid[number]]
            np.testing.assert_allclose(place, pinocchio.oMi[joint].translation, atol=1e-6)


def mujoco_spec_xml() -> str:
    from wbc.simulation import mujoco_spec

    spec = mujoco_spec(MOTION.robot, drawn=False)
    spec.compile()
    return str(spec.to_xml())


def test_keyframes_of_a_users_model(tmp_path: Path) -> None:
    model = mujoco_model(MOTION.robot, drawn=False)
    first = write_motion(MOTION, tmp_path / "a", "keyframes").read_text()
    assert write_motion(MOTION, tmp_path / "b", "keyframes", model=model).read_text() == first


def test_the_log_is_read_by_its_reader(tmp_path: Path) -> None:
    log = wbc.log.load(write_motion(MOTION, tmp_path / "log", "log"))
    np.testing.assert_array_equal(log.array("q"), MOTION.q)
    np.testing.assert_array_equal(log["stance.left_leg"], MOTION.stance["left_leg"])
    assert log.meta["rate"] == 30.0


def test_joints_of_all_kinds_become_angles() -> None:
    names, fixed = joint_columns(motion_of(robots.load("panda")))
    np.testing.assert_array_equal(fixed[:, :7], np.tile([0, 0, 0, 0, 0, 0, 1], (len(fixed), 1)))
    assert 7 + len(names) == fixed.shape[1]
    # Joints without end, which turn on beyond half a turn
    robot = robots.load("kinova", base="floating")
    motion = motion_of(robot)
    angles = 0.1 * np.arange(len(motion.q))[:, None] * np.arange(1, robot.nv - 5)
    motion.q = np.array(
        [pin.integrate(robot.model, pin.neutral(robot.model), np.append(np.zeros(6), a)) for a in angles]
    )
    names, columns = joint_columns(motion)
    assert robot.nq - 7 > robot.nv - 6 == len(names)
    np.testing.assert_allclose(columns[:, 7:], angles, atol=1e-9)


def test_bad_input_changes_nothing(tmp_path: Path) -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'npz'"):
        write_motion(MOTION, tmp_path / "a", "npy")
    (tmp_path / "file").write_text("")
    with pytest.raises(ClipFileError, match="cannot be written"):
        write_motion(MOTION, tmp_path / "file" / "a.npz")
    assert [file.name for file in tmp_path.iterdir()] == ["file"]


def test_lerobot_gets_an_episode_a_motion(tmp_path: Path) -> None:
    folder = write_lerobot([MOTION, MOTION], tmp_path / "set", ["walk", "dance"])
    count = len(MOTION.q)
    info = json.loads((folder / "meta/info.json").read_text())
    assert (info["fps"], info["total_episodes"], info["total_frames"], info["total_tasks"]) == (30, 2, 2 * count, 2)
    assert info["splits"] == {"train": "0:2"}
    for name in ("observation.state", "action"):
        assert info["features"][name]["names"][7:] == list(MOTION.robot.dof_names[6:])
        assert info["features"][name]["shape"] == [len(info["features"][name]["names"])]
    data = pq.read_table(folder / info["data_path"].format(chunk_index=0, file_index=0))
    assert set(data.column_names) == set(info["features"])
    state, action = (np.array(data[name].to_pylist()) for name in ("observation.state", "action"))
    assert str(data.schema.field("action").type) == f"fixed_size_list<element: float>[{state.shape[1]}]"
    for start in (0, count):
        np.testing.assert_allclose(state[start : start + count], MOTION.q, atol=1e-6)
        np.testing.assert_allclose(action[start : start + count - 1], MOTION.q[1:], atol=1e-6)
        np.testing.assert_allclose(action[start + count - 1], MOTION.q[-1], atol=1e-6)
    assert data["index"].to_pylist() == list(range(2 * count))
    assert data["frame_index"].to_pylist() == [*range(count), *range(count)]
    assert data["episode_index"].to_pylist() == data["task_index"].to_pylist() == [0] * count + [1] * count
    np.testing.assert_allclose(data["timestamp"].to_numpy()[count:], MOTION.time, atol=1e-6)
    episodes = pq.read_table(folder / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    assert [row["length"] for row in episodes] == [count, count]
    assert [(row["dataset_from_index"], row["dataset_to_index"]) for row in episodes] == [
        (0, count),
        (count, 2 * count),
    ]
    assert [row["tasks"] for row in episodes] == [["walk"], ["dance"]]
    np.testing.assert_allclose(episodes[1]["stats/action/mean"], action[count:].mean(axis=0), atol=1e-6)
    tasks = pq.read_table(folder / "meta/tasks.parquet").to_pylist()
    assert [row["task"] for row in tasks] == ["walk", "dance"]
    with pytest.raises(ClipFileError, match="is there already"):
        write_lerobot([MOTION], tmp_path / "set")


def test_lerobot_refuses_what_is_no_dataset(tmp_path: Path) -> None:
    other = SimpleNamespace(**{**vars(MOTION), "rate": 60.0})
    for motions, reason in (([], "a motion at least"), ([MOTION, other], "one robot and one rate")):
        with pytest.raises(RangeError, match=reason):
            write_lerobot(motions, tmp_path / "set")
    with pytest.raises(RangeError, match="whole number"):
        write_lerobot([SimpleNamespace(**{**vars(MOTION), "rate": 59.94})], tmp_path / "set")
    with pytest.raises(ShapeError, match="one a motion"):
        write_lerobot([MOTION], tmp_path / "set", ["walk", "run"])
    assert not (tmp_path / "set").exists()
