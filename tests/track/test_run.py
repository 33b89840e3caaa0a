"""A run: what the log holds, its two formats, its clearances and its summary."""

from __future__ import annotations

import functools
import json
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.models import placement
from wbc import track
from wbc.errors import MissingShapeError, UnknownNameError, WbcError
from wbc.log import LogFileError
from wbc.shapes import PlacedShape
from wbc.track.clearance import clearances, self_clearances
from wbc.track.demo import demo as demo_plan
from wbc.track.setup import ElbowSwing, MovingObstacle
from wbc.track.summary import save_summary, summarise


@functools.cache
def demo() -> track.Log:
    """The demo, faster than it is made for, so that every kind of column is there."""
    return track.track(demo_plan(duration=6.0, rate=50.0, backend="vm"))


def test_columns_have_units_and_equal_lengths() -> None:
    log = demo()
    assert set(log.columns) == set(log.units)
    assert {len(values) for values in log.columns.values()} == {300}
    assert log.units["q.panda_joint1"] == "rad"
    assert log.units["a.panda_joint1"] == "rad/s^2"
    assert log.units["error.hand.x"] == "m"
    assert log.meta["versions"]["wbc"] == wbc.__version__
    assert not log.meta["interrupted"]
    with pytest.raises(UnknownNameError, match="did you mean 'tick'"):
        log["tik"]


def test_log_is_what_was_commanded() -> None:
    log, robot = demo(), wbc.robots.load("panda")
    q, v = log.array("q"), log.array("v")
    for k in range(len(log) - 1):
        np.testing.assert_allclose(q[k + 1], pin.integrate(robot.model, q[k], v[k] * 0.02), atol=1e-12)
    np.testing.assert_allclose(log.array("a")[1:], np.diff(v, axis=0) / 0.02, atol=1e-12)
    reached = pin.SE3ToXYZQUAT(placement(robot, "panda_hand_tcp", q[100]))
    np.testing.assert_allclose(log.array("pose")[100], reached, atol=1e-12)
    error = log.array("pose")[:, :3] - log.array("target")[:, :3]
    np.testing.assert_allclose(error, np.column_stack([log[f"error.hand.{axis}"] for axis in "xyz"]), atol=1e-9)


def test_the_demo_does_what_it_says() -> None:
    log = demo()
    obstacles = {name.split("/")[0] for name in log.group("binding")} & {"ball", "lamp"}
    assert obstacles == {"lamp"}
    assert min(gap.min() for gap in log.group("clearance").values()) > log.meta["margin"] - 1e-3
    assert np.ptp(log["plane.command"]) > 0.9
    assert (log["status"] == 0).all()


def test_coal_agrees_with_the_margins() -> None:
    log = demo()
    for link, gap in log.group("clearance").items():
        rows = [log[f"margin.{item}.{link}[0]"] for item in ("ball", "lamp")]
        np.testing.assert_allclose(gap, np.min(rows, axis=0) + log.meta["margin"], atol=1e-6)
    least = log.meta["mesh_clearance"]
    assert least["least"] >= min(gap.min() for gap in log.group("clearance").values()) - 1e-6


def test_clearance_of_a_moving_obstacle() -> None:
    robot = wbc.robots.load("panda")
    ball = MovingObstacle(
        wbc.shapes.Sphere(0.1), pin.SE3(np.eye(3), np.array([3.0, 0.0, 0.5])), np.array([-0.5, 0.0, 0.0])
    )
    q = np.vstack([robot.neutral, robot.neutral])
    gaps = clearances(robot, q, {"ball": ball}, np.array([0.0, 1.0]))
    for values in gaps.values():
        assert 0.3 < values[0] - values[1] <= 0.5 + 1e-9


def test_clearance_of_links() -> None:
    """Two balls on a planar arm that folds by an angle: their distance follows from the triangle of its links."""
    robot = wbc.robots.from_dh([wbc.robots.DHRow(a=0.5)] * 3)
    ball = [PlacedShape(wbc.shapes.Sphere(0.1), pin.SE3.Identity())]
    robot = robot.with_shapes({"link1": ball, "link3": ball})
    angles = np.array([0.0, 1.0, 2.0, np.pi - 0.1])
    q = np.column_stack([0.3 * angles, angles / 2, angles / 2])
    (gap,) = self_clearances(robot, q, [("link1", "link3")]).values()
    ends = np.exp(1j * np.cumsum(q, axis=1)) * 0.5
    np.testing.assert_allclose(gap, np.abs(ends[:, 1] + ends[:, 2]) - 0.2, atol=1e-6)
    with pytest.raises(UnknownNameError, match="did you mean 'link3'"):
        self_clearances(robot, q, [("link1", "link33")])
    with pytest.raises(MissingShapeError, match="link2"):
        self_clearances(robot, q, [("link1", "link2")])


@pytest.mark.parametrize("kind", ["parquet", "npz"])
def test_a_log_comes_back_as_it_was(kind: str, tmp_path: Path) -> None:
    log = demo()
    file = track.save(log, tmp_path, kind)
    for back in (track.load(file), track.load(str(tmp_path))):
        assert list(back.columns) == list(log.columns)
        for name, values in log.columns.items():
            np.testing.assert_array_equal(back[name], values)
            assert back[name].dtype == values.dtype
        assert back.units == log.units
        assert back.meta == json.loads(json.dumps(log.meta))
        assert [f.text for f in summarise(back)] == [f.text for f in summarise(log)]
    assert sorted(p.name for p in tmp_path.iterdir()) == [f"log.{kind}"]


def test_logs_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(LogFileError, match="has no log"):
        track.load(tmp_path)
    with pytest.raises(LogFileError, match="no such file"):
        track.load(tmp_path / "none")
    for name in ("log.parquet", "log.npz"):
        (tmp_path / name).write_text("nonsense")
        with pytest.raises(LogFileError, match="no log of this package") as refused:
            track.load(tmp_path / name)
        assert "unsafe" not in refused.value.reason
    with pytest.raises(UnknownNameError, match="did you mean 'parquet'"):
        track.save(demo(), tmp_path, "parqet")


def test_summary_figures_are_those_of_the_log(tmp_path: Path) -> None:
    log = demo()
    figures = summarise(log)
    values = {f.key: f.value for f in figures}
    error = np.linalg.norm(log.array("pose")[:, :3] - log.array("target")[:, :3], axis=1)
    assert values["position_error"]["max"] == pytest.approx(error.max())
    assert values["position_error"]["rms"] == pytest.approx(np.sqrt(np.mean(error**2)))
    assert values["status"] == {"solved": 300, "relaxed": 0, "braked": 0, "capped": 0, "recovered": 0}
    assert values["tick"]["median"] == pytest.approx(np.median(log["tick"]))
    assert 0.0 < values["acceleration"]["share"] <= 1.0 + 1e-6
    turns = [
        np.linalg.norm(pin.log3(_rotation(a).T @ _rotation(b)))
        for a, b in zip(log.array("pose"), log.array("target"), strict=True)
    ]
    assert values["rotation_error"]["max"] == pytest.approx(max(turns), rel=1e-6)
    assert json.loads(save_summary(figures, tmp_path).read_text())["status"]["solved"] == 300


def _rotation(row: np.ndarray) -> np.ndarray:
    return np.asarray(pin.Quaternion(row[3:]).matrix())


def test_swing_rate_is_its_derivative() -> None:
    swing, h = ElbowSwing(0.7, 3.0), 1e-6
    assert swing.at(0.0, 8.0) == (0.0, 0.0)
    assert swing.at(8.0, 8.0)[0] == pytest.approx(0.0, abs=1e-12)
    for t in np.linspace(0.1, 7.9, 23):
        slope = (swing.at(t + h, 8.0)[0] - swing.at(t - h, 8.0)[0]) / (2 * h)
        assert swing.at(t, 8.0)[1] == pytest.approx(slope, abs=1e-7)


def test_stopping_leaves_the_ticks_that_were_done() -> None:
    done: list[int] = []
    plan = demo_plan(duration=6.0, rate=50.0, backend="vm")
    log = track.track(plan, progress=done.append, stop=lambda: len(done) == 7)
    assert len(log) == 7
    assert log.meta["interrupted"]
    assert log.meta["planned"] == 300
    np.testing.assert_array_equal(log["q.panda_joint1"], demo()["q.panda_joint1"][:7])
    empty = track.track(plan, stop=lambda: True)
    assert len(empty) == 0
    assert summarise(empty)[0].text.startswith("interrupted, 0 of 300")


def test_a_robot_without_an_elbow_plane_is_told() -> None:
    robot = wbc.robots.load("double_pendulum")
    path = track.preset("circle", pin.SE3.Identity(), 1.0).path
    plan = track.PathRun(robot, robot.frame_names[-1], path, "circle", robot.neutral, plane=ElbowSwing())
    with pytest.raises(WbcError, match="knows no shoulder, elbow and wrist"):
        plan.stack()
