"""AMASS, SMPL, SMPL-H and SMPL-X: rotations of a body model's joints, whose places the user's own model file says."""

from __future__ import annotations

import io
import pathlib
import pickle
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbc import rotations, validation
from wbc.errors import ClipFileError
from wbc.retarget.sources.keypoints import BROKEN, RATES, arrays_of
from wbc.retarget.sources.layouts import LAYOUTS, parents_of
from wbc.retarget.sources.recorded import Recorded, in_the_world, no_clip
from wbc.validation import Array

#: Keys of rotation vectors of all joints one after the other
POSES = ("poses", "smpl_poses", "fullpose", "pose")
#: Keys of the root's place
PLACES = ("trans", "smpl_trans", "transl")
#: Keys of rotation vectors in parts, in the order of the joints
POSE_PARTS = ("root_orient", "pose_body", "pose_jaw", "pose_eye", "pose_hand")
#: Number of joints -> the layout that has them
OF_SIZE = {24: "smpl", 22: "smpl-body", 52: "smplh", 55: "smplx"}
#: Joints of the body, which all models have in the same order
BODY = 22
#: Modules that the pickle of a body model names, besides chumpy's, which are read as plain arrays
SAFE = {
    ("numpy", "ndarray"), ("numpy", "dtype"), ("numpy.core.multiarray", "_reconstruct"),
    ("numpy.core.multiarray", "scalar"),
    ("numpy._core.multiarray", "_reconstruct"), ("numpy._core.multiarray", "scalar"), ("_codecs", "encode"),
    ("scipy.sparse.csc", "csc_matrix"), ("scipy.sparse._csc", "csc_matrix"), ("scipy.sparse.csr", "csr_matrix"),
    ("scipy.sparse._csr", "csr_matrix"),
}  # fmt: skip


def has_poses(data: dict[str, Any]) -> bool:
    """Whether arrays are a body model's rotations: a key of :data:`POSES` or :data:`POSE_PARTS`."""
    return any(name in data for name in POSES) or "root_orient" in data or "body_pose" in data


def read_smpl(path: pathlib.Path, data: dict[str, Any], body_model: pathlib.Path | None) -> Recorded:
    """A clip of rotations, by a body model.

        J = J_regressor (v_template + shapedirs betas)        joints as the model's tree has them, turned by the poses

    Args:
        data: arrays of the file. body_model: a file of SMPL, SMPL-H or SMPL-X, npz or pkl.

    Raises:
        ClipFileError: a body model is needed, or one of the two has no such arrays.
    """
    poses = _poses(path, data)
    if body_model is None:
        reason = (
            "it has rotations of a body model and no places of joints; give body_model= (--body-model), your own file "
            "of SMPL, SMPL-H or SMPL-X (npz or pkl). None is shipped: its licence asks every user to register"
        )
        raise no_clip(path, reason)
    notes: list[str] = []
    joints, parents = _joints(body_model, data.get("betas"), notes)
    count = poses.shape[1]
    used = count if count == len(joints) else BODY
    if used < count or used < len(joints):
        notes.append(f"the clip has {count} joints and the body model {len(joints)}: the {BODY} of the body are used")
    names = [name for name, _ in LAYOUTS[OF_SIZE.get(used, "smpl-body")]]
    if parents[:used] != parents_of(LAYOUTS[OF_SIZE.get(used, "smpl-body")])[:used]:
        raise no_clip(body_model, "its joints are no tree of SMPL, SMPL-H or SMPL-X")
    offsets = np.array(
        [joints[k] - (joints[parent] if parent >= 0 else 0.0) for k, parent in enumerate(parents[:used])]
    )
    own = rotations.exponential(np.nan_to_num(poses[:, :used]).reshape(-1, 3)).reshape(len(poses), used, 3, 3)
    place = next((np.asarray(data[name], dtype=float) for name in PLACES if name in data), np.zeros((len(poses), 3)))
    place = np.ravel(place).reshape(-1, 3) / float(np.ravel(data.get("smpl_scaling", 1.0))[0])
    if len(place) != len(poses):
        raise no_clip(path, f"{len(place)} places of the root for {len(poses)} frames")
    points, turns = in_the_world(parents[:used], offsets, own, {0: offsets[0] + place})
    lost: NDArray[np.bool_] = np.asarray(np.isnan(poses).any(axis=(1, 2)) | np.isnan(place).any(axis=1))
    points[lost] = np.nan
    rate = next((float(np.ravel(data[name])[0]) for name in RATES if name in data), 0.0)
    return Recorded(
        names, parents[:used], points, rate, offsets, _held(turns, lost), [False] * used, unit=1.0, usual="z",
        rest_up="y", notes=notes,
    )  # fmt: skip


def read_smpl_pickle(path: pathlib.Path) -> dict[str, Any]:
    """The arrays of a pickled clip, such as AIST++'s; nothing but arrays is read from the pickle."""
    data = plain_pickle(path)
    if not isinstance(data, dict) or not has_poses(data):
        raise no_clip(path, f"no clip of a body model: expected {', '.join(POSES)}")
    return {str(key): value for key, value in data.items()}


def _poses(path: pathlib.Path, data: dict[str, Any]) -> Array:
    """Rotation vectors [frames, joints, 3]."""
    whole = next((data[name] for name in POSES if name in data), None)
    try:
        if whole is None and "body_pose" in data:
            whole = np.concatenate([_rows(data["global_orient"]), _rows(data["body_pose"])], axis=1)
        elif whole is None:
            whole = np.concatenate([_rows(data[name]) for name in POSE_PARTS if name in data], axis=1)
        poses = np.asarray(whole, dtype=float)
        poses = poses.reshape(len(poses), -1, 3)
    except (ValueError, TypeError, KeyError, IndexError) as error:
        raise no_clip(path, f"its rotations have no shape [frames, joints, 3]: {error}") from error
    if poses.shape[1] < BODY or len(poses) < 2:
        raise no_clip(
            path, f"{len(poses)} frames of {poses.shape[1]} joints: expected 2 frames of {BODY} joints at least"
        )
    return np.asarray(np.where(np.isfinite(poses), poses, np.nan))


def _rows(values: Any) -> Array:
    rows: Array = np.asarray(values, dtype=float)
    return rows.reshape(len(rows), -1)


def _held(turns: Array, lost: NDArray[np.bool_]) -> Array:
    """Rotations of frames that are lost: those of the last one before, else of the first."""
    good = np.flatnonzero(~lost)
    if not len(good) or len(good) == len(turns):
        return turns
    nearest = good[np.clip(np.searchsorted(good, np.arange(len(turns)), side="right") - 1, 0, None)]
    return np.asarray(turns[nearest])


def _joints(file: pathlib.Path, betas: Any, notes: list[str]) -> tuple[Array, list[int]]:
    """Places of the joints in the rest pose [joints, 3] [m], and their parents."""
    path = validation.file_path("body_model", file)
    if not path.is_file():
        raise ClipFileError("body_model", str(path), validation.no_such(path))
    data = arrays_of(path) if path.suffix == ".npz" else plain_pickle(path, "latin1")
    try:
        regressor = data["J_regressor"]
        regressor = np.asarray(regressor.toarray() if hasattr(regressor, "toarray") else regressor, dtype=float)
        template, shapes = np.asarray(data["v_template"], dtype=float), np.asarray(data["shapedirs"], dtype=float)
        parents = [int(parent) for parent in np.asarray(data["kintree_table"])[0].astype(np.int64)]
        # Roots are written as -1 or as the largest number of 32 bits
        parents = [-1 if not 0 <= parent < joint else parent for joint, parent in enumerate(parents)]
        shape = np.ravel(
            np.zeros(0) if betas is None else np.asarray(betas, dtype=float).reshape(-1, np.shape(betas)[-1])[0]
        )
        count = min(len(shape), shapes.shape[2])
        if count < len(shape):
            notes.append(f"the body model has {count} of the clip's {len(shape)} shape parameters")
        joints = regressor @ (template + shapes[:, :, :count] @ shape[:count])
    except (KeyError, ValueError, TypeError, IndexError) as error:
        reason = f"no body model: it needs J_regressor, v_template, shapedirs and kintree_table ({error!r})"
        raise ClipFileError("body_model", str(path), reason) from error
    return joints, parents


class _PlainArray:
    """Stands for what is not a plain array in the pickle of a body model, such as chumpy's: keeps its state."""

    def __init__(self, *arguments: Any) -> None:
        self.arguments = arguments

    def __setstate__(self, state: Any) -> None:
        self.state = state

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Any:
        return np.asarray(self.state["x"], dtype=dtype)


class _PlainUnpickler(pickle.Unpickler):
    """Builds arrays, sparse matrices and plain data, and calls nothing else."""

    def find_class(self, module: str, name: str) -> Any:
        if module.split(".")[0] == "chumpy":
            return _PlainArray
        if (module, name) in SAFE or (module, name) in {("builtins", "set"), ("collections", "OrderedDict")}:
            if module.startswith("scipy"):
                module = "scipy.sparse"
            return super().find_class(module.replace("numpy.core", "numpy._core"), name)
        raise pickle.UnpicklingError(f"{module}.{name} is no array")


def plain_pickle(path: pathlib.Path, encoding: str = "latin1") -> Any:
    """What a pickle of arrays holds; a pickle that asks for anything else is refused.

    Raises:
        ClipFileError: it cannot be read, or is none of arrays.
    """
    try:
        return _PlainUnpickler(io.BytesIO(path.read_bytes()), encoding=encoding).load()
    except (*BROKEN, AttributeError, IndexError, ImportError) as error:
        raise no_clip(path, f"no pickle of arrays that can be read: {error}") from error
