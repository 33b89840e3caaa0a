"""Markers and key points: gaps, swaps, names, files of all kinds."""

from __future__ import annotations

import csv
import json
import pickle
import zipfile
from pathlib import Path

import numpy as np
import pytest

from tests.retarget import clips
from wbc import robots
from wbc.errors import ClipFileError, RangeError, ShapeError, UnknownNameError
from wbc.retarget import load_clip
from wbc.retarget.correspondence import correspondence
from wbc.retarget.robot_body import body_of
from wbc.retarget.sources.axes import TO_Z_UP
from wbc.retarget.sources.layouts import LAYOUTS
from wbc.retarget.sources.mending import fill_gaps, mend_swaps

WALK = clips.walk(1, rate=30.0).clip
NAMES = list(WALK.skeleton.names)
PARENTS = list(WALK.skeleton.parents)


@pytest.mark.parametrize("name", [*clips.MOTIONS, "dog"])
def test_the_axis_that_is_up_is_found(tmp_path: Path, name: str) -> None:
    clip = (clips.dog(4, 20.0) if name == "dog" else clips.MOTIONS[name](4, 20.0)).clip
    for up, to_world in TO_Z_UP.items():
        file = tmp_path / "clip.npz"
        np.savez(file, points=clip.points @ to_world * 1000.0, names=clip.skeleton.names, rate=20.0)
        read = load_clip(file)
        np.testing.assert_allclose(read.points, clip.points, atol=1e-9)
        assert (f"{up} is up" in " ".join(read.notes)) == (up != "z")


@pytest.mark.parametrize("name", clips.MOTIONS)
@pytest.mark.parametrize("seed", range(2))
def test_gaps_are_filled(name: str, seed: int) -> None:
    clip = clips.MOTIONS[name](seed, 30.0).clip
    points = clips.gappy(clip, seed, longest=6)
    filled = fill_gaps(points, clip.skeleton.parents, clip.skeleton.names, clip.rate, notes := [])
    lost = np.isnan(points[:, :, 0])
    assert np.isfinite(filled).all()
    np.testing.assert_array_equal(filled[~lost], points[~lost])
    # Within a fifth of a second a hand of a runner moves by half a metre
    assert np.linalg.norm(filled - clip.points, axis=2).max() < 0.15
    assert "filled" in notes[0]


def test_a_gap_at_an_end_and_a_frame_without_a_point() -> None:
    points = WALK.points.copy()
    points[:10, 5] = np.nan
    points[40:43] = np.nan
    points[-4:, 0] = np.nan
    filled = fill_gaps(points, PARENTS, NAMES, 30.0)
    assert np.isfinite(filled).all()
    assert np.linalg.norm(filled[40:43] - WALK.points[40:43], axis=2).max() < 0.05


def test_no_gaps_leave_the_points_as_they_are() -> None:
    filled = fill_gaps(WALK.points, PARENTS, NAMES, 30.0, notes := [])
    assert filled is WALK.points
    assert notes == []


@pytest.mark.parametrize("name", clips.MOTIONS)
@pytest.mark.parametrize("rate", [30.0, 120.0])
def test_markers_that_swap_are_mended(name: str, rate: float) -> None:
    for seed in range(2):
        clip = clips.noisy(clips.MOTIONS[name](seed, rate).clip, seed, 0.002)
        points, swaps = clips.swapped(clip, seed)
        mended = mend_swaps(points, clip.skeleton.names, rate, notes := [])
        np.testing.assert_array_equal(mended, clip.points)
        for one, other, _, _ in swaps:
            assert {clip.skeleton.names[one], clip.skeleton.names[other]} <= set(notes[0].replace(",", "").split())


@pytest.mark.parametrize("rate", [10.0, 60.0, 1000.0])
def test_what_did_not_swap_is_left_alone(rate: float) -> None:
    for name, motion in clips.MOTIONS.items():
        clip = clips.noisy(motion(5, rate).clip, 5)
        mended = mend_swaps(clip.points, clip.skeleton.names, rate, notes := [])
        assert mended is clip.points, name
        assert notes == []


def test_a_swap_beside_a_gap_is_said_in_the_clip(tmp_path: Path) -> None:
    left, right = NAMES.index("LeftFoot"), NAMES.index("RightFoot")
    points = WALK.points.copy()
    points[50:60, [left, right]] = points[50:60, [right, left]]
    points[30:34, NAMES.index("LeftHand")] = np.nan
    file = tmp_path / "walk.npz"
    np.savez(file, positions=points, joint_names=NAMES, fps=30, parents=PARENTS)
    clip = load_clip(file)
    said = " ".join(clip.notes)
    assert "swapped between 1.67 and 1.97 s, now mended: LeftFoot, RightFoot" in said
    assert "filled 1 gap: LeftHand" in said
    assert not clip.seen[30:34, NAMES.index("LeftHand")].any()
    assert clip.seen.sum() == clip.seen.size - 4
    assert clip.skeleton.parents == WALK.skeleton.parents


def test_a_marker_that_is_never_seen_is_left_out_and_said(tmp_path: Path) -> None:
    points = WALK.points.copy()
    knee = NAMES.index("LeftLeg")
    points[:, knee] = np.nan
    file = tmp_path / "walk.npz"
    np.savez(file, positions=points, joint_names=NAMES, fps=30, parents=PARENTS)
    clip = load_clip(file)
    assert "LeftLeg" not in clip.skeleton.names
    foot = clip.skeleton.names.index("LeftFoot")
    assert clip.skeleton.names[clip.skeleton.parents[foot]] == "LeftUpLeg"
    assert "never seen, and left out: LeftLeg" in " ".join(clip.notes)
    points[:] = np.nan
    np.savez(file, positions=points, joint_names=NAMES, fps=30)
    with pytest.raises(ClipFileError, match="no point"):
        load_clip(file)


#: Markers of Plug-in Gait and key points of COCO beside those of the pelvis, and the joints that they lie on here
MARKERS = {
    "LFHD": "Head", "RFHD": "Head", "C7": "Neck", "LKNE": "LeftLeg", "RKNE": "RightLeg", "LANK": "LeftFoot",
    "RANK": "RightFoot", "LTOE": "LeftToe", "RTOE": "RightToe", "LSHO": "LeftArm", "RSHO": "RightArm",
    "LELB": "LeftForeArm", "RELB": "RightForeArm", "LWRA": "LeftHand", "LWRB": "LeftHand", "RWRA": "RightHand",
}  # fmt: skip
POINTS = {
    "nose": "HeadEnd", "left_shoulder": "LeftArm", "right_shoulder": "RightArm", "left_elbow": "LeftForeArm",
    "right_elbow": "RightForeArm", "left_wrist": "LeftHand", "right_wrist": "RightHand", "left_hip": "LeftUpLeg",
    "right_hip": "RightUpLeg", "left_knee": "LeftLeg", "right_knee": "RightLeg", "left_ankle": "LeftFoot",
    "right_ankle": "RightFoot",
}  # fmt: skip


@pytest.mark.parametrize("table", [MARKERS, POINTS])
def test_markers_without_bones_become_joints(tmp_path: Path, table: dict[str, str]) -> None:
    assert WALK.turns is not None
    points = {name: WALK.points[:, NAMES.index(joint)] for name, joint in table.items()}
    hips = {"L": WALK.points[:, NAMES.index("LeftUpLeg")], "R": WALK.points[:, NAMES.index("RightUpLeg")]}
    if table is MARKERS:
        # Corners of the pelvis as far from each other as makes these the hips by Bell's shares
        width = np.linalg.norm(hips["L"] - hips["R"], axis=1).mean() / 0.72
        for side, left in (("L", 1.0), ("R", -1.0)):
            to_corner = np.array([0.19, 0.14 * left, 0.30])
            points[f"{side}ASI"] = hips[side] + WALK.turns[:, 0] @ (width * to_corner)
            points[f"{side}PSI"] = points[f"{side}ASI"] + WALK.turns[:, 0] @ np.array([-0.15, -0.07 * left, 0.0])
    file = tmp_path / "markers.npz"
    np.savez(file, points=np.stack(list(points.values()), axis=1), names=list(points), fps=30)
    clip = load_clip(file)
    number = clip.skeleton.names.index
    for joint, source in (("hip", "UpLeg"), ("knee", "Leg"), ("ankle", "Foot"), ("elbow", "ForeArm")):
        for side in ("Left", "Right"):
            place = clip.points[:, number(f"{side.lower()}_{joint}")]
            np.testing.assert_allclose(place, WALK.points[:, NAMES.index(side + source)], atol=1e-9)
    match = correspondence(body_of(robots.load("simple_humanoid")), clip.skeleton)
    assert set(match.limbs) == {"left_leg", "right_leg", "left_arm", "right_arm"}
    assert match.limbs["left_leg"].chain[:3] == tuple(number(f"left_{k}") for k in ("hip", "knee", "ankle"))


def test_a_person_whose_root_is_the_origin_is_put_on_the_ground(tmp_path: Path) -> None:
    file = tmp_path / "video.npz"
    np.savez(file, points=WALK.points - WALK.points[:, :1], names=NAMES, fps=30)
    clip = load_clip(file)
    assert "raised" in " ".join(clip.notes)
    assert -0.05 < clip.points[:, :, 2].min() < 0.05


def test_a_table_with_a_header(tmp_path: Path) -> None:
    file = tmp_path / "walk.csv"
    with file.open("w", newline="") as stream:
        writer = csv.writer(stream, delimiter=";")
        writer.writerow(["time", *(f"{name}_{axis}" for name in NAMES for axis in "XYZ"), "force"])
        for frame, row in enumerate(1000.0 * WALK.points.reshape(len(WALK.points), -1)):
            numbers = [f"{number:.6f}" for number in row]
            if frame == 7:
                numbers[3:6] = ["", "", ""]
            writer.writerow([f"{frame / 30.0:.6f}", *numbers, "left"])
    clip = load_clip(file)
    assert clip.skeleton.names == WALK.skeleton.names
    assert clip.rate == 30.0
    assert not clip.seen[7, 1]
    assert clip.seen.sum() == clip.seen.size - 1
    np.testing.assert_allclose(clip.points[8:], WALK.points[8:], atol=1e-8)
    assert "columns that are no points: force" in " ".join(clip.notes)
    for text, reason in (
        ("a,b\n1,2\n", "no header"),
        ("a_x,a_y,a_z,a_x\n1,2,3,4\n", "two columns a_x"),
        ("LeftFoot_x,LeftFoot_y,LeftFoot_z\n1,2,three\n", "line 2"),
    ):
        file.write_text(text)
        with pytest.raises(ClipFileError, match=reason):
            load_clip(file, rate=30.0)


def test_points_of_one_name_are_told_apart(tmp_path: Path) -> None:
    file = tmp_path / "walk.npz"
    np.savez(file, points=WALK.points, names=[*NAMES[:-1], NAMES[-2]], fps=30)
    clip = load_clip(file)
    assert clip.skeleton.names == (*NAMES[:-1], f"{NAMES[-2]}_2")
    assert f"the name {NAMES[-2]!r} is there more than once" in " ".join(clip.notes)


@pytest.mark.parametrize("parent", ["a", 0])
def test_parents_that_are_none_are_said(tmp_path: Path, parent: object) -> None:
    np.savez(tmp_path / "walk.npz", points=WALK.points, names=NAMES, fps=30, parents=[parent] * len(NAMES))
    assert "left out" in " ".join(load_clip(tmp_path / "walk.npz").notes)


def test_a_rate_that_is_a_word_is_none(tmp_path: Path) -> None:
    np.savez(tmp_path / "walk.npz", points=WALK.points, names=NAMES, fps="thirty")
    with pytest.raises(RangeError, match="give rate"):
        load_clip(tmp_path / "walk.npz")


def test_an_array_without_names_is_known_by_its_bones(tmp_path: Path) -> None:
    file = tmp_path / "walk.npy"
    for layout, joints in LAYOUTS.items():
        if layout not in ("lafan", "lafan-left"):
            continue
        named = [name.removesuffix("Base") for name in joints.names]
        np.save(file, WALK.points[:, [NAMES.index(name) for name in named]])
        clip = load_clip(file, rate=30.0)
        assert clip.skeleton.names == joints.names
        assert repr(layout) in clip.notes[0]
    with pytest.raises(RangeError, match="rate"):
        load_clip(file)
    with pytest.raises(UnknownNameError, match="did you mean 'lafan'"):
        load_clip(file, rate=30.0, names="lafan1")
    with pytest.raises(ShapeError, match="55 joints"):
        load_clip(file, rate=30.0, names="smplx")
    with pytest.raises(ShapeError, match="expected 22 names"):
        load_clip(file, rate=30.0, names=["a", "b"])
    np.save(file, WALK.points[:, :7])
    with pytest.raises(ClipFileError, match="give names"):
        load_clip(file, rate=30.0)


@pytest.mark.parametrize("bad", [np.zeros((5, 4)), np.zeros((1, 22, 3)), np.zeros((0, 22, 3)), np.array(["a"])])
def test_arrays_that_are_no_points_are_refused(tmp_path: Path, bad: np.ndarray) -> None:
    file = tmp_path / "bad.npy"
    np.save(file, bad)
    with pytest.raises(ClipFileError, match=r"points|at least 2"):
        load_clip(file, rate=30.0)


def test_a_tensor_is_read_without_torch(tmp_path: Path) -> None:
    """The layout of torch's files, with the pickle that torch writes for one tensor."""
    points = np.ascontiguousarray(WALK.points, dtype=np.float32)
    file = tmp_path / "walk.pt"
    write_tensor(file, points)
    clip = load_clip(file, rate=30.0, names=NAMES)
    np.testing.assert_allclose(clip.points, points, atol=1e-9)
    # 591 columns, as of InterMimic
    wide = np.zeros((20, 591), dtype=np.float32)
    stretched = np.repeat(WALK.points[:20, :1], 52, axis=1) + np.linspace(0.0, 0.5, 52)[:, None]
    wide[:, 162:318] = stretched.reshape(20, -1)
    write_tensor(file, wide)
    assert load_clip(file, rate=30.0, up="z", unit="m").skeleton.names[:3] == ("Pelvis", "L_Hip", "L_Knee")


def write_tensor(file: Path, values: np.ndarray) -> None:
    size = "".join(f"I{n}\n" for n in values.shape)
    stride = "".join(f"I{n // values.itemsize}\n" for n in values.strides)
    text = "ctorch._utils\n_rebuild_tensor_v2\n((Vstorage\nctorch\nFloatStorage\nV0\nVcpu\n"
    text += f"I{values.size}\ntQI0\n({size}t({stride}tI00\nccollections\nOrderedDict\n(tRtR."
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("walk/data.pkl", text)
        archive.writestr("walk/data/0", values.tobytes())


def test_pickles_that_ask_for_more_than_arrays_are_refused(tmp_path: Path) -> None:
    class Evil:
        def __reduce__(self) -> tuple[object, ...]:
            return (Path.touch, (tmp_path / "touched",))

    for name in ("a.pkl", "a.pt"):
        file = tmp_path / name
        if name.endswith("pkl"):
            file.write_bytes(pickle.dumps({"poses": Evil()}))
        else:
            with zipfile.ZipFile(file, "w") as archive:
                archive.writestr("a/data.pkl", pickle.dumps(Evil()))
        with pytest.raises(ClipFileError):
            load_clip(file, rate=30.0)
    assert not (tmp_path / "touched").exists()


@pytest.mark.parametrize("kind", ["npz", "npy", "pkl", "pt", "csv", "c3d", "bvh"])
def test_broken_files_are_refused_by_name(tmp_path: Path, kind: str) -> None:
    random = np.random.default_rng(0)
    file = tmp_path / f"broken.{kind}"
    # A pickle's string without an end, and the head of an array that is no Python
    damaged = b"\x80\x04\x8e" + b"\xff" * 7 + b"\x3f", b"\x93NUMPY\x01\x00\x10\x00{'descr': ((((((\n"
    for content in (b"", b"\x00", random.bytes(3000), json.dumps({"a": 1}).encode(), *damaged):
        file.write_bytes(content)
        with pytest.raises(ClipFileError, match="broken"):
            load_clip(file, rate=30.0)
    np.savez(tmp_path / "whole.npz", points=WALK.points, names=NAMES, fps=30)
    whole = (tmp_path / "whole.npz").read_bytes()
    if kind == "npz":
        for share in (0.3, 0.7, 0.99):
            file.write_bytes(whole[: int(share * len(whole))])
            with pytest.raises(ClipFileError, match="cut off"):
                load_clip(file)


@pytest.mark.parametrize(("name", "error", "reason"), [
    ("walk.fbx", ClipFileError, "convert it to BVH"),
    ("walk.txt", UnknownNameError, "bvh"),
    ("nowhere.bvh", ClipFileError, "no such file"),
])  # fmt: skip
def test_other_files_are_refused(tmp_path: Path, name: str, error: type[Exception], reason: str) -> None:
    if name != "nowhere.bvh":
        (tmp_path / name).write_bytes(b"abc")
    with pytest.raises(error, match=reason):
        load_clip(tmp_path / name)
