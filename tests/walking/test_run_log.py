"""The log of a walk: recorded, saved, loaded; what cannot be is refused by field and value."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.walking.honest import MACHINE, honest, structure
from wbc import log as logs
from wbc.errors import NotFiniteError, RangeError, RotationError, ShapeError, UnknownNameError, WbcError
from wbc.log import LogFileError
from wbc.walking.log.log import CLOSED, FILE, OPEN, WalkLog, WalkLogError
from wbc.walking.log.recorder import LogRecorder

JOINTS, ARMS, HANDS = ("a", "b"), ("left", "right"), ("left_hand", "right_hand")
POSE = np.array([1.0, 2.0, 3.0, 0.0, 0.0, 0.6, 0.8])


def recorder(**changes: Any) -> LogRecorder:
    settings: dict[str, Any] = {"dt": 0.01, "seed": 7, "robot": "two", "robot_digest": "0123", "capacity": 2}
    return LogRecorder(structure(4, 0.1), JOINTS, ARMS, HANDS, **{**settings, **changes})


def append(to: LogRecorder, k: int, **changes: Any) -> None:
    tick: dict[str, Any] = {
        "t": 0.01 * k,
        "pose": POSE,
        "q": [k, -k],
        "v": np.array([1.0, 2.0]),
        "twist": np.arange(6.0),
        "states": (CLOSED, OPEN),
        "holds": np.array([2, -1]),
    }
    to.append(**{**tick, **changes})


def test_ticks_are_kept_as_they_were_given() -> None:
    made = recorder()
    append(made, 0)
    append(made, 1, pose=pin.SE3(pin.XYZQUATToSE3(POSE)), command=[1, 2, 3, 4, 5, 6])
    append(made, 2, command=POSE, body_fixed=True, states=[OPEN, CLOSED], holds=[3, 0])
    append(made, 3)
    append(made, 4)
    assert len(made) == 5
    log = made.log()
    assert len(log) == 5
    np.testing.assert_array_equal(log.t, 0.01 * np.arange(5))
    np.testing.assert_allclose(log.pose_body_in_structure, np.tile(POSE, (5, 1)), atol=1e-15)
    np.testing.assert_array_equal(log.q, [[k, -k] for k in range(5)])
    np.testing.assert_array_equal(log.v, np.tile([1.0, 2.0], (5, 1)))
    np.testing.assert_array_equal(log.twist_body, np.tile(np.arange(6.0), (5, 1)))
    np.testing.assert_array_equal(log.hand_state, [[CLOSED, OPEN]] * 2 + [[OPEN, CLOSED]] + [[CLOSED, OPEN]] * 2)
    np.testing.assert_array_equal(log.hand_hold, [[2, -1]] * 2 + [[3, 0]] + [[2, -1]] * 2)
    np.testing.assert_array_equal(log.body_fixed, [False, False, True, False, False])
    np.testing.assert_array_equal(log.command_kind, [0, 1, 2, 0, 0])
    np.testing.assert_array_equal(log.command[1], [1, 2, 3, 4, 5, 6, 0])
    np.testing.assert_array_equal(log.command[2], POSE)
    assert not log.command[[0, 3, 4]].any()
    assert (log.joints, log.arms, log.hands) == (JOINTS, ARMS, HANDS)
    assert log.hold_id == ("under 1", "under 2", "under 3", "ahead")
    np.testing.assert_array_equal(log.hold_roll, [4] * 4)
    np.testing.assert_array_equal(log.hold_max_tilt, [0.1] * 4)
    for hold, pose in zip(structure().holds, log.hold_pose, strict=True):
        np.testing.assert_allclose(pin.XYZQUATToSE3(pose).homogeneous, hold.pose.homogeneous, atol=1e-15)
    assert log.dt == 0.01
    assert log.meta["seed"] == 7
    assert log.meta["structure_digest"] == structure(4, 0.1).digest
    assert log.meta["versions"]["wbc"] == wbc.__version__
    with pytest.raises(ValueError, match="read-only"):
        log.q[0, 0] = 1.0


def test_holds_vanish_and_come_back() -> None:
    made = recorder()
    for k in range(5):
        append(made, k)
    made.vanish(0.02, "under 2")
    with pytest.raises(UnknownNameError):
        made.vanish(0.03, "under 2")
    with pytest.raises(UnknownNameError):
        made.appear(0.03, "under 3")
    with pytest.raises(UnknownNameError):
        made.vanish(0.03, "under 9")
    made.appear(0.04, "under 2")
    log = made.log()
    np.testing.assert_array_equal(log.present(1, log.t), [True, True, False, False, True])
    np.testing.assert_array_equal(log.present([0, 1, -1], 0.03), [True, False, False])


def test_a_log_comes_back_from_its_file(tmp_path: Path) -> None:
    log, _ = honest()
    assert log.save(tmp_path) == tmp_path / FILE
    assert [path.name for path in tmp_path.iterdir()] == [FILE]
    for place in (tmp_path, tmp_path / FILE):
        again = WalkLog.load(place)
        for field in fields(WalkLog):
            np.testing.assert_array_equal(getattr(again, field.name), getattr(log, field.name))
            assert type(getattr(again, field.name)) is type(getattr(log, field.name))
    assert again.meta["robot_digest"] == MACHINE.data.digest
    columns = logs.load(tmp_path)
    np.testing.assert_array_equal(columns.array("q"), log.q)
    assert columns.units["q.arm1_joint1"] == "rad"
    with np.load(tmp_path / FILE, allow_pickle=False) as data:
        np.testing.assert_array_equal(data["v.arm2_joint3"], log.v[:, log.joints.index("arm2_joint3")])


BAD: list[tuple[str, Any, type[WbcError], str]] = [
    ("joints", "abc", ShapeError, "joints"),
    ("joints", ("a", "a"), ShapeError, "each name once"),
    ("arms", (), ShapeError, "arms"),
    ("hands", ("left_hand",), ShapeError, "one an arm"),
    ("t", np.zeros(1), ShapeError, "two ticks"),
    ("t", np.array([0.0, np.nan]), NotFiniteError, "WalkLog.t"),
    ("q", np.zeros((2, 3)), ShapeError, r"expected shape \(2, 2\)"),
    ("v", np.full((2, 2), np.inf), NotFiniteError, "WalkLog.v"),
    ("pose_body_in_structure", np.ones((2, 7)), RotationError, r"pose_body_in_structure\[0\]"),
    ("twist_body", np.zeros((2, 7)), ShapeError, "twist_body"),
    ("hand_state", [[0, 1], [2, 4]], RangeError, r"hand_state\[1, 1\].*within 0 to 3 \(got 4\)"),
    ("hand_state", [[0.0, 1.0], [2.0, 2.0]], ShapeError, "whole numbers"),
    ("hand_hold", [[0, -2], [0, 0]], RangeError, r"hand_hold\[0, 1\].*\(got -2\)"),
    ("hand_hold", [[0, 4], [0, 0]], RangeError, r"within -1 to 3 \(got 4\)"),
    ("body_fixed", [0, 2], RangeError, r"body_fixed\[1\]"),
    ("command", np.zeros((2, 6)), ShapeError, "command"),
    ("command_kind", [0, 3], RangeError, "command_kind"),
    ("hold_id", ("a", "b", "c", "c"), ShapeError, "hold_id"),
    ("hold_pose", np.zeros((4, 7)), RotationError, r"hold_pose\[0\]"),
    ("hold_roll", [0, 0, -1, 0], RangeError, r"hold_roll\[2\]"),
    ("hold_max_tilt", [0.0, 0.0, 0.0, -0.1], RangeError, r"hold_max_tilt\[3\].*\(got -0.1\)"),
    ("presence_hold", [0, 1, 2, 5], RangeError, r"presence_hold\[3\]"),
    ("presence_span", np.full((4, 2), np.nan), NotFiniteError, "presence_span"),
    ("meta", {}, ShapeError, "meta.robot"),
    ("meta", "text", ShapeError, "meta"),
]


@pytest.mark.parametrize(("name", "value", "error", "message"), BAD, ids=[f"{b[0]} {b[3]}" for b in BAD])
def test_a_field_that_cannot_be_is_refused_by_name(name: str, value: Any, error: type[WbcError], message: str) -> None:
    made = recorder()
    append(made, 0)
    append(made, 1)
    with pytest.raises(error, match=message):
        replace(made.log(), **{name: value})


@pytest.mark.parametrize(("name", "value"), [("dt", 0.0), ("dt", "0.01"), ("seed", True), ("versions", [1])])
def test_meta_has_its_types(name: str, value: Any) -> None:
    made = recorder()
    append(made, 0)
    append(made, 1)
    log = made.log()
    with pytest.raises(WbcError, match=f"meta.{name}"):
        replace(log, meta={**log.meta, name: value})
    with pytest.raises(ShapeError, match="plain data"):
        replace(log, meta={**log.meta, "more": object()})


def test_files_that_are_no_logs_are_refused(tmp_path: Path) -> None:
    log, _ = honest()
    with pytest.raises(WalkLogError, match=r"no run\.npz"):
        WalkLog.load(tmp_path)
    with pytest.raises(LogFileError, match="no such file"):
        WalkLog.load(tmp_path / "other.npz")
    (tmp_path / "text.npz").write_text("nothing")
    with pytest.raises(LogFileError, match="cannot be written"):
        log.save(tmp_path / "text.npz" / "run.npz")
    file = log.save(tmp_path)
    (tmp_path / "half.npz").write_bytes(file.read_bytes()[:2000])
    for name in ("text.npz", "half.npz"):
        with pytest.raises(LogFileError, match="no log of this package"):
            WalkLog.load(tmp_path / name)
    good = logs.load(file)
    meta = {key: value for key, value in good.meta.items() if key != "dt"}
    for change, message in (
        ({"meta": {**good.meta, "format": 1}}, "format 2"),
        ({"meta": {}}, "format 2"),
        ({"meta": meta}, "meta.dt"),
        ({"meta": {**good.meta, "arms": "abc"}}, "run.hand_state.a.*lacks"),
        ({"tables": {}}, "run.holds.*lacks"),
        ({"columns": {k: v for k, v in good.columns.items() if k != "hand_state.arm1"}}, "run.hand_state.arm1.*lacks"),
        ({"columns": {**good.columns, "q.arm1_joint1": good["q.arm1_joint1"][1:]}}, "WalkLog.q"),
        ({"columns": {**good.columns, "t": good["t"].astype(complex)}}, "WalkLog.t"),
        ({"tables": {**good.tables, "holds": good.tables["holds"][:, :5]}}, "WalkLog.holds"),
        ({"tables": {**good.tables, "presence": np.zeros(3)}}, "WalkLog.presence"),
    ):
        bad = logs.save(replace(good, **change), tmp_path, "npz", "bad")
        with pytest.raises(WbcError, match=message):
            WalkLog.load(bad)


def test_a_recorder_refuses_what_does_not_fit_and_keeps_what_it_has() -> None:
    made = recorder()
    append(made, 0)
    for changes in ({"q": [1.0]}, {"pose": POSE[:6]}, {"states": (1,)}, {"command": [1.0]}, {"twist": np.zeros(7)}):
        with pytest.raises(ShapeError, match="tick"):
            append(made, 1, **changes)
    assert len(made) == 1
    with pytest.raises(ShapeError, match="two ticks"):
        made.log()
    append(made, 1, q=[np.nan, 0.0])
    with pytest.raises(NotFiniteError, match=r"WalkLog\.q"):
        made.log()
    for name, value in (("dt", 0.0), ("capacity", 0), ("capacity", 1.5)):
        with pytest.raises(RangeError, match=name):
            recorder(**{name: value})
