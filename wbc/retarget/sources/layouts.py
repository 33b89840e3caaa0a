"""Joints of well-known skeletons, in the order in which files of plain numbers have them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc.retarget.sources.body_words import numbers_of
from wbc.validation import Array

#: Fingers of a hand as SMPL-H and SMPL-X have them
FINGERS = ("index", "middle", "pinky", "ring", "thumb")
#: SMPL's joints, with the number of each one's parent
_BODY = (
    ("pelvis", -1), ("left_hip", 0), ("right_hip", 0), ("spine1", 0), ("left_knee", 1), ("right_knee", 2),
    ("spine2", 3), ("left_ankle", 4), ("right_ankle", 5), ("spine3", 6), ("left_foot", 7), ("right_foot", 8),
    ("neck", 9), ("left_collar", 9), ("right_collar", 9), ("head", 12), ("left_shoulder", 13), ("right_shoulder", 14),
    ("left_elbow", 16), ("right_elbow", 17), ("left_wrist", 18), ("right_wrist", 19),
)  # fmt: skip
#: A name and its parent's, "" for a root
Layout = tuple[tuple[str, str], ...]


def _of_numbers(pairs: Sequence[tuple[str, int]]) -> Layout:
    return tuple((name, pairs[parent][0] if parent >= 0 else "") for name, parent in pairs)


def _hand(side: str, wrist: str, title: bool = False, fingers: Sequence[str] = FINGERS) -> Layout:
    """Three joints of each finger, one after the other."""
    out: list[tuple[str, str]] = []
    for finger in fingers:
        name = f"{side}{finger.title() if title else finger}"
        out += [(f"{name}{k}", wrist if k == 1 else f"{name}{k - 1}") for k in (1, 2, 3)]
    return tuple(out)


def _chain(*names: str, root: str = "") -> Layout:
    return tuple(zip(names, (root, *names[:-1]), strict=True))


SMPL_BODY = _of_numbers(_BODY)
_MOCAP_FINGERS = ("Thumb", "Index", "Middle", "Ring", "Pinky")
#: Well-known orders, by name
LAYOUTS: dict[str, Layout] = {
    "smpl-body": SMPL_BODY,
    "smpl": (*SMPL_BODY, ("left_hand", "left_wrist"), ("right_hand", "right_wrist")),
    "smplh": (*SMPL_BODY, *_hand("left_", "left_wrist"), *_hand("right_", "right_wrist")),
    "smplx": (
        *SMPL_BODY, ("jaw", "head"), ("left_eye", "head"), ("right_eye", "head"),
        *_hand("left_", "left_wrist"), *_hand("right_", "right_wrist"),
    ),
    # MuJoCo's order of SMPL-H, as of PHC and InterMimic
    "smplh-mujoco": (
        *_chain("Pelvis", "L_Hip", "L_Knee", "L_Ankle", "L_Toe"),
        *_chain("R_Hip", "R_Knee", "R_Ankle", "R_Toe", root="Pelvis"),
        *_chain("Torso", "Spine", "Chest", "Neck", "Head", root="Pelvis"),
        *_chain("L_Thorax", "L_Shoulder", "L_Elbow", "L_Wrist", root="Chest"),
        *_hand("L_", "L_Wrist", True),
        *_chain("R_Thorax", "R_Shoulder", "R_Elbow", "R_Wrist", root="Chest"),
        *_hand("R_", "R_Wrist", True),
    ),
    "lafan": (
        *_chain("Hips", "RightUpLeg", "RightLeg", "RightFoot", "RightToeBase"),
        *_chain("LeftUpLeg", "LeftLeg", "LeftFoot", "LeftToeBase", root="Hips"),
        *_chain("Spine", "Spine1", "Spine2", "Neck", "Head", root="Hips"),
        *_chain("RightShoulder", "RightArm", "RightForeArm", "RightHand", root="Spine2"),
        *_chain("LeftShoulder", "LeftArm", "LeftForeArm", "LeftHand", root="Spine2"),
    ),
    "lafan-left": (
        *_chain("Hips", "LeftUpLeg", "LeftLeg", "LeftFoot", "LeftToe"),
        *_chain("RightUpLeg", "RightLeg", "RightFoot", "RightToe", root="Hips"),
        *_chain("Spine", "Spine1", "Spine2", "Neck", "Head", root="Hips"),
        *_chain("LeftShoulder", "LeftArm", "LeftForeArm", "LeftHand", root="Spine2"),
        *_chain("RightShoulder", "RightArm", "RightForeArm", "RightHand", root="Spine2"),
    ),
    "mocap": (
        *_chain("Hips", "Spine", "Spine1", "Neck", "Head"),
        *_chain("LeftShoulder", "LeftArm", "LeftForeArm", "LeftHand", root="Spine1"),
        *_hand("LeftHand", "LeftHand", True, _MOCAP_FINGERS),
        *_chain("RightShoulder", "RightArm", "RightForeArm", "RightHand", root="Spine1"),
        *_hand("RightHand", "RightHand", True, _MOCAP_FINGERS),
        *_chain("LeftUpLeg", "LeftLeg", "LeftFoot", "LeftToeBase", root="Hips"),
        *_chain("RightUpLeg", "RightLeg", "RightFoot", "RightToeBase", root="Hips"),
        ("LeftFootMod", "LeftFoot"), ("RightFootMod", "RightFoot"),
    ),
    "human36m": (
        *_chain("pelvis", "right_hip", "right_knee", "right_ankle"),
        *_chain("left_hip", "left_knee", "left_ankle", root="pelvis"),
        *_chain("spine", "thorax", "neck", "head", root="pelvis"),
        *_chain("left_shoulder", "left_elbow", "left_wrist", root="thorax"),
        *_chain("right_shoulder", "right_elbow", "right_wrist", root="thorax"),
    ),
    "coco": (
        ("nose", ""), ("left_eye", "nose"), ("right_eye", "nose"), ("left_ear", "left_eye"), ("right_ear", "right_eye"),
        ("left_shoulder", ""), ("right_shoulder", "left_shoulder"), ("left_elbow", "left_shoulder"),
        ("right_elbow", "right_shoulder"), ("left_wrist", "left_elbow"), ("right_wrist", "right_elbow"),
        ("left_hip", ""), ("right_hip", "left_hip"), ("left_knee", "left_hip"), ("right_knee", "right_hip"),
        ("left_ankle", "left_knee"), ("right_ankle", "right_knee"),
    ),
}  # fmt: skip
#: Share of names that must be those of a layout for its parents to hold
KNOWN = 0.8


def best_layout(points: Array) -> str:
    """The layout with as many joints whose bones change their lengths least; "" where none has as many.

    Of two that differ in left and right alone it is the one whose person is no mirror image.
    """
    fitting = [name for name, layout in LAYOUTS.items() if len(layout) == points.shape[1]]

    def cost(name: str) -> tuple[float, bool]:
        return round(_stretch(points, parents_of(LAYOUTS[name])), 6), _is_mirrored(LAYOUTS[name], points)

    return min(fitting, key=cost, default="")


def _is_mirrored(layout: Layout, points: Array) -> bool:
    """Whether a person's left is to the right of where the toes point, with the head up."""
    names = [name for name, _ in layout]
    frames = points[:: max(1, len(points) // 200)]

    def middle(part: str, side: str = "") -> Array:
        return np.asarray(frames[:, numbers_of(names, part, side)].mean(axis=1))

    if not all(numbers_of(names, part) for part in ("hip", "toe", "ankle", "head")):
        return False
    across = middle("hip", "left") - middle("hip", "right")
    ahead, up = middle("toe") - middle("ankle"), middle("head") - middle("ankle")
    return bool(np.nanmean(np.sum(np.cross(ahead, across) * up, axis=1)) < 0.0)


def parents_of(layout: Layout) -> list[int]:
    """Numbers of the parents, -1 at roots."""
    names = [name for name, _ in layout]
    return [names.index(parent) if parent else -1 for _, parent in layout]


def parents_by_name(names: Sequence[str]) -> list[int]:
    """Numbers of the parents of joints whose names a layout has; all -1 where no layout has most of them."""
    plain = [_plain(name) for name in names]
    best: list[int] = [-1] * len(names)
    most = KNOWN * len(names)
    for layout in LAYOUTS.values():
        parents = {_plain(name): _plain(parent) for name, parent in layout}
        shared = sum(name in parents for name in plain)
        if shared >= most:
            best, most = [_first_there(name, parents, plain) for name in plain], shared + 1
    return best


def _plain(name: str) -> str:
    return "".join(letter for letter in name.rpartition(":")[2].lower() if letter.isalnum())


def _first_there(name: str, parents: dict[str, str], there: Sequence[str]) -> int:
    """The nearest ancestor that is there."""
    name = parents.get(name, "")
    while name and name not in there:
        name = parents.get(name, "")
    return there.index(name) if name else -1


def _stretch(points: Array, parents: list[int]) -> float:
    """Mean change of the lengths of bones, as a share of the body's size."""
    frames = points[:: max(1, len(points) // 200)]
    bones = [(joint, parent) for joint, parent in enumerate(parents) if parent >= 0]
    lengths = np.stack([np.linalg.norm(frames[:, a] - frames[:, b], axis=1) for a, b in bones], axis=1)
    spread = np.nanmean(np.nanstd(lengths, axis=0)) + 1e-3 * np.nanmean(lengths)
    return float(spread / max(float(np.nanmax(lengths)), 1e-9))
