"""Runs in other formats, read by these formats' own readers and compared number by number."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from mcap.exceptions import EndOfFile
from mcap.reader import NonSeekingReader, make_reader

import wbc
from tests.cli.test_commands import FAST, run
from tests.formats.runs import recorded, ticks_and_reasons
from tests.refusals import assert_refused
from tests.repeats import repeats
from wbc.errors import RangeError, UnknownNameError
from wbc.extras import MissingPackageError
from wbc.formats import FORMATS, FormatError, convert, recorded as recording_of
from wbc.formats.messages import nested, of_ticks, schema_of
from wbc.log import LogFileError, TickRecorder, save
from wbc.multibody import pin


def messages(file: Path) -> dict[str, list[dict[str, Any]]]:
    """What the package mcap reads, by topic."""
    out: dict[str, list[dict[str, Any]]] = {}
    with file.open("rb") as stream:
        for schema, channel, message in make_reader(stream).iter_messages():
            assert schema is not None
            assert schema.encoding == "jsonschema"
            out.setdefault(channel.topic, []).append(json.loads(message.data) | {"log_time": message.log_time})
    return out


def columns_of(file: Path) -> list[str]:
    with file.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    channel = next(one for one in summary.channels.values() if one.topic == "/tick")
    return list(leaves(json.loads(channel.metadata["columns"])))


def leaves(value: Any) -> Iterator[Any]:
    for part in value.values() if isinstance(value, dict) else value if isinstance(value, list) else ():
        yield from leaves(part)
    if not isinstance(value, (dict, list)):
        yield np.nan if value is None else value


@pytest.mark.parametrize("seed", range(repeats(2)))
def test_mcap_has_every_number_of_every_tick(seed: int, tmp_path: Path) -> None:
    recording = recorded(tmp_path, seed)
    file, remarks = convert(recording, "mcap")
    assert remarks == []
    source, said = wbc.Recording(recording), messages(file)
    log, names = source.log(), columns_of(file)
    ticks, joints = said["/tick"], said["/joint_states"]
    assert len(ticks) == len(joints) == len(log)
    there = set(names)
    for k, (tick, state) in enumerate(zip(ticks, joints, strict=True)):
        assert tick.pop("log_time") == state["log_time"] == round(log["t"][k] * 1e9)
        assert tick.pop("status") == source.status[k]
        found = dict(zip(names, leaves(tick), strict=True))
        for joint in state["joints"]:
            for group, part in (("q", "position"), ("v", "velocity")):
                if part in joint and f"{group}.{joint['name']}" not in log:
                    # A joint without end: an angle here, its cosine and sine there
                    cosine, sine = (log[f"q.{joint['name']}.{j}"][k] for j in range(2))
                    assert joint[part] == np.arctan2(sine, cosine)
                elif part in joint:
                    found[f"{group}.{joint['name']}"] = joint[part]
                    there.add(f"{group}.{joint['name']}")
        assert {name: log[name][k] for name in log.columns} == found
    assert there == set(log.columns)


@pytest.mark.parametrize("seed", range(repeats(2)))
def test_what_is_seen_is_where_kinematics_has_it(seed: int, tmp_path: Path) -> None:
    recording = recorded(tmp_path, seed)
    said, source = messages(convert(recording, "mcap", rate=1000.0)[0]), wbc.Recording(recording)
    robot = wbc.robots.load(source.about["robot"])
    bodies = {entity["frame_id"]: entity for entity in said["/scene"][0]["entities"]}
    assert bodies.keys() >= robot.shapes.keys()
    assert all(len(body["triangles"][0]["points"]) >= 3 for body in bodies.values())
    times = (1e9 * source.time).round().astype(int).tolist()
    for moment in said["/tf"]:
        k = times.index(moment["log_time"])
        for one in moment["transforms"]:
            place = np.array([*one["translation"].values(), *one["rotation"].values()])
            if one["child_frame_id"] == "target/hand":
                found = source.inputs["hand.target"][k]
                assert np.allclose(place[:3], found[9:])
            elif one["child_frame_id"] == "obstacle/ball":
                assert np.allclose(place[:3], source.inputs["ball.pose"][k][9:])
            else:
                due = robot.pose(source["q"][k], one["child_frame_id"])
                assert np.allclose(pin.XYZQUATToSE3(place).homogeneous, due.homogeneous, atol=1e-12)
    assert said["/why"]
    assert all(line["message"].endswith(")") for line in said["/why"])


def test_tables_have_the_same_numbers(tmp_path: Path) -> None:
    recording = recorded(tmp_path, 0)
    log = wbc.Recording(recording).log()
    with convert(tmp_path, "csv")[0].open() as stream:
        head, *rows = csv.reader(stream)
    assert [name.split(" ")[0] for name in head] == list(log.columns)
    assert f"q.panda_joint1 [{log.units['q.panda_joint1']}]" in head
    assert np.array_equal(np.array(rows, dtype=float), np.column_stack(list(log.columns.values())))
    made = convert(recording, "npz")[0]
    assert made.name == "ticks.converted.npz"
    again = wbc.log.load(made)
    assert (again.units, again.meta["robot"]) == (log.units, "panda")
    assert all(np.array_equal(again[name], log[name]) for name in log.columns)


def test_a_dataset_of_lerobot_has_the_layout_of_its_version(tmp_path: Path) -> None:
    log = wbc.Recording(recorded(tmp_path, 0)).log()
    folder, _ = convert(tmp_path, "lerobot", tmp_path / "set")
    info = json.loads((folder / "meta/info.json").read_text())
    assert (info["codebase_version"], info["fps"], info["total_frames"]) == ("v3.0", round(1 / log["dt"][0]), len(log))
    data = pq.read_table(folder / info["data_path"].format(chunk_index=0, file_index=0))
    assert set(data.column_names) == set(info["features"])
    for name, group in (("observation.state", "q"), ("action", "v")):
        assert np.array_equal(np.array(data[name].to_pylist(), dtype=np.float32), log.array(group).astype(np.float32))
        assert info["features"][name]["names"] == list(log.group(group))
    assert np.allclose(data["timestamp"].to_numpy(), log["t"], atol=1e-6)
    stats = json.loads((folder / "meta/stats.json").read_text())
    assert np.allclose(stats["action"]["mean"], log.array("v").mean(0))
    # The text of a task is pandas' index, which pyarrow makes from what is said of all columns
    said = json.loads(pq.read_schema(folder / "meta/tasks.parquet").metadata[b"pandas"])
    assert said["index_columns"] == ["task"]
    assert {column["field_name"] for column in said["columns"]} == {"task_index", "task"}
    episode = pq.read_table(folder / "meta/episodes/chunk-000/file-000.parquet").to_pylist()[0]
    assert (episode["dataset_from_index"], episode["dataset_to_index"], episode["length"]) == (0, len(log), len(log))


@pytest.mark.parametrize("seed", range(repeats(4)))
def test_any_columns_are_one_tree(seed: int) -> None:
    """Names that are the beginnings of others among them."""
    rng = np.random.default_rng(seed)
    parts = ["a", "b", "c", "0", "1"]
    made = {".".join(rng.choice(parts, rng.integers(1, 5))): "m" for _ in range(40)}
    names = list(leaves(nested({name: np.array([name]) for name in made})[0]))
    assert sorted(names) == sorted(made)
    numbers = dict(zip(made, rng.normal(size=(len(made), 2)), strict=True))
    for k, tick in enumerate(nested(numbers)):
        assert list(leaves(tick)) == [numbers[name][k] for name in names]
        assert json.loads(json.dumps(schema_of(tick, "wbc.Tick")))["title"] == "wbc.Tick"


LOOP = """
import sys, time
sys.path.insert(0, {root!r})
import numpy as np, wbc
from wbc.formats import recorded
robot = wbc.robots.load("panda")
stack = wbc.Stack(robot, dt=0.01).add(wbc.tasks.Posture(), name="posture").add(wbc.tasks.JointLimits())
controller, q = stack.compile(backend="vm"), robot.neutral
with recorded(controller, {file!r}):
    for k in range(100_000):
        controller["posture"].target = robot.neutral * (1.0 - 0.1 * np.sin(k / 50))
        q = robot.integrate(q, controller.step(q).v, 0.01)
        time.sleep(0.002)
"""


def test_a_copy_is_read_while_it_is_written_and_after_a_kill(tmp_path: Path) -> None:
    file = tmp_path / "ticks.npz"
    code = LOOP.format(root=str(Path(__file__).parents[2]), file=str(file))
    loop = subprocess.Popen([sys.executable, "-c", code])
    copy, until = file.with_suffix(".mcap"), time.monotonic() + 300.0
    try:
        while (count := ticks_in(copy)) < 50 and time.monotonic() < until:
            time.sleep(0.1)
    finally:
        os.kill(loop.pid, signal.SIGKILL)
        loop.wait()
    assert count >= 50
    whole = len(wbc.Recording(file).rows())
    # Its process ends when it has read all
    while subprocess.run(["pgrep", "-f", str(copy)], capture_output=True, check=False).stdout:
        assert time.monotonic() < until
        time.sleep(0.1)
    assert ticks_in(copy, whole=True) == whole


def ticks_in(file: Path, whole: bool = False) -> int:
    """Ticks that a reader finds in a file that may end anywhere."""
    count = 0
    if not file.exists():
        return 0
    with file.open("rb") as stream:
        try:
            if whole:
                return sum(1 for _ in make_reader(stream).iter_messages(topics=["/tick"]))
            for _, channel, _ in NonSeekingReader(stream).iter_messages(log_time_order=False):
                count += channel.topic == "/tick"
        except EndOfFile:
            pass
    return count


def test_a_copy_is_followed_to_the_end(tmp_path: Path) -> None:
    robot = wbc.robots.load("panda")
    stack = wbc.Stack(robot, dt=0.01).add(wbc.tasks.Posture(), name="posture").add(wbc.tasks.JointLimits())
    controller = stack.compile(backend="vm")
    with recording_of(controller, tmp_path / "t.npz"):
        for _ in range(333):
            controller.step(robot.neutral)
    assert ticks_in(tmp_path / "t.mcap", whole=True) == 333
    again = recording_of(controller, tmp_path / "u.npz", overwrite=True)
    (tmp_path / "u.mcap").write_text("older")
    with again:
        controller.step(robot.neutral)
    assert ticks_in(tmp_path / "u.mcap", whole=True) == 1
    again = recording_of(controller, tmp_path / "v.npz")
    (tmp_path / "v.mcap").write_text("older")
    assert_refused(again.__enter__, FormatError, "there is such a file")


def test_logs_of_other_recorders_are_runs(tmp_path: Path) -> None:
    code, _, err = run("track", "panda", *FAST, "--out", tmp_path / "run", "--mcap", "--log", "npz")
    assert code == 0, err
    assert ticks_and_reasons(tmp_path / "run" / "ticks.mcap")[0] == len(wbc.log.load(tmp_path / "run"))
    (tmp_path / "run" / "ticks.npz").unlink()
    log, said = wbc.log.load(tmp_path / "run"), messages(convert(tmp_path / "run", "mcap", tmp_path / "x.mcap")[0])
    assert len(said["/tick"]) == len(log)
    first = {joint["name"]: joint["position"] for joint in said["/joint_states"][0]["joints"]}
    assert first == {name: values[0] for name, values in log.group("q").items()}
    assert {one["child_frame_id"] for one in said["/tf"][0]["transforms"]} > {"panda_link7"}
    recorder = TickRecorder({"t": ("s", "f8"), "x.a": ("m", "f8")}, {"robot": "none of the table"})
    recorder.extend(np.array([[0.0, np.inf], [0.1, 2.0]]))
    file, remarks = convert(save(recorder.log(), tmp_path / "other", "npz"), "mcap")
    assert len(remarks) == 1
    assert "none of the table" in remarks[0]
    assert [tick["x"]["a"] for tick in messages(file)["/tick"]] == [None, 2.0]
    # A connection writes JSON by itself
    said = [data for _, _, data in of_ticks(recorder.log())]
    assert [tick["x"]["a"] for tick in json.loads(json.dumps(said, allow_nan=False))] == [None, 2.0]


@pytest.mark.parametrize("to", ["mcap", "csv", "npz"])
def test_a_run_without_ticks_is_converted(to: str, tmp_path: Path) -> None:
    recorder = TickRecorder({"t": ("s", "f8"), "q.a": ("rad", "f8")}, {"robot": "none of the table"})
    assert convert(save(recorder.log(), tmp_path, "npz"), to)[0].is_file()


@pytest.mark.parametrize("name", ["kinova", "solo8"])
def test_a_log_without_a_stack_shows_the_robot_where_it_is(name: str, tmp_path: Path) -> None:
    """Columns of any names are its configuration, where there are as many as it has coordinates."""
    robot = wbc.robots.load(name)
    columns = {"t": ("s", "f8"), **{f"q.{k}": ("m, rad", "f8") for k in range(robot.nq)}}
    recorder, rows = TickRecorder(columns, {"robot": name}), [robot.random(k) for k in range(3)]
    recorder.extend(np.column_stack([np.arange(3.0), rows]))
    said = messages(convert(save(recorder.log(), tmp_path, "npz"), "mcap")[0])
    for q, moment in zip(rows, said["/tf"], strict=True):
        for one in moment["transforms"]:
            place = np.array([*one["translation"].values(), *one["rotation"].values()])
            due = robot.pose(q, one["child_frame_id"])
            assert np.allclose(pin.XYZQUATToSE3(place).homogeneous, due.homogeneous, atol=1e-12)


def test_what_cannot_be_converted_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    recording = recorded(tmp_path, 0, ticks=3)
    assert_refused(lambda: convert(recording, "mcp"), UnknownNameError, "mcap")
    assert_refused(lambda: convert(recording, "mcap", rate=0.0), RangeError, "rate")
    assert_refused(lambda: convert(tmp_path / "tick.npz", "mcap"), FormatError, "ticks.npz")
    (tmp_path / "junk.npz").write_bytes(b"junk")
    assert_refused(lambda: convert(tmp_path / "junk.npz", "mcap"), LogFileError, "junk.npz")
    convert(recording, "csv")
    before = sorted(tmp_path.iterdir())
    assert_refused(lambda: convert(recording, "csv"), FormatError, "there is such a file")
    assert_refused(lambda: convert(recording, "csv", tmp_path / "no" / "x.csv"), FormatError, "cannot be written")
    single = recorded(tmp_path / "one", 0, ticks=1)
    assert_refused(lambda: convert(single, "lerobot"), FormatError, "two ticks")
    assert sorted(single.parent.iterdir()) == [single]
    monkeypatch.setitem(sys.modules, "mcap", None)
    assert_refused(lambda: convert(recording, "mcap"), MissingPackageError, "wbc[formats]")
    assert sorted(path for path in tmp_path.iterdir() if path.name != "one") == before


def test_the_command_converts(tmp_path: Path) -> None:
    recorded(tmp_path, 0, ticks=5)
    code, out, err = run("convert", tmp_path, "--to", "csv", "--out", tmp_path / "x.csv")
    assert (code, err) == (0, "")
    assert out.strip() == str(tmp_path / "x.csv")
    assert len((tmp_path / "x.csv").read_text().splitlines()) == 6
    code, _, err = run("convert", tmp_path, "--to", "csv", "--out", tmp_path / "x.csv")
    assert code == 2
    assert "there is such a file" in err
    assert set(FORMATS) == {"mcap", "rrd", "csv", "npz", "lerobot", "foxglove"}
