"""Which axis of a file is up, whether it is mirrored, and how long its unit is."""

from __future__ import annotations

import numpy as np

from wbc import validation
from wbc.errors import RangeError
from wbc.retarget.sources.body_words import numbers_of
from wbc.retarget.sources.recorded import Recorded
from wbc.validation import Array

#: Axis that is up -> rotation of the file's axes to z up
TO_Z_UP: dict[str, Array] = {
    "z": np.eye(3),
    "y": np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
    "x": np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]),
    "-z": np.diag([1.0, -1.0, -1.0]),
    "-y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]),
    "-x": np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]),
}
#: Units of length by name [m]
UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048, "cmu": 0.0254 / 0.45}
#: Whole names of units
UNIT_NAMES = {
    "m": "metres", "cm": "centimetres", "mm": "millimetres", "in": "inches", "ft": "feet",
    "cmu": "units of 56.4 mm, as of CMU's clips",
}  # fmt: skip
#: Length of a person from head to feet along the bones, in each unit, from and to
PERSON_SIZES = (
    ("m", 0.6, 4.0), ("ft", 4.0, 9.0), ("cmu", 15.0, 42.0), ("in", 42.0, 92.0), ("cm", 92.0, 420.0),
    ("mm", 420.0, 4200.0),
)  # fmt: skip
#: A person stands up to this share of that length, in a frame or in the rest pose
UPRIGHT = 0.75
#: Size of what is no person who stands [m]: a dog, a person who crawls, a hand
OTHER_SIZE = 0.8
#: Cost of an axis along which the head is not above the feet
NOT_ABOVE = 0.7
#: Cost of an axis that is not the usual one of the format
NOT_USUAL = 0.15
#: Cost of an axis that is not that of the rest pose
NOT_AT_REST = 0.2
#: Axes whose costs are closer than this are told apart only by what is usual
UNSURE = 0.1
#: Time over which what stands is measured [s]
STANDING_TIME = 0.1
#: What moves less than this share of the body's size a second stands [1/s]
STANDING_SPEED = 0.12
#: Frames that are looked at, at most
FRAMES = 600


def sizes(points: Array) -> float:
    """Median over the frames of the diagonal of a box round the points, in the file's unit."""
    box = np.nanmax(points, axis=1) - np.nanmin(points, axis=1)
    return float(np.nanmedian(np.linalg.norm(box, axis=1)))


def find_up(clip: Recorded) -> tuple[str, bool]:
    """The axis of the file that is up, and whether that is sure.

    Each axis has a cost: how far what stands still is spread along it and lies above the lowest points, as shares of
    the body's size, and how far the head is from being above the feet. What is usual in the format decides near ties.
    """
    points = clip.points
    size = sizes(points) or 1.0
    standing = _standing(clip, size)
    head, feet = numbers_of(clip.names, "head"), numbers_of(clip.names, "foot")
    above = np.zeros(3)
    if head and feet:
        between = np.nanmean(points[:, head], axis=1) - np.nanmean(points[:, feet], axis=1)
        above = np.nanmean(between, axis=0)
        above = above / max(float(np.linalg.norm(above)), 1e-9)
    rest = _rest_up(clip)
    costs: dict[str, float] = {}
    for name, to_world in TO_Z_UP.items():
        up = to_world[2]
        heights = points @ up
        cost = NOT_ABOVE * (1.0 - float(above @ up))
        if len(standing):
            here = standing @ up
            cost += (float(np.std(here)) + float(np.mean(here) - np.nanpercentile(heights, 2.0))) / size
        cost += NOT_USUAL * (clip.usual not in ("", name)) + NOT_AT_REST * (rest not in ("", name))
        costs[name] = cost
    best, second = sorted(costs, key=lambda name: costs[name])[:2]
    return best, costs[second] - costs[best] > UNSURE


def _rest_up(clip: Recorded) -> str:
    """The axis of the rest pose along which the head is above the feet; "" where that is not clear."""
    if clip.offsets is None:
        return ""
    places = _rest_places(clip)
    head, feet = numbers_of(clip.names, "head"), numbers_of(clip.names, "foot")
    if not head or not feet:
        return ""
    between = places[head].mean(axis=0) - places[feet].mean(axis=0)
    best = max(TO_Z_UP, key=lambda name: float(TO_Z_UP[name][2] @ between))
    return best if float(TO_Z_UP[best][2] @ between) > 0.9 * float(np.linalg.norm(between)) > 0.0 else ""


def _rest_places(clip: Recorded) -> Array:
    """Joints in the rest pose [joints, 3]."""
    assert clip.offsets is not None
    places = np.zeros_like(clip.offsets)
    for joint, parent in enumerate(clip.parents):
        places[joint] = clip.offsets[joint] + (places[parent] if parent >= 0 else 0.0)
    return places


def rest_up(clip: Recorded, up: str) -> str:
    """The axis that is up in the rest pose: what its head and feet say, else that of the motion."""
    return clip.rest_up or _rest_up(clip) or up


def _standing(clip: Recorded, size: float) -> Array:
    """Places of feet, or of all points where no feet are named, while they stand still [n, 3]."""
    feet = numbers_of(clip.names, "foot") or list(range(len(clip.names)))
    points = clip.points[:, feet]
    lag = max(1, min(len(points) - 1, round(STANDING_TIME * clip.rate)))
    every = max(1, len(points) // FRAMES)
    before, after = points[:-lag:every], points[lag::every]
    speed = np.linalg.norm(after - before, axis=2) * clip.rate / lag
    with np.errstate(invalid="ignore"):
        still = speed < STANDING_SPEED * size
    return np.asarray(before[still])


def mirrored(clip: Recorded, points: Array) -> bool:
    """Whether left and right are the wrong way round in points with z up: a file of left-handed axes.

    The hips' line from right to left, and the feet's direction ahead, must be as y and x.
    """
    left, right = (numbers_of(clip.names, "hip", side) for side in ("left", "right"))
    toes = {side: numbers_of(clip.names, "toe", side) for side in ("left", "right")}
    ankles = {
        side: [k for k in numbers_of(clip.names, "ankle", side) if k not in toes[side]] for side in ("left", "right")
    }
    if not left or not right or not all(toes.values()) or not all(ankles.values()):
        return False
    across = (points[:, left].mean(axis=1) - points[:, right].mean(axis=1))[:, :2]
    ahead = sum((points[:, toes[side]].mean(axis=1) - points[:, ankles[side]].mean(axis=1))[:, :2] for side in toes)
    turn = ahead[:, 0] * across[:, 1] - ahead[:, 1] * across[:, 0]
    sizes_of = np.linalg.norm(ahead, axis=1) * np.linalg.norm(across, axis=1)
    good = np.isfinite(turn) & (sizes_of > 0.0)
    # Ahead in nearly all frames: hips and feet may be across each other for a moment
    return bool(good.any() and np.mean(turn[good] < -0.5 * sizes_of[good]) > 0.9)


def find_unit(clip: Recorded, up: str) -> tuple[str, float]:
    """Name of the file's unit, and the size of the body in it.

    Raises:
        RangeError: no unit makes it a body's size.
    """
    size, heights = sizes(clip.points), clip.points @ TO_Z_UP[up][2]
    tall = float(np.nanmax(np.nanmax(heights, axis=1) - np.nanmin(heights, axis=1)))
    along = _head_to_feet(clip)
    if clip.offsets is not None and (rest := _rest_up(clip)):
        tall = max(tall, float(np.ptp(_rest_places(clip) @ TO_Z_UP[rest][2])))
    if along and tall > UPRIGHT * along:
        for name, low, high in PERSON_SIZES:
            if low <= along < high:
                return name, along
    else:
        name = min(("m", "cm", "mm"), key=lambda unit: abs(np.log(max(size, 1e-12) * UNITS[unit] / OTHER_SIZE)))
        if 0.1 < size * UNITS[name] / OTHER_SIZE < 10.0:
            return name, size
    raise RangeError("unit", size, "the body's size in the file fits no unit; give unit= of m, cm, mm, in or ft")


def _head_to_feet(clip: Recorded) -> float:
    """Length of the bones from head to foot, or how far they are apart where bones are not known; 0 without them."""
    heads, feet = numbers_of(clip.names, "head"), numbers_of(clip.names, "foot")
    if not heads or not feet:
        return 0.0
    lengths = [
        float(np.nanmedian(np.linalg.norm(clip.points[:, joint] - clip.points[:, parent], axis=1)))
        if parent >= 0
        else 0.0
        for joint, parent in enumerate(clip.parents)
    ]
    above = [_ancestors(clip.parents, joint) for joint in range(len(clip.parents))]
    longest = 0.0
    for head in heads:
        for foot in feet:
            shared = set(above[head]) & set(above[foot])
            if shared:
                longest = max(longest, sum(lengths[k] for k in {*above[head], *above[foot]} - shared))
            else:
                apart = np.linalg.norm(clip.points[:, head] - clip.points[:, foot], axis=1)
                longest = max(longest, float(np.nanmax(apart)))
    return longest


def _ancestors(parents: list[int], joint: int) -> list[int]:
    """A joint and all above it."""
    out = [joint]
    while parents[out[-1]] >= 0:
        out.append(parents[out[-1]])
    return out


def unit_of(value: str | float) -> float:
    """A unit by name, or as its length [m]."""
    if isinstance(value, str):
        return UNITS[validation.one_of("unit", value, UNITS)]
    return validation.scalar("unit", value, low=1e-6, high=1e3, unit="m")
