"""BVH files: any order of channels, units and axes, and what is broken in them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.retarget import clips, motions
from wbc.errors import ClipFileError, RangeError, UnknownNameError
from wbc.retarget import Clip, load_clip

WALK = clips.walk(1, rate=30.0).clip


def read(folder: Path, text: str, **options: float | str) -> Clip:
    file = folder / "clip.bvh"
    file.write_text(text)
    return load_clip(file, **options)  # type: ignore[arg-type]  # options are of several types


@pytest.mark.parametrize("name", [*clips.MOTIONS, "dog"])
@pytest.mark.parametrize(("up", "unit", "order"), [("y", 0.01, "ZXY"), ("z", 1.0, "XYZ"), ("y", 0.001, "YZX")])
def test_clips_come_back_as_they_were_written(tmp_path: Path, name: str, up: str, unit: float, order: str) -> None:
    clip = (clips.dog(2, 20.0) if name == "dog" else clips.MOTIONS[name](2, 20.0)).clip
    read_back = read(tmp_path, clips.bvh(clip, up, unit, order))
    assert read_back.skeleton.parents == clip.skeleton.parents
    assert read_back.skeleton.ends == clip.skeleton.ends
    assert read_back.rate == 20.0
    np.testing.assert_allclose(read_back.points, clip.points, atol=1e-7)
    assert clip.turns is not None
    np.testing.assert_allclose(read_back.turns, clip.turns, atol=1e-7)  # type: ignore[arg-type]  # never None here
    np.testing.assert_allclose(read_back.skeleton.offsets[1:], clip.skeleton.offsets[1:], atol=1e-7)
    said = " ".join(read_back.notes)
    assert ("y is up" in said) == (up == "y")
    assert ("centimetres" in said, "millimetres" in said) == (unit == 0.01, unit == 0.001)


@pytest.mark.parametrize(("unit", "name"), [(0.0254, "inches"), (0.0254 / 0.45, "CMU")])
def test_units_that_are_not_metric_are_found(tmp_path: Path, unit: float, name: str) -> None:
    for motion in ("walk", "crawl"):
        clip = clips.MOTIONS[motion](3, 20.0).clip
        read_back = read(tmp_path, clips.bvh(clip, unit_of_length=unit))
        np.testing.assert_allclose(read_back.points, clip.points, atol=1e-6)
        assert name in " ".join(read_back.notes)


def test_positions_at_every_joint(tmp_path: Path) -> None:
    whole = read(tmp_path, clips.bvh(WALK, every=True))
    np.testing.assert_allclose(whole.points, WALK.points, atol=1e-7)


@pytest.mark.parametrize("up", ["y", "z"])
def test_a_skeleton_whose_names_say_nothing_stands_upright(tmp_path: Path, up: str) -> None:
    nameless = replace(WALK, skeleton=motions.nameless(WALK.skeleton))
    np.testing.assert_allclose(read(tmp_path, clips.bvh(nameless, up)).points, WALK.points, atol=1e-7)


@pytest.mark.parametrize(
    ("name", "encoding"), [("HIERARCHY", "utf-8-sig"), ("R\u00fccken", "latin-1"), ("\u8170", "shift_jis")]
)
def test_files_of_other_encodings(tmp_path: Path, name: str, encoding: str) -> None:
    text = clips.bvh(WALK)
    (tmp_path / "a.bvh").write_bytes((text if name in text else text.replace("Spine1", name)).encode(encoding))
    np.testing.assert_allclose(load_clip(tmp_path / "a.bvh").points, WALK.points, atol=1e-7)


def test_tabs_between_all_words_and_names_that_are_not_needed(tmp_path: Path) -> None:
    clip = read(tmp_path, clips.bvh(WALK).replace(" ", "\t"), names="smpl")
    np.testing.assert_allclose(clip.points, WALK.points, atol=1e-7)
    assert "names= is for files without names" in " ".join(clip.notes)


def test_an_axis_and_a_unit_that_are_given_are_taken(tmp_path: Path) -> None:
    text = clips.bvh(WALK, "z", 1.0)
    turned = read(tmp_path, text, up="y", unit="cm")
    np.testing.assert_allclose(turned.points[:, :, 2], 0.01 * WALK.points[:, :, 1], atol=1e-9)
    with pytest.raises(UnknownNameError, match="up"):
        read(tmp_path, text, up="w")
    with pytest.raises(UnknownNameError, match="unit"):
        read(tmp_path, text, unit="yard")


def test_a_file_that_is_cut_off_is_read_as_far_as_it_goes(tmp_path: Path) -> None:
    text = clips.bvh(WALK)
    short = read(tmp_path, text[: int(0.8 * len(text))])
    assert 2 < len(short.points) < len(WALK.points)
    np.testing.assert_allclose(short.points, WALK.points[: len(short.points)], atol=1e-7)
    assert f"{len(short.points)} of {len(WALK.points)} frames" in " ".join(short.notes)


@pytest.mark.parametrize("share", [0.0, 0.001, 0.004, 0.01])
def test_a_file_that_is_cut_off_before_its_frames_is_refused(tmp_path: Path, share: float) -> None:
    text = clips.bvh(WALK)
    with pytest.raises(ClipFileError, match=r"cut off|empty|no BVH"):
        read(tmp_path, text[: int(share * len(text))])


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("CHANNELS 3", "CHANNELS 4", "number of channels"),
        ("Xrotation", "Wrotation", "unknown channel"),
        ("HIERARCHY", "HERARCHY", "no BVH"),
        ("OFFSET 0.0", "OFFSET zero", "could not convert"),
        ("OFFSET 0.0", "OFFSET 1e40", "finite"),
        ("MOTION", "}", "not understood|not closed"),
    ],
)
def test_mistakes_are_named_with_their_line(tmp_path: Path, old: str, new: str, reason: str) -> None:
    with pytest.raises(ClipFileError, match=reason) as caught:
        read(tmp_path, clips.bvh(WALK).replace(old, new, 1))
    assert "line" in str(caught.value)


def test_a_line_with_too_few_numbers_is_refused(tmp_path: Path) -> None:
    lines = clips.bvh(WALK).splitlines()
    lines[-3] = " ".join(lines[-3].split()[:-1])
    with pytest.raises(ClipFileError, match="numbers, where the hierarchy has"):
        read(tmp_path, "\n".join(lines))


def test_frames_without_numbers_are_filled_and_said(tmp_path: Path) -> None:
    lines = clips.bvh(WALK).splitlines()
    start = next(number for number, line in enumerate(lines) if line.startswith("Frame Time")) + 1
    for frame in range(20, 24):
        words = lines[start + frame].split()
        words[3] = "nan"
        lines[start + frame] = " ".join(words)
    clip = read(tmp_path, "\n".join(lines))
    assert np.isfinite(clip.points).all()
    assert not clip.seen[20:24].any()
    assert clip.seen[:20].all()
    assert np.abs(clip.points - WALK.points).max() < 0.02
    assert "4 of" in " ".join(clip.notes)


@pytest.mark.parametrize("rate", [10.0, 59.94, 240.0, 1000.0])
def test_frame_rates(tmp_path: Path, rate: float) -> None:
    clip = clips.sit(0, rate).clip
    short = Clip(
        clip.skeleton, rate, clip.points[:20], None if clip.turns is None else clip.turns[:20], clip.seen[:20], "s"
    )
    # As many digits as files have
    text = clips.bvh(short).replace(f"{1.0 / rate:.9f}", f"{1.0 / rate:.7f}")
    assert read(tmp_path, text).rate == pytest.approx(rate, rel=2e-3)


def test_frame_rates_beyond_the_bounds_are_refused(tmp_path: Path) -> None:
    text = clips.bvh(WALK)
    for time in ("1.0", "0.0001"):
        with pytest.raises(RangeError, match="10 to 1000"):
            read(tmp_path, text.replace("Frame Time: 0.033333333", f"Frame Time: {time}"))
    with pytest.raises(RangeError, match="give rate"):
        read(tmp_path, text.replace("Frame Time: 0.033333333", "Frame Time: 0"))
    again = read(tmp_path, text.replace("Frame Time: 0.033333333", "Frame Time: 0"), rate=30.0)
    assert again.rate == 30.0


def test_left_handed_axes_are_put_right(tmp_path: Path) -> None:
    mirror = np.array([1.0, 1.0, -1.0])
    points = WALK.points @ clips.AXES["y"] * mirror
    file = tmp_path / "mirrored.npz"
    np.savez(file, points=points, names=WALK.skeleton.names, fps=30)
    clip = load_clip(file)
    assert "left-handed" in " ".join(clip.notes)
    # As it was, seen in a mirror across the way ahead, is the same walk with left and right as named
    number = {name: joint for joint, name in enumerate(clip.skeleton.names)}
    ahead = clip.points[-1, 0] - clip.points[0, 0]
    across = clip.points[0, number["LeftUpLeg"]] - clip.points[0, number["RightUpLeg"]]
    assert ahead[0] * across[1] - ahead[1] * across[0] > 0.0
