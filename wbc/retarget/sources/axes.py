"""Which axis of a file is up, whether it is mirrored, and how long its unit is."""

from __future__ import annotations

import contextlib
import itertools
from functools import cached_property

import numpy as np

from wbc.errors import RangeError
from wbc.retarget.body import BodyError, find_body
from wbc.retarget.clip import Array, Skeleton, ancestors
from wbc.retarget.hands import find_hand
from wbc.retarget.sources.layouts import to_the_left
from wbc.retarget.sources.recorded import Recorded
from wbc.retarget.words import numbers_of

#: Axis that is up -> rotation of the file's axes to z up
TO_Z_UP: dict[str, Array] = {
    "z": np.eye(3),
    "y": np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
    "x": np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]),
    "-z": np.diag([1.0, -1.0, -1.0]),
    "-y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]),
    "-x": np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]),
}
#: Units of length: [m], whole names, and a person's length from head to feet along the bones in them, from and to
UNITS = {
    "m": (1.0, "metres", (0.6, 4.0)), "ft": (0.3048, "feet", (4.0, 9.0)),
    "cmu": (0.0254 / 0.45, "units of 56.4 mm, as of CMU's clips", (15.0, 42.0)),
    "in": (0.0254, "inches", (42.0, 92.0)), "cm": (0.01, "centimetres", (92.0, 420.0)),
    "mm": (0.001, "millimetres", (420.0, 4200.0)),
}  # fmt: skip
#: A person stands up to this share of that length, in a frame or in the rest pose
UPRIGHT = 0.75
#: Size of what is no person who stands [m]: a dog, a person who crawls
OTHER_SIZE = 0.8
#: Size of a hand [m]
HAND_SIZE = 0.18
#: Cost of an axis along which the head is not above the feet
NOT_ABOVE = 0.7
#: Which of two axes whose costs are closer than this is up is not sure
UNSURE = 0.1
#: Time over which what stands is measured [s]
STANDING_TIME = 0.1
#: What moves less than this share of the body's size a second stands [1/s]
STANDING_SPEED = 0.12


class FileAxes:
    """What the points of a clip without gaps say of its file's axes and unit."""

    def __init__(self, clip: Recorded) -> None:
        self.clip, skeleton = clip, None
        if clip.offsets is not None:
            skeleton = Skeleton(tuple(clip.names), tuple(clip.parents), clip.offsets, tuple(clip.ends))
        spans = np.nanmax(clip.points, axis=1) - np.nanmin(clip.points, axis=1)
        self.size = float(np.nanmedian(np.linalg.norm(spans, axis=1)))
        self.rest = None if skeleton is None else skeleton.rest
        #: numbers of points of head and feet, by name, else by the limbs of the rest pose
        self._head, self._feet = numbers_of(clip.names, "head"), numbers_of(clip.names, "foot")
        if skeleton is not None and not (self._head and self._feet):
            with contextlib.suppress(BodyError):
                plan = find_body(skeleton)
                legs = [chain[-1] for name, chain in plan.limbs.items() if name.endswith("leg")]
                self._head, self._feet = self._head or list(plan.head[-1:]), self._feet or legs

    @cached_property
    def rest_up(self) -> str:
        """The axis of the rest pose along which the head is above the feet; "" where that is not clear."""
        if self.rest is None or not self._head or not self._feet:
            return ""
        between = self.rest[self._head].mean(axis=0) - self.rest[self._feet].mean(axis=0)
        best = max(TO_Z_UP, key=lambda name: float(TO_Z_UP[name][2] @ between))
        return best if float(TO_Z_UP[best][2] @ between) > 0.9 * float(np.linalg.norm(between)) > 0.0 else ""

    def find_up(self) -> str:
        """The axis of the file that is up; a note says it where it is not z, or not sure.

        Each axis has a cost: how far what stands still is spread along it and lies above the lowest points, as shares
        of the body's size, and how far the head is from being above the feet.
        """
        clip, points, size = self.clip, self.clip.points, self.size or 1.0
        above = np.zeros(3)
        if self._head and self._feet:
            head, feet = (np.nanmean(points[:, numbers], axis=1) for numbers in (self._head, self._feet))
            above = np.nanmean(head - feet, axis=0)
            above = above / max(float(np.linalg.norm(above)), 1e-9)
        # Places of feet, or of all points where no feet are known, while they stand still
        low = points[:, self._feet or list(range(len(clip.names)))]
        lag = max(1, min(len(low) - 1, round(STANDING_TIME * clip.rate)))
        standing = low[:-lag][np.linalg.norm(low[lag:] - low[:-lag], axis=2) * clip.rate / lag < STANDING_SPEED * size]
        costs = dict[str, float]()
        for name, to_world in TO_Z_UP.items():
            up = to_world[2]
            cost = NOT_ABOVE * (1.0 - float(above @ up))
            if len(standing):
                here = standing @ up
                cost += (float(np.std(here)) + float(np.mean(here) - np.nanpercentile(points @ up, 2.0))) / size
            costs[name] = cost
        best, second = sorted(costs, key=lambda name: costs[name])[:2]
        doubt = "" if costs[second] - costs[best] > UNSURE else ", which is not sure: give up= where that is wrong"
        clip.notes += [f"{best} is up in the file{doubt}"] if best != "z" or doubt else []
        return best

    def is_mirrored(self, up: str) -> bool:
        """Whether left and right are the wrong way round: a file of left-handed axes."""
        lefts = to_the_left(self.clip.names, self.clip.points, TO_Z_UP[up][2])
        # In nearly all frames: hips and feet may be across each other for a moment
        return bool(lefts.size and np.mean(lefts < 0.0) > 0.9)

    def find_unit(self, up: str) -> float:
        """Length of the file's unit [m], that of a body's size; a note says it where it is not a metre."""
        heights, along, size = self.clip.points @ TO_Z_UP[up][2], self._head_to_feet(), self.size
        tall = float(np.nanmax(np.nanmax(heights, axis=1) - np.nanmin(heights, axis=1)))
        if self.rest is not None and self.rest_up:
            tall = max(tall, float(np.ptp(self.rest @ TO_Z_UP[self.rest_up][2])))
        if along and tall > UPRIGHT * along:
            size = along
            name = next((name for name, (_, _, (low, high)) in UNITS.items() if low <= along < high), "")
        else:
            expected = HAND_SIZE if self._is_hand() else OTHER_SIZE
            sizes = {name: size * UNITS[name][0] / expected for name in ("m", "cm", "mm")}
            name = min(sizes, key=lambda unit: abs(np.log(max(sizes[unit], 1e-12))))
            name = name if 0.1 < sizes[name] < 10.0 else ""
        if not name:
            raise RangeError(
                "unit", size, "the body's size in the file fits no unit; give unit= of m, cm, mm, in or ft"
            )
        length, whole_name, _ = UNITS[name]
        self.clip.notes += [f"its unit is {whole_name}: the body is {size:.4g} of them"] if name != "m" else []
        return length

    def _is_hand(self) -> bool:
        """Whether every branch of the skeleton is a finger of one palm."""
        names, parents, places = self.clip.names, self.clip.parents, self.clip.points[len(self.clip.points) // 2]
        if parents.count(-1) != 1 or (self._head and self._feet):
            return False
        offsets = places - np.where(np.array(parents)[:, None] < 0, 0.0, places[parents])
        with contextlib.suppress(BodyError):
            hand = find_hand(Skeleton(tuple(names), tuple(parents), offsets, (False,) * len(names)))
            return {chain[-1] for chain in hand.limbs.values()} == {*range(len(names))} - {*parents}
        return False

    def _head_to_feet(self) -> float:
        """Length of bones from head to foot, or how far these are apart without bones; 0 where they are not known."""
        points, parents, longest = self.clip.points, self.clip.parents, 0.0
        for head, foot in itertools.product(self._head, self._feet):
            above, below = set(ancestors(parents, head)), set(ancestors(parents, foot))
            bones = [points[:, k] - points[:, parents[k]] for k in above ^ below] if above & below else []
            apart = sum(float(np.nanmedian(np.linalg.norm(bone, axis=1))) for bone in bones)
            between = np.linalg.norm(points[:, head] - points[:, foot], axis=1)
            longest = max(longest, apart if bones else float(np.nanmax(between)))
        return longest
