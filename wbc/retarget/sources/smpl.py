"""AMASS, SMPL, SMPL-H and SMPL-X: rotations of a body model's joints, whose places the user's own model file says."""

from __future__ import annotations

import pathlib
from typing import Any

import numpy as np

from wbc import rotations, validation
from wbc.errors import ClipFileError
from wbc.retarget.clip import Array
from wbc.retarget.sources import arrays
from wbc.retarget.sources.layouts import LAYOUTS
from wbc.retarget.sources.recorded import Recorded, first_of, no_clip, rate_in

#: Keys of rotation vectors of all joints one after the other
POSES = ("poses", "smpl_poses", "fullpose", "pose")
#: Keys of the root's place
PLACES = ("trans", "smpl_trans", "transl")
#: Keys of rotation vectors in parts, in the order of the joints
POSE_PARTS = ("root_orient", "pose_body", "pose_jaw", "pose_eye", "pose_hand")
#: Number of joints -> the layout that has them
OF_SIZE = {24: "smpl", 22: "smpl-body", 52: "smplh", 55: "smplx"}
#: Why a clip cannot be read
NO_MODEL = (
    "it has rotations of a body model and no places of joints; give body_model= (--body-model), your own file of SMPL, "
    "SMPL-H or SMPL-X (npz or pkl). None is shipped: its licence asks every user to register"
)
#: Joints of the body, which all models have in the same order
BODY = 22


def has_poses(data: object) -> bool:
    """Whether arrays by name are a body model's rotations."""
    return isinstance(data, dict) and any(name in data for name in (*POSES, "root_orient", "body_pose"))


def read_smpl(path: pathlib.Path, data: Any, body_model: pathlib.Path | None) -> Recorded:
    """A clip of rotations in arrays by name, by the file of a body model: SMPL, SMPL-H or SMPL-X, npz or pkl.

    Joints are J = J_regressor (v_template + shapedirs betas), turned by the poses along the model's tree.
    """
    if not has_poses(data):
        raise no_clip(path, f"no clip of a body model: expected {', '.join(POSES)}")
    poses = _poses(path, data)
    if body_model is None:
        raise no_clip(path, NO_MODEL)
    notes: list[str] = []
    joints, parents = _joints(body_model, data.get("betas"), notes)
    frames, count = poses.shape[:2]
    used = count if count == len(joints) else BODY
    if used < count or used < len(joints):
        notes.append(f"the clip has {count} joints and the body model {len(joints)}: the {BODY} of the body are used")
    layout, parents = LAYOUTS[OF_SIZE.get(used, "smpl-body")], parents[:used]
    if parents != layout.parents[:used]:
        raise no_clip(body_model, "its joints are no tree of SMPL, SMPL-H or SMPL-X")
    offsets = joints[:used] - np.where(np.array(parents)[:, None] < 0, 0.0, joints[parents])
    own = rotations.exponential(poses[:, :used].reshape(-1, 3)).reshape(frames, used, 3, 3)
    given = first_of(data, PLACES)
    moves = np.asarray(np.zeros((frames, 3)) if given is None else given, dtype=float).reshape(-1, 3)
    moves = moves / float(np.ravel(data.get("smpl_scaling", 1.0))[0])
    if len(moves) != frames:
        raise no_clip(path, f"{len(moves)} places of the root for {frames} frames")
    clip = Recorded([*layout.names], parents, moves, rate_in(data), offsets, ends=[False] * used, notes=notes)
    return clip.place(path, own, {0: offsets[0] + moves})


def _poses(path: pathlib.Path, data: dict[str, Any]) -> Array:
    """Rotation vectors [frames, joints, 3]; NaN in frames that lack any."""
    parts = ("global_orient", "body_pose") if "body_pose" in data else [name for name in POSE_PARTS if name in data]
    whole = [name for name in POSES if name in data][:1]
    try:
        own = [np.asarray(data[name], dtype=float) for name in whole or parts]
        poses = np.concatenate([rows.reshape(len(rows), -1) for rows in own], axis=1)
        poses = poses.reshape(len(poses), -1, 3)
    except (ValueError, TypeError, KeyError, IndexError) as error:
        raise no_clip(path, f"its rotations have no shape [frames, joints, 3]: {error}") from error
    if poses.shape[1] < BODY or len(poses) < 2:
        there = f"{len(poses)} frames of {poses.shape[1]} joints"
        raise no_clip(path, f"{there}: expected 2 frames of {BODY} joints at least")
    poses[~np.isfinite(poses).all(axis=(1, 2))] = np.nan
    return poses


def _joints(file: pathlib.Path, betas: Any, notes: list[str]) -> tuple[Array, list[int]]:
    """Places of the joints in the rest pose [joints, 3] [m], and their parents."""
    if not file.is_file():
        raise ClipFileError("body_model", str(file), validation.no_such(file))
    data = arrays.load(file)
    try:
        regressor = data["J_regressor"]
        regressor = np.asarray(regressor.toarray() if hasattr(regressor, "toarray") else regressor, dtype=float)
        template, shapes = np.asarray(data["v_template"], dtype=float), np.asarray(data["shapedirs"], dtype=float)
        parents = [int(parent) for parent in np.asarray(data["kintree_table"])[0].astype(np.int64)]
        # Roots are written as -1 or as the largest number of 32 bits
        parents = [-1 if not 0 <= parent < joint else parent for joint, parent in enumerate(parents)]
        shape = np.zeros(0) if betas is None else np.asarray(betas, dtype=float).reshape(-1, np.shape(betas)[-1])[0]
        count = min(len(shape), shapes.shape[2])
        if count < len(shape):
            notes.append(f"the body model has {count} of the clip's {len(shape)} shape parameters")
        return regressor @ (template + shapes[:, :, :count] @ shape[:count]), parents
    except (KeyError, ValueError, TypeError, IndexError) as error:
        reason = f"no body model: it needs J_regressor, v_template, shapedirs and kintree_table ({error!r})"
        raise ClipFileError("body_model", str(file), reason) from error
