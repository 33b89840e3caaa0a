"""Joints of a person from markers on the skin, and from key points that hang together nowhere."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from wbc.retarget.clip import Array, Marks
from wbc.retarget.words import numbers_of

#: Chains of a side, behind the joint of the trunk that carries them
CHAINS = {"pelvis": ("hip", "knee", "ankle", "toe"), "chest": ("shoulder", "elbow", "wrist", "hand")}
#: From the front corner of the pelvis to the hip: backwards, to the middle and down, as shares of the corners' distance
#: (Bell, Pedersen and Brand, Journal of Biomechanics 23, 1990)
HIP = (0.19, 0.14, 0.30)


def joints_of(names: Sequence[str]) -> dict[str, tuple[str, list[int]]]:
    """Joint -> its parent, and numbers of the markers in whose middle it is; {} where a limb lacks one of its three."""
    out: dict[str, tuple[str, list[int]]] = {"pelvis": ("", []), "chest": ("pelvis", []), "head": ("chest", [])}
    out["head"][1].extend(numbers_of(names, "head"))
    for (trunk, chain), (side, sign) in itertools.product(CHAINS.items(), (("left", 1), ("right", -1))):
        parent = trunk
        for part in chain:
            if numbers := numbers_of(names, part, sign):
                out[f"{side}_{part}"] = parent, numbers
                parent = f"{side}_{part}"
            elif part != chain[3]:
                return {}
        out[trunk][1].extend(out[f"{side}_{chain[0]}"][1])
    return {joint: row for joint, row in out.items() if row[1]}


def joined(names: Sequence[str], points: Array, seen: Marks) -> tuple[list[str], list[int], Array, Marks] | None:
    """Names, parents, points and whether these were seen, of the joints of markers; None where they are no person's."""
    joints = joints_of(names)
    if not joints:
        return None
    places = np.stack([points[:, numbers].mean(axis=1) for _, numbers in joints.values()], axis=1)
    there = np.stack([seen[:, numbers].all(axis=1) for _, numbers in joints.values()], axis=1)
    order = list(joints)
    corners = [numbers_of(names, part, sign) for part in ("asis", "psis") for sign in (1, -1)]
    if all(corners):
        left, right, *back = (points[:, numbers].mean(axis=1) for numbers in corners)
        width = np.linalg.norm(left - right, axis=1, keepdims=True)
        across = (left - right) / width
        behind = 0.5 * (back[0] + back[1] - left - right)
        behind -= np.sum(behind * across, axis=1, keepdims=True) * across
        behind /= np.linalg.norm(behind, axis=1, keepdims=True)
        away = HIP[0] * behind - HIP[2] * np.cross(across, behind)
        places[:, order.index("left_hip")] = left + width * (away - HIP[1] * across)
        places[:, order.index("right_hip")] = right + width * (away + HIP[1] * across)
        places[:, order.index("pelvis")] = places[:, [order.index(f"{side}_hip") for side in ("left", "right")]].mean(1)
    return order, [order.index(parent) if parent else -1 for parent, _ in joints.values()], places, there
