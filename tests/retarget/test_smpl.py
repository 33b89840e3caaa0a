"""AMASS, SMPL-H and SMPL-X clips with body models that are made here, in npz and as pickles."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import sparse
from scipy.spatial.transform import Rotation

from wbc.errors import ClipFileError
from wbc.retarget import load_clip
from wbc.retarget.sources.layouts import LAYOUTS

#: Rest pose of the body as SMPL has it: y up, looking along z, left is x [m]
REST = {
    "pelvis": (0, 0, 0), "left_hip": (0.07, -0.09, 0), "right_hip": (-0.07, -0.09, 0), "spine1": (0, 0.11, 0),
    "left_knee": (0.1, -0.47, 0), "right_knee": (-0.1, -0.47, 0), "spine2": (0, 0.24, 0),
    "left_ankle": (0.1, -0.87, -0.03), "right_ankle": (-0.1, -0.87, -0.03), "spine3": (0, 0.3, 0),
    "left_foot": (0.12, -0.93, 0.1), "right_foot": (-0.12, -0.93, 0.1), "neck": (0, 0.5, 0),
    "left_collar": (0.08, 0.42, 0), "right_collar": (-0.08, 0.42, 0), "head": (0, 0.6, 0.03),
    "left_shoulder": (0.2, 0.44, 0), "right_shoulder": (-0.2, 0.44, 0), "left_elbow": (0.45, 0.43, 0),
    "right_elbow": (-0.45, 0.43, 0), "left_wrist": (0.7, 0.43, 0), "right_wrist": (-0.7, 0.43, 0),
}  # fmt: skip


def body_model(layout: str, shapes: int = 10) -> tuple[dict[str, Any], np.ndarray]:
    """A model with one vertex beside each joint, and its joints."""
    random = np.random.default_rng(3)
    joints: list[np.ndarray] = []
    for name, parent in zip(*LAYOUTS[layout], strict=True):
        joints.append(np.array(REST[name], dtype=float) if name in REST else joints[parent] + 0.03)
    places = np.array(joints)
    shift = random.normal(0.0, 0.01, places.shape)
    template = np.concatenate([places + shift, places - shift])
    regressor = np.concatenate([np.eye(len(places)), np.eye(len(places))], axis=1) / 2.0
    parents = np.array(LAYOUTS[layout].parents)
    parents[0] = 2**32 - 1
    return {
        "J_regressor": regressor, "v_template": template, "kintree_table": np.array([parents, np.arange(len(places))]),
        "shapedirs": random.normal(0.0, 0.002, (len(template), 3, shapes)),
    }, places  # fmt: skip


def expected(model: dict[str, Any], poses: np.ndarray, trans: np.ndarray, betas: np.ndarray, count: int) -> np.ndarray:
    """Joints by the definition of the models, with scipy's rotations."""
    vertices = model["v_template"] + np.einsum("vcs,s->vc", model["shapedirs"][:, :, : len(betas)], betas)
    rest = model["J_regressor"] @ vertices
    parents = [-1, *(int(parent) for parent in model["kintree_table"][0][1:])]
    out = np.zeros((len(poses), count, 3))
    for frame, pose in enumerate(poses):
        turns: list[Rotation] = []
        for joint in range(count):
            own = Rotation.from_rotvec(pose[3 * joint : 3 * joint + 3])
            if joint == 0:
                turns.append(own)
                out[frame, 0] = rest[0] + trans[frame]
                continue
            parent = parents[joint]
            turns.append(turns[parent] * own)
            out[frame, joint] = out[frame, parent] + turns[parent].apply(rest[joint] - rest[parent])
    return out


def motion(joints: int, frames: int = 40) -> tuple[np.ndarray, np.ndarray]:
    """Rotation vectors of a person who stands with z up and moves a little, and the root's places."""
    random = np.random.default_rng(5)
    time = np.linspace(0.0, 1.0, frames)[:, None]
    poses = random.normal(0.0, 0.1, 3 * joints) * np.sin(2.0 * np.pi * time + random.uniform(0.0, 6.0, 3 * joints))
    # y up to z up
    poses[:, :3] = [np.pi / 2.0, 0.0, 0.0]
    trans = np.concatenate([time * 0.3, 0.0 * time, 0.95 + 0.0 * time], axis=1)
    return poses, trans


@pytest.mark.parametrize(("layout", "key"), [("smpl", "poses"), ("smplh", "poses"), ("smplx", "parts")])
@pytest.mark.parametrize("kind", ["npz", "pkl"])
def test_joints_are_those_of_the_model(tmp_path: Path, layout: str, key: str, kind: str) -> None:
    model, _ = body_model(layout)
    count = len(LAYOUTS[layout].names)
    poses, trans = motion(count)
    betas = np.random.default_rng(1).normal(size=16)
    data: dict[str, Any] = {"trans": trans, "betas": betas, "mocap_frame_rate": 120.0, "gender": "neutral"}
    if key == "poses":
        data["poses"] = poses
    else:
        data |= {"root_orient": poses[:, :3], "pose_body": poses[:, 3:66], "pose_jaw": poses[:, 66:69]}
        data |= {"pose_eye": poses[:, 69:75], "pose_hand": poses[:, 75:]}
    file, model_file = tmp_path / "walk_poses.npz", tmp_path / f"model.{kind}"
    np.savez(file, **data)
    if kind == "npz":
        np.savez(model_file, **model)
    else:
        model_file.write_bytes(
            pickle.dumps({**model, "J_regressor": sparse.csc_matrix(model["J_regressor"])}, protocol=2)
        )
    clip = load_clip(file, body_model=model_file)
    assert clip.rate == 120.0
    assert clip.skeleton.names == LAYOUTS[layout].names
    np.testing.assert_allclose(clip.points, expected(model, poses, trans, betas[:10], count), atol=1e-9)
    assert "10 of the clip's 16 shape parameters" in " ".join(clip.notes)
    # Points follow from offsets and turns, which are from a rest pose with z up
    assert clip.turns is not None
    for joint, parent in enumerate(clip.skeleton.parents):
        if parent >= 0:
            step = clip.turns[:, parent] @ clip.skeleton.offsets[joint]
            np.testing.assert_allclose(clip.points[:, joint], clip.points[:, parent] + step, atol=1e-9)
    names = clip.skeleton.names
    assert clip.skeleton.offsets[names.index("left_knee"), 2] < -0.3


def test_a_clip_of_hands_with_a_model_without_them(tmp_path: Path) -> None:
    model, _ = body_model("smpl")
    poses, trans = motion(52)
    np.savez(tmp_path / "clip.npz", poses=poses, trans=trans, mocap_framerate=60.0)
    np.savez(tmp_path / "model.npz", **model)
    clip = load_clip(tmp_path / "clip.npz", body_model=tmp_path / "model.npz")
    assert len(clip.skeleton.names) == 22
    np.testing.assert_allclose(clip.points, expected(model, poses, trans, np.zeros(1), 22), atol=1e-9)
    assert "the 22 of the body are used" in " ".join(clip.notes)


def test_frames_without_numbers_are_filled(tmp_path: Path) -> None:
    model, _ = body_model("smplh")
    poses, trans = motion(52)
    poses[10:12, 7] = np.nan
    np.savez(tmp_path / "clip.npz", poses=poses, trans=trans, mocap_framerate=60.0)
    np.savez(tmp_path / "model.npz", **model)
    clip = load_clip(tmp_path / "clip.npz", body_model=tmp_path / "model.npz")
    assert np.isfinite(clip.points).all()
    assert not clip.seen[10:12].any()
    assert clip.seen.sum() == clip.seen.size - 2 * 52


def test_without_a_body_model_the_error_says_what_to_give(tmp_path: Path) -> None:
    poses, trans = motion(52)
    file = tmp_path / "clip.npz"
    np.savez(file, poses=poses, trans=trans, mocap_framerate=60.0)
    with pytest.raises(ClipFileError, match="body_model"):
        load_clip(file)
    with pytest.raises(ClipFileError, match="no such file"):
        load_clip(file, body_model=tmp_path / "none.npz")
    np.savez(tmp_path / "other.npz", v_template=np.zeros((3, 3)))
    with pytest.raises(ClipFileError, match="J_regressor"):
        load_clip(file, body_model=tmp_path / "other.npz")
    np.savez(file, poses=np.zeros((40, 10)), trans=trans, mocap_framerate=60.0)
    with pytest.raises(ClipFileError, match="rotations"):
        load_clip(file, body_model=tmp_path / "other.npz")
