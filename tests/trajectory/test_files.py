"""Laws that were saved and loaded are the same, bit for bit; other files are refused."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from pathlib import Path as FilePath
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from tests.trajectory.random_laws import ragged, smooth
from wbc import trajectory
from wbc.errors import LawFileError
from wbc.trajectory import Law, MotionLimits, Path, Timing
from wbc.trajectory.laws import files


def poses() -> list[np.ndarray]:
    random = np.random.default_rng(0)
    return [pin.SE3(pin.exp3(random.normal(size=3)), random.normal(size=3)).homogeneous for _ in range(5)]


def along(path: Path) -> Law:
    """At a speed of 1."""
    length = path.length
    return Law(path, Timing([0.0, length], [[1.0], [path.knots[0]]]), MotionLimits(velocity=np.full(path.dof, 2.0)))


def joined() -> Law:
    law = smooth(1)
    parts = [law.sliced(a * law.duration, b * law.duration) for a, b in ((0.0, 0.3), (0.3, 0.6), (0.6, 1.0))]
    return parts[0].then(parts[1].then(parts[2]))


BOUNDS: dict[str, Any] = {"speed": 1.0, "acceleration": 2.0, "angular_acceleration": 3.0, "deviation": 0.05}

LAWS: dict[str, Callable[[], Law]] = {
    "spline": lambda: smooth(0),
    "ragged": lambda: ragged(0, 5, 3),
    "scaled and reversed": lambda: smooth(2).scaled(1.7).reversed(),
    "joined": joined,
    "via points": lambda: trajectory.via_points(poses(), **BOUNDS),
    "via points there and back": lambda: (law := trajectory.via_points(poses(), **BOUNDS)).then(law.reversed()),
    "standing": lambda: along(trajectory.standing_path([1.0, 2.0])),
    "function": lambda: along(trajectory.function_path(lambda x: [np.sin(x), x], 0.0, 2.0)),
    "blends": lambda: along(trajectory.blend_path([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]], 0.1)),
    "geodesic": lambda: along(trajectory.geodesic_path(*poses()[:2])),
    "pose polyline": lambda: along(trajectory.pose_polyline(poses(), 0.05)),
    "pose spline": lambda: along(
        trajectory.pose_spline([pin.SE3(pin.exp3(0.3 * k * np.ones(3)), np.full(3, k**2)) for k in range(4)])
    ),
    "arc": lambda: along(trajectory.arc_path(np.eye(4), [1.0, 0.0, 0.0], [0.0, 0.0, 2.0])),
    "no limits": lambda: Law(smooth(0).path, smooth(0).timing, moving=(True, False)),
}


def assert_same(ours: Law, theirs: Law) -> None:
    assert type(ours.path) is type(theirs.path)
    assert ours.moving == theirs.moving
    for field in fields(MotionLimits):
        assert np.array_equal(getattr(ours.limits, field.name), getattr(theirs.limits, field.name))
    assert np.array_equal(ours.timing.times, theirs.timing.times)
    assert np.array_equal(ours.path.knots, theirs.path.knots)
    times = np.linspace(-0.1, theirs.duration + 0.1, 997)
    for name, value in theirs.at(times)._asdict().items():
        assert getattr(ours.at(times), name).tobytes() == value.tobytes()
    assert ours.jerk(times).tobytes() == theirs.jerk(times).tobytes()
    assert ours.certificate == theirs.certificate


@pytest.mark.parametrize("name", LAWS)
def test_laws_come_back_bit_for_bit(name: str, tmp_path: FilePath) -> None:
    law = LAWS[name]()
    file = tmp_path / "a law"
    law.save(file)
    assert [p.name for p in tmp_path.iterdir()] == ["a law"]
    back = trajectory.load(file)
    assert_same(back, law)
    back.save(str(tmp_path / "again"))
    assert (tmp_path / "again").read_bytes() == file.read_bytes()


def test_every_kind_of_path_is_saved_by_a_test(tmp_path: FilePath) -> None:
    words: set[str] = set()
    for name, make in LAWS.items():
        make().save(tmp_path / name)
        with np.load(tmp_path / name) as archive:
            words |= {str(archive[key]) for key in archive.files if key.endswith("kind")}
    assert words == set(files.KINDS)


def test_a_file_that_is_there_is_replaced(tmp_path: FilePath) -> None:
    file = tmp_path / "law.npz"
    smooth(0).save(file)
    smooth(1).save(file)
    assert_same(trajectory.load(file), smooth(1))


class Straight(Path):
    """A path of one's own."""

    knots, dof = np.array([0.0, 1.0]), 1

    def evaluate(self, s: Any, order: int = 0, piece: Any = None) -> Any:
        return np.asarray(s)[:, None] if order == 0 else np.full((len(s), 1), float(order == 1))


def test_a_path_of_an_unknown_kind_is_not_saved(tmp_path: FilePath) -> None:
    law = Law(Straight(), Timing.identity(1.0))
    with pytest.raises(LawFileError, match="Straight") as caught:
        law.save(tmp_path / "law.npz")
    assert "polynomial" in caught.value.choices
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_is_not_there(tmp_path: FilePath) -> None:
    with pytest.raises(LawFileError, match="cannot be written"):
        smooth(0).save(tmp_path / "nowhere" / "law.npz")
    with pytest.raises(LawFileError, match="cannot be read"):
        trajectory.load(tmp_path / "law.npz")
    with pytest.raises(LawFileError, match="cannot be read"):
        trajectory.load(tmp_path)


def test_other_files(tmp_path: FilePath) -> None:
    file = tmp_path / "law.npz"
    for content in (b"", b"PK", b"a law\n" * 100):
        file.write_bytes(content)
        with pytest.raises(LawFileError, match="not a saved law"):
            trajectory.load(file)
    with file.open("wb") as stream:
        np.save(stream, np.zeros(3))
    with pytest.raises(LawFileError, match="not a saved law"):
        trajectory.load(file)
    np.savez(file, a=np.zeros(3))
    with pytest.raises(LawFileError, match="no law"):
        trajectory.load(file)
    np.savez(file, a=np.array([object()], dtype=object))
    with pytest.raises(LawFileError, match="not a saved law"):
        trajectory.load(file)


def test_damaged_bytes_are_found(tmp_path: FilePath) -> None:
    file = tmp_path / "law.npz"
    law = smooth(0)
    law.save(file)
    whole = file.read_bytes()
    for size in range(0, len(whole), 97):
        file.write_bytes(whole[:size])
        with pytest.raises(LawFileError):
            trajectory.load(file)
    for place in range(0, len(whole), 31):
        file.write_bytes(whole[:place] + bytes([whole[place] ^ 0x55]) + whole[place + 1 :])
        try:
            back = trajectory.load(file)
        except LawFileError:
            continue
        # What zip files do not guard (dates, attributes) is not of the law
        assert_same(back, law)


@pytest.mark.parametrize(
    ("key", "value", "match"),
    [
        ("format", np.array(2), "format 2"),
        ("format", np.array([1, 1]), "format"),
        ("path.kind", np.array("polygon"), "polygon"),
        ("path.kind", np.array("turns"), "damaged"),
        ("path.knots", None, "knots"),
        ("timing.times", None, "timing.times"),
        ("moving", None, "moving"),
        ("moving", np.array([True]), "damaged"),
        ("path.knots", np.array([0.0, 0.0, 1.0, 2.0, 3.0]), "increase"),
        ("path.coefficients", np.full((4, 4, 3), np.nan), "finite"),
        ("path.coefficients", np.array("none"), "damaged"),
        ("limits.velocity", np.ones(2), "limits"),
        ("limits.velocity", -np.ones(3), "positive"),
        ("timing.coefficients", np.full((3, 6), 99.0), "within the path"),
    ],
)
def test_damaged_contents(key: str, value: np.ndarray | None, match: str, tmp_path: FilePath) -> None:
    file = tmp_path / "law.npz"
    smooth(0).save(file)
    with np.load(file) as archive:
        arrays = dict(archive)
    assert key in arrays
    if value is None:
        del arrays[key]
    else:
        arrays[key] = value
    np.savez(file, **arrays)
    with pytest.raises(LawFileError, match=match):
        trajectory.load(file)
