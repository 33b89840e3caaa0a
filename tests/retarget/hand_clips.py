"""A hand that closes and opens, and spreads its fingers, while it moves about: its 21 points, made from angles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

#: First knuckle from the wrist, and bones to joints and tip, of a right hand: fingers along x, palm down [m]
FINGERS = {
    "thumb": ((0.03, 0.025, -0.01), (0.045, 0.032, 0.027)), "index": ((0.095, 0.025, 0.0), (0.045, 0.026, 0.022)),
    "middle": ((0.095, 0.0, 0.0), (0.05, 0.03, 0.023)), "ring": ((0.09, -0.022, 0.0), (0.045, 0.028, 0.022)),
    "pinky": ((0.08, -0.042, -0.003), (0.035, 0.02, 0.018)),
}  # fmt: skip


def hand(frames: int = 60, left: bool = False) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points in MediaPipe's order [frames, 21, 3] [m], and angles by which fingers are bent at each joint [frames]."""
    phase = np.linspace(0.0, 2.0 * np.pi, frames)
    bends, points = 0.15 + 0.45 * (1.0 - np.cos(phase)), np.zeros((frames, 21, 3))
    for frame, bend in enumerate(bends):
        for number, (name, (first, bones)) in enumerate(FINGERS.items()):
            place, turn = np.array(first), Rotation.from_euler("z", 0.08 * (2 - number) * np.cos(phase[frame]))
            if name == "thumb":
                turn = Rotation.from_euler("zx", [0.9, -0.9])
            points[frame, 1 + 4 * number] = place
            for k, bone in enumerate(bones):
                turn = turn * Rotation.from_euler("y", bend * (0.4 if name == "thumb" else 1.0))
                place = place + turn.apply([bone, 0.0, 0.0])
                points[frame, 2 + 4 * number + k] = place
    points[:, :, 1] *= -1.0 if left else 1.0
    turns = Rotation.from_euler("zyx", np.stack([phase, 0.4 * np.sin(phase), 0.5 * phase], axis=1))
    moved = np.stack([turn.apply(own) for turn, own in zip(turns, points, strict=True)])
    return moved + np.array([0.3, 0.1, 0.4]) + 0.1 * np.sin(phase)[:, None, None], bends
