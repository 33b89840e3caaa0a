"""Pictures of laws: what is in them, and what can go wrong."""

from __future__ import annotations

from pathlib import Path as FilePath
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

from tests.published.via_walker import swing
from tests.trajectory.random_laws import smooth
from wbc import trajectory
from wbc.errors import LawFileError, ShapeError
from wbc.trajectory import Law, MotionLimits, PolynomialPath, Timing


def poses() -> Law:
    return trajectory.via_points(
        swing((13, 12), (17, 12)), speed=0.5, acceleration=1.0, deviation=0.02, angular_acceleration=0.1
    )


def gentle() -> Law:
    """From rest to rest in 2 s by a polynomial of degree 7, whose acceleration does not jump."""
    path = PolynomialPath([0.0, 1.0], [[[1.0, -2.0]], [[0.0, 0.0]]])
    powers = np.array([-20.0, 70.0, -84.0, 35.0, 0.0, 0.0, 0.0, 0.0]) / 2.0 ** np.arange(7, -1, -1)
    timing = Timing([0.0, 2.0], powers[:, None])
    return Law(path, timing, MotionLimits(velocity=np.full(2, 3.0), acceleration=[8.0, 4.0], jerk=np.full(2, 99.0)))


@pytest.fixture
def figures(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    """What would be written."""
    seen: list[Figure] = []
    monkeypatch.setattr(Figure, "savefig", lambda self, file: seen.append(self))
    return seen


def titles(figure: Figure) -> list[str]:
    return [axis.get_title(loc="left") for axis in figure.axes]


def dashed(axis: Any) -> list[float]:
    """Places of horizontal dashed lines."""
    return sorted(float(line.get_ydata()[0]) for line in axis.lines if line.get_linestyle() == "--")


def test_joints(figures: list[Figure]) -> None:
    law = gentle()
    trajectory.plot(law, "unused.png", names=["shoulder", "elbow"], title="Reach")
    (figure,) = figures
    assert titles(figure) == ["position", "velocity", "acceleration", "jerk"]
    assert [text.get_text() for text in figure.axes[0].get_legend().get_texts()] == ["shoulder", "elbow"]
    assert dashed(figure.axes[0]) == []
    assert dashed(figure.axes[1]) == [-3.0, 3.0]
    assert dashed(figure.axes[2]) == [-8.0, -4.0, 4.0, 8.0]
    assert figure.get_suptitle().startswith("Reach: 2 s, at most ")
    for order, axis in enumerate(figure.axes[:3]):
        curve = axis.lines[1]
        times = curve.get_xdata()
        assert times[0] == 0.0
        assert times[-1] == 2.0
        assert len(times) >= 1000
        values = (law.at(times).position, law.at(times).velocity, law.at(times).acceleration)[order][:, 1]
        assert np.abs(curve.get_ydata() - values).max() < 1e-12


def test_a_ring_marks_the_worst_place(figures: list[Figure]) -> None:
    law = gentle()
    trajectory.plot(law, "unused.png")
    for name, axis in zip(("velocity", "acceleration", "jerk"), figures[0].axes[1:], strict=True):
        worst = law.certificate.worst[name]
        (ring,) = [line for line in axis.lines if line.get_marker() == "o"]
        assert float(ring.get_xdata()[0]) == worst.time
        limit = float(getattr(law.limits, name)[worst.joint])
        assert abs(float(ring.get_ydata()[0])) / limit == pytest.approx(worst.ratio, rel=1e-3)
        assert f"joint {worst.joint}" in axis.get_title(loc="right")
        assert f"{100.0 * worst.ratio:.4g} %" in axis.get_title(loc="right")


def test_what_is_beyond_a_limit_is_red(figures: list[Figure]) -> None:
    law = gentle()
    trajectory.plot(law, "unused.png")
    trajectory.plot(law.with_limits(law.limits.scaled(0.1)), "unused.png")
    colours = [figure.axes[1]._right_title.get_color() for figure in figures]
    assert colours[0] != colours[1] == "#c0392b"


def test_jumps_are_drawn_upright_and_jerk_is_left_out(figures: list[Figure]) -> None:
    law = smooth(0)
    trajectory.plot(law, "unused.png")
    assert titles(figures[0]) == ["position", "velocity", "acceleration"]
    assert "accelerations jump" in figures[0].get_suptitle().replace("\n", " ")
    times = figures[0].axes[2].lines[0].get_xdata()
    assert (np.diff(times) >= 0.0).all()
    for time in law.timing.times[1:-1]:
        assert np.count_nonzero(times == time) >= 1
        assert np.count_nonzero(np.abs(times - time) < 1e-12) == 2


def test_position_limits_of_one_side(figures: list[Figure]) -> None:
    law = gentle().with_limits(MotionLimits(lower=[-np.inf, -2.1], upper=[1.05, np.inf]))
    trajectory.plot(law, "unused.png")
    assert dashed(figures[0].axes[0]) == [-2.1, 1.05]


def test_poses_have_two_columns(figures: list[Figure]) -> None:
    trajectory.plot(poses(), "unused.png")
    (figure,) = figures
    assert titles(figure) == [
        "position",
        "orientation",
        "linear velocity",
        "angular velocity",
        "linear acceleration",
        "angular acceleration",
    ]
    quaternions = np.array([line.get_ydata() for line in figure.axes[1].lines])
    assert np.abs(np.linalg.norm(quaternions, axis=0) - 1.0).max() < 1e-12
    assert np.abs(np.diff(quaternions, axis=1)).max() < 0.1
    assert dashed(figure.axes[5]) == [-0.1, 0.1]


def test_orientations_do_not_jump_over_half_a_turn(figures: list[Figure]) -> None:
    path = trajectory.arc_path(np.eye(4), [1.0, 0.0, 0.0], [0.0, 0.0, 3.0 * np.pi])
    trajectory.plot(Law(path, Timing([0.0, 1.0], [[path.length], [0.0]])), "unused.png")
    quaternions = np.array([line.get_ydata() for line in figures[0].axes[1].lines])
    assert np.abs(np.diff(quaternions, axis=1)).max() < 0.01


@pytest.mark.usefixtures("as_users_get_them")
def test_a_picture_as_users_get_it(tmp_path: FilePath) -> None:
    trajectory.plot(poses(), tmp_path / "law.png")
    with Image.open(tmp_path / "law.png") as picture:
        assert picture.width > 1000
        assert np.array(picture.convert("L"), dtype=float).std() > 10.0


@pytest.mark.parametrize(
    "law",
    [
        smooth(0),
        Law(trajectory.standing_path([1.0]), Timing.identity(1e-6)),
        Law(trajectory.standing_path(np.zeros(12)), Timing.identity(1.0)),
    ],
    ids=["smooth", "standing", "no limits"],
)
def test_files_are_written(law: Law, tmp_path: FilePath) -> None:
    trajectory.plot(law, tmp_path / "law.png")
    content = (tmp_path / "law.png").read_bytes()
    assert content.startswith(b"\x89PNG")
    assert len(content) > 5000


def test_bad_names_and_files(tmp_path: FilePath) -> None:
    law = gentle()
    with pytest.raises(ShapeError, match="names"):
        trajectory.plot(law, tmp_path / "law.png", names=["one"])
    for file in (tmp_path / "nowhere" / "law.png", tmp_path / "law.doc"):
        with pytest.raises(LawFileError, match="cannot be written"):
            trajectory.plot(law, file)
    assert list(tmp_path.iterdir()) == []
