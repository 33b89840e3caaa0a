"""When feet and hands of a clip stand on something: slow, and not in the air, with hysteresis."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from wbc.retarget.clip import Array, Marks, intervals

#: A foot comes to stand below this speed, of a leg of 1 m [m/s]
SLOW = 0.25
#: It goes off above this one [m/s]
FAST = 0.45
#: Standard deviation of the Gaussian that positions are smoothed with before they are differentiated [s]
SMOOTH = 0.02
#: A stance is no shorter than this [s]
SHORTEST = 0.08
#: Nor is a swing shorter than this [s]
GAP = 0.06
#: A foot stands no higher than this above the lowest of all limbs at some time of its stance, of a leg of 1 m [m]
LEVEL = 0.06
#: A hand or knee stands no higher than this above the ground, of a leg of 1 m [m]
HAND_HEIGHT = 0.12


@dataclass(frozen=True)
class Stances:
    """What stands when: limb -> whether it stands [frames], and height of its ankle where it stands lowest [m]."""

    marks: dict[str, Marks]
    ankle: dict[str, float]


def smoothed(values: Array, deviation: float) -> Array:
    """Values [frames, ...] under a Gaussian of this standard deviation in frames."""
    if deviation < 0.3 or len(values) < 2:
        return values
    from scipy.ndimage import gaussian_filter1d

    return np.asarray(gaussian_filter1d(values, deviation, axis=0, mode="nearest"))


def speeds(points: Array, rate: float) -> Array:
    """Speed of each point over time, of smoothed positions [frames, points] [m/s]."""
    if len(points) < 2:
        return np.zeros(points.shape[:2])
    return np.asarray(np.linalg.norm(np.gradient(smoothed(points, SMOOTH * rate), axis=0), axis=-1) * rate)


def with_hysteresis(speed: Array, slow: float, fast: float) -> Marks:
    """True from where a speed falls below ``slow`` until it rises above ``fast``."""
    marks = np.zeros(len(speed), dtype=bool)
    for start, end in intervals(speed < fast):
        if (speed[start:end] < slow).any():
            marks[start:end] = True
    return marks


def find_stances(feet: Mapping[str, Array], hands: Mapping[str, Array], rate: float, leg: float) -> Stances:
    """Stances of feet and hands.

    A foot stands where it is slow in all its points and, at some time of its stance, the lowest of all feet or near it:
    so steps of stairs count and a foot that is held in the air does not. A hand stands near the height of the feet.

    Args:
        feet, hands: limb -> its ankle and toe [frames, points, 3] [m]. rate: [Hz]. leg: its length, the measure of
            speeds and heights [m].
    """
    heights = {limb: points[..., 2].min(axis=1) for limb, points in (*feet.items(), *hands.items())}
    marks = {limb: _candidates(points, rate, leg) for limb, points in (*feet.items(), *hands.items())}
    lowest = np.min([heights[limb] for limb in feet], axis=0) if feet else np.zeros(0)
    for limb in feet:
        for start, end in intervals(marks[limb]):
            near = heights[limb][start:end] < lowest[start:end] + LEVEL * leg
            marks[limb][start:end] = bool(near.any())
    ground = min((float(heights[limb][marks[limb]].min()) for limb in feet if marks[limb].any()), default=0.0)
    for limb in hands:
        for start, end in intervals(marks[limb]):
            marks[limb][start:end] = bool(np.median(heights[limb][start:end]) < ground + HAND_HEIGHT * leg)
    ankles = {limb: points[:, 0, 2] for limb, points in (*feet.items(), *hands.items())}
    return Stances(marks, {limb: _standing(ankle, marks[limb]) for limb, ankle in ankles.items()})


def _candidates(points: Array, rate: float, leg: float) -> Marks:
    speed = speeds(points, rate).max(axis=1)
    marks = with_hysteresis(speed, SLOW * leg, FAST * leg)
    for start, end in intervals(~marks):
        if end - start < GAP * rate and start > 0 and end < len(marks):
            marks[start:end] = True
    for start, end in intervals(marks):
        if end - start < SHORTEST * rate:
            marks[start:end] = False
    return marks


def _standing(heights: Array, marks: Marks) -> float:
    """Height of a standing ankle on the lowest level that it stands on."""
    if not marks.any():
        return float(heights.min(initial=0.0))
    means = np.array([(np.median(heights[a:b]), b - a) for a, b in intervals(marks)])
    low = means[means[:, 0] < means[:, 0].min() + 0.04]
    return float(np.average(low[:, 0], weights=low[:, 1]))
