"""C3D files, written by ezc3d."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.retarget import clips
from wbc.errors import ClipFileError
from wbc.extras import MissingPackageError
from wbc.retarget import load_clip
from wbc.retarget.sources.c3d import read_c3d

#: Markers of Plug-in Gait, and the joints whose places they take here
MARKERS = {
    "LFHD": "Head", "LASI": "LeftUpLeg", "RASI": "RightUpLeg", "LKNE": "LeftLeg", "RKNE": "RightLeg",
    "LANK": "LeftFoot", "RANK": "RightFoot", "LTOE": "LeftToe", "RTOE": "RightToe", "LFIN": "LeftHand",
    "RFIN": "RightHand", "C7": "Neck",
}  # fmt: skip
WALK = clips.walk(2, rate=100.0).clip
POINTS = WALK.points[:, [WALK.skeleton.names.index(joint) for joint in MARKERS.values()]]


def write(file: Path, points: np.ndarray, unit: str = "mm", rate: float = 100.0) -> None:
    import ezc3d

    made = ezc3d.c3d()
    made["parameters"]["POINT"]["RATE"]["value"] = [rate]
    made["parameters"]["POINT"]["LABELS"]["value"] = list(MARKERS)
    made["parameters"]["POINT"]["UNITS"]["value"] = [unit]
    whole = np.ones((4, points.shape[1], len(points)))
    whole[:3] = np.moveaxis(points, 2, 0).swapaxes(1, 2)
    made["data"]["points"] = whole
    made.write(str(file))


@pytest.mark.parametrize("unit", ["mm", "m"])
def test_markers_come_back(tmp_path: Path, unit: str) -> None:
    file = tmp_path / "walk.c3d"
    write(file, POINTS * {"mm": 1000.0, "m": 1.0}[unit], unit)
    clip = load_clip(file)
    assert clip.skeleton.names == tuple(MARKERS)
    assert set(clip.skeleton.parents) == {-1}
    assert clip.rate == 100.0
    assert clip.turns is None
    np.testing.assert_allclose(clip.points, POINTS, atol=1e-6)


def test_lost_markers_are_filled(tmp_path: Path) -> None:
    points = POINTS * 1000.0
    points[100:120, 5] = np.nan
    file = tmp_path / "walk.c3d"
    write(file, points)
    clip = load_clip(file)
    assert not clip.seen[100:120, 5].any()
    assert clip.seen.sum() == clip.seen.size - 20
    assert np.linalg.norm(clip.points - POINTS, axis=2).max() < 0.05


def test_a_unit_that_is_not_the_files(tmp_path: Path) -> None:
    file = tmp_path / "walk.c3d"
    write(file, POINTS, "mm")
    clip = load_clip(file)
    np.testing.assert_allclose(clip.points, POINTS, atol=1e-6)


@pytest.mark.parametrize(("markers", "frames"), [(300, 3), (1, 65_535), (1, 66_000)])
def test_more_than_a_header_can_hold(tmp_path: Path, markers: int, frames: int) -> None:
    import ezc3d

    made = ezc3d.c3d()
    made["parameters"]["POINT"]["RATE"]["value"] = [100.0]
    made["parameters"]["POINT"]["LABELS"]["value"] = [f"m{k}" for k in range(markers)]
    made["data"]["points"] = np.random.default_rng(0).uniform(1.0, 2.0, (4, markers, frames))
    file = tmp_path / "long.c3d"
    made.write(str(file))
    recorded = read_c3d(file)
    assert recorded.names == [f"m{k}" for k in range(markers)]
    said = [note for note in recorded.notes if "frames, of which ezc3d reads" in note]
    assert bool(said) == (frames > len(recorded.points))


def test_without_the_package_and_cut_off(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "walk.c3d"
    write(file, POINTS * 1000.0)
    whole = file.read_bytes()
    for share in (0.01, 0.1, 0.5):
        file.write_bytes(whole[: int(share * len(whole))])
        try:
            clip = load_clip(file)
        except ClipFileError:
            continue
        assert "cut off" in " ".join(clip.notes)
    monkeypatch.setitem(__import__("sys").modules, "ezc3d", None)
    monkeypatch.setattr("importlib.util.find_spec", lambda _name: None)
    with pytest.raises(MissingPackageError, match=r"wbc\[clips\]"):
        load_clip(file)
