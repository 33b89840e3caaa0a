"""Joints of well-known skeletons, in the order in which files of plain numbers have them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from wbc.retarget.clip import Array, nearest_above
from wbc.retarget.words import numbers_of

#: Share of names that must be those of a layout for its parents to hold
KNOWN = 0.8


class JointOrder(NamedTuple):
    """Names of joints, and numbers of their parents, -1 at roots."""

    names: tuple[str, ...]
    parents: list[int]


#: SMPL's joints
_BODY = (
    "pelvis, pelvis > left_hip, pelvis > right_hip, pelvis > spine1, left_hip > left_knee, right_hip > right_knee",
    "spine1 > spine2, left_knee > left_ankle, right_knee > right_ankle, spine2 > spine3, left_ankle > left_foot",
    "right_ankle > right_foot, spine3 > neck, spine3 > left_collar, spine3 > right_collar, neck > head",
    "left_collar > left_shoulder, right_collar > right_shoulder, left_shoulder > left_elbow",
    "right_shoulder > right_elbow, left_elbow > left_wrist, right_elbow > right_wrist",
)
#: Branches of LAFAN1's skeleton
_LEG = "Hips > {0}UpLeg {0}Leg {0}Foot {0}ToeBase"
_ARM = "{1} > {0}Shoulder {0}Arm {0}ForeArm {0}Hand"
_SPINE = "Hips > Spine Spine1 Spine2 Neck Head"
#: Fingers of a hand as SMPL-H and SMPL-X have them
_FINGERS = "index middle pinky ring thumb"


def _tree(*branches: str) -> JointOrder:
    """Of branches between commas, each of a parent, ``>``, and joints one below the other; the first one has none."""
    names, parents = list[str](), list[int]()
    for branch in ", ".join(branches).split(", "):
        above, _, chain = branch.rpartition(" > ")
        for name in chain.split():
            parents.append(names.index(above) if above else -1)
            names.append(name)
            above = name
    return JointOrder(tuple(names), parents)


def _hand(wrist: str, side: str, fingers: str = _FINGERS) -> str:
    """Three joints of each finger, one after the other."""
    return ", ".join(f"{wrist} > {side}{name}1 {side}{name}2 {side}{name}3" for name in fingers.split())


_HANDS = (_hand("left_wrist", "left_"), _hand("right_wrist", "right_"))
_LEGS = {side: _LEG.format(side) for side in ("Left", "Right")}
#: Well-known orders, by name
LAYOUTS = {
    "smpl-body": _tree(*_BODY),
    "smpl": _tree(*_BODY, "left_wrist > left_hand, right_wrist > right_hand"),
    "smplh": _tree(*_BODY, *_HANDS),
    "smplx": _tree(*_BODY, "head > jaw, head > left_eye, head > right_eye", *_HANDS),
    # MuJoCo's order of SMPL-H, as of PHC and InterMimic
    "smplh-mujoco": _tree(
        "Pelvis L_Hip L_Knee L_Ankle L_Toe, Pelvis > R_Hip R_Knee R_Ankle R_Toe",
        "Pelvis > Torso Spine Chest Neck Head, Chest > L_Thorax L_Shoulder L_Elbow L_Wrist",
        _hand("L_Wrist", "L_", _FINGERS.title()), "Chest > R_Thorax R_Shoulder R_Elbow R_Wrist",
        _hand("R_Wrist", "R_", _FINGERS.title()),
    ),
    "lafan": _tree(
        "Hips", _LEGS["Right"], _LEGS["Left"], _SPINE, _ARM.format("Right", "Spine2"), _ARM.format("Left", "Spine2")
    ),
    "lafan-left": _tree(
        "Hips", _LEGS["Left"].replace("Base", ""), _LEGS["Right"].replace("Base", ""), _SPINE,
        _ARM.format("Left", "Spine2"), _ARM.format("Right", "Spine2"),
    ),
    "mocap": _tree(
        "Hips Spine Spine1 Neck Head", _ARM.format("Left", "Spine1"),
        _hand("LeftHand", "LeftHand", "Thumb Index Middle Ring Pinky"), _ARM.format("Right", "Spine1"),
        _hand("RightHand", "RightHand", "Thumb Index Middle Ring Pinky"), _LEGS["Left"], _LEGS["Right"],
        "LeftFoot > LeftFootMod, RightFoot > RightFootMod",
    ),
    # MediaPipe's order of a hand, and MANO's with and without tips
    "mediapipe-hand": _tree(
        "wrist, wrist > thumb_cmc thumb_mcp thumb_ip thumb_tip",
        *(f"wrist > {name}_mcp {name}_pip {name}_dip {name}_tip" for name in ("index", "middle", "ring", "pinky")),
    ),
    "mano": _tree("wrist", _hand("wrist", "")),
    "mano-tips": _tree(
        "wrist", _hand("wrist", ""), "thumb3 > thumb_tip, index3 > index_tip, middle3 > middle_tip",
        "ring3 > ring_tip, pinky3 > pinky_tip",
    ),
    "human36m": _tree(
        "pelvis right_hip right_knee right_ankle, pelvis > left_hip left_knee left_ankle",
        "pelvis > spine thorax neck head, thorax > left_shoulder left_elbow left_wrist",
        "thorax > right_shoulder right_elbow right_wrist",
    ),
    "coco": _tree(
        "nose, nose > left_eye, nose > right_eye, left_eye > left_ear, right_eye > right_ear, left_shoulder",
        "left_shoulder > right_shoulder, left_shoulder > left_elbow, right_shoulder > right_elbow",
        "left_elbow > left_wrist, right_elbow > right_wrist, left_hip, left_hip > right_hip, left_hip > left_knee",
        "right_hip > right_knee, left_knee > left_ankle, right_knee > right_ankle",
    ),
}  # fmt: skip


def best_layout(points: Array) -> str:
    """The layout of as many joints whose bones keep their lengths best, and whose person is no mirror image; or ""."""
    frames = points[:: max(1, len(points) // 200)]

    def cost(name: str) -> tuple[float, bool]:
        names, parents = LAYOUTS[name]
        bones = [(joint, parent) for joint, parent in enumerate(parents) if parent >= 0]
        lengths = np.stack([np.linalg.norm(frames[:, a] - frames[:, b], axis=1) for a, b in bones], axis=1)
        spread = np.nanmean(np.nanstd(lengths, axis=0)) + 1e-3 * np.nanmean(lengths)
        up = [frames[:, numbers].mean(axis=1) for part in ("head", "hindfoot") if (numbers := numbers_of(names, part))]
        lefts = to_the_left(names, frames, up[0] - up[1]) if len(up) == 2 else np.zeros(0)
        mirrored = bool(np.isfinite(lefts).any() and np.nanmean(lefts) < 0.0)
        return round(float(spread / max(float(np.nanmax(lengths)), 1e-9)), 6), mirrored

    return min((name for name in LAYOUTS if len(LAYOUTS[name].names) == points.shape[1]), key=cost, default="")


def to_the_left(names: Sequence[str], points: Array, up: Array) -> Array:
    """How far the left hip is left of the right one as feet point, about up; below 0 in a mirror [frames]; or empty."""
    hips, toes, heels = ([numbers_of(names, part, side) for side in (1, -1)] for part in ("hip", "toe", "hindfoot"))
    heels = [[k for k in own if k not in toe] for own, toe in zip(heels, toes, strict=True)]
    if not all((*hips, *toes, *heels)):
        return np.zeros(0)
    left, right = (points[:, own].mean(axis=1) for own in hips)
    feet = [points[:, toe].mean(axis=1) - points[:, heel].mean(axis=1) for toe, heel in zip(toes, heels, strict=True)]
    return np.asarray(np.sum(np.cross(feet[0] + feet[1], left - right) * up, axis=1))


def parents_by_name(names: Sequence[str]) -> list[int]:
    """Numbers of the parents of joints whose names a layout has; all -1 where no layout has most of them."""
    plain = ["".join(filter(str.isalnum, name.rpartition(":")[2].lower())) for name in names]
    best, most = [-1] * len(names), KNOWN * len(names)
    for layout in LAYOUTS.values():
        # Of joints that are written alike the last one
        known = {"".join(filter(str.isalnum, name.lower())): joint for joint, name in enumerate(layout.names)}
        there = {known[name]: plain.index(name) for name in plain if name in known}
        shared = sum(name in known for name in plain)
        if shared >= most:
            above = [nearest_above(layout.parents, known[name], there) if name in known else -1 for name in plain]
            best, most = [there.get(joint, -1) for joint in above], shared + 1
    return best
