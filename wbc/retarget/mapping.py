"""Where a robot's pelvis, chest, knees, elbows, feet and hands should be as a skeleton's points say, by frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.retarget.body import SHORT
from wbc.retarget.clip import Array
from wbc.retarget.correspondence import Correspondence, LimbMatch


@dataclass(frozen=True)
class LimbPlaces:
    """Targets of a limb.

    Attributes:
        middle, wrist, end: positions of knee, ankle and contact frame, or elbow, wrist and hand [frames, 3] [m].
        rotation: of the foot's or hand's frame [frames, 3, 3]; None where the skeleton does not say it.
    """

    middle: Array
    wrist: Array
    end: Array
    rotation: Array | None


@dataclass(frozen=True)
class Places:
    """Targets of a body, in the world of the robot: metres of the robot, the ground at z = 0.

    Attributes:
        pelvis: position of the middle of the hips [frames, 3] [m]. turn: of pelvis [frames, 3, 3].
        chest, head: turns; None where no frame follows them. limbs: by the robot's limbs.
    """

    pelvis: Array
    turn: Array
    chest: Array
    head: Array | None
    limbs: dict[str, LimbPlaces]


def normalised(vectors: Array, fallback: Array) -> Array:
    """Unit vectors; where one has no length, the fallback."""
    sizes = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(np.where(sizes > SHORT, vectors / np.maximum(sizes, 1e-12), fallback))


def frames_of(first: Array, second: Array) -> Array:
    """Rotations whose y axis is along ``first`` and whose z axis is nearest to ``second`` [frames, 3, 3]."""
    y = normalised(first, np.array([0.0, 1.0, 0.0]))
    across = np.cross(y, second)
    x = normalised(across, np.cross(y, np.array([0.0, 0.0, 1.0])))
    x = normalised(x, np.array([1.0, 0.0, 0.0]))
    return np.stack([x, y, np.cross(x, y)], axis=-1)


class Mapper:
    """Turns points of a skeleton into targets of a robot; the same for a clip and for one frame."""

    def __init__(self, match: Correspondence) -> None:
        self.match = match
        body, rest = match.body, match.rest
        self._scale, self._axes = match.scale, match.axes
        #: points of left and right hip, of shoulders where the skeleton has no legs
        self._hips = self._pair("leg") or self._pair("arm") or self._alone()
        self._shoulders = self._pair("arm") if "left_arm" in match.limbs and body.plan.upright else None
        self._trunk = self._trunk_frames(rest[None])
        hips = rest[list(self._hips)].mean(axis=0)
        axes = body.axes
        #: hip or shoulder of each robot's limb from the pelvis, or from the waist, in the body's axes [m]
        self._bases, self._from_chest = {}, {}
        for name, limb in body.limbs.items():
            self._from_chest[name] = body.plan.upright and name.endswith("arm")
            start = body.places[0] if not self._from_chest[name] or body.waist is None else body.waist
            self._bases[name] = (limb.base - start) @ axes
        self._waist = np.zeros(3) if body.waist is None else (body.waist - body.places[0]) @ axes
        #: from where the skeleton's foot would be to where the robot's is, both at rest, in the body's axes [m]
        self._shifts = {name: self._shift(name, limb, hips) for name, limb in match.limbs.items()}
        #: of the trunk of a person on all fours, whose rest stands upright
        self._lying = np.eye(3)
        if match.all_fours and match.upright and not body.plan.upright:
            self._lying = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
        self._rest = rest
        #: directions of each limb's bones at rest, where a bone has no length [3, 3]
        self._still = {}
        #: of the robot's limbs: base to middle, middle to wrist, wrist to contact [m]
        self._lengths = {}
        #: heights of the robot's ankles, or of the centres of point feet, above the ground that they stand on [m]
        self._heights = {}
        for name, limb in body.limbs.items():
            over = float((limb.places[2] - limb.places[3]) @ body.axes[:, 2])
            self._heights[name] = limb.radius + over * (limb.contact == "flat")
        for name, one in match.limbs.items():
            bones = np.diff(rest[[one.base, one.middle, one.end, one.tip]], axis=0)
            self._still[name] = bones / np.maximum(np.linalg.norm(bones, axis=1, keepdims=True), 1e-9)
            places = body.limbs[name].places
            self._lengths[name] = np.linalg.norm(np.diff(places, axis=0), axis=1)

    def _shift(self, name: str, limb: LimbMatch, hips: Array) -> Array:
        body, rest = self.match.body, self.match.rest
        foot = (body.limbs[name].places[2] - body.places[0]) @ body.axes
        if body.plan.upright:
            foot[0] = ((body.limbs[name].base - body.places[0]) @ body.axes)[0]
        end = np.array((rest[limb.end] - hips) @ self.match.axes)
        if body.plan.upright:
            end[0] = ((rest[limb.base] - hips) @ self.match.axes)[0]
        return np.asarray(foot - self._scale * end)

    def _alone(self) -> tuple[int, int]:
        """The first points of any two limbs."""
        bases = [limb.base for limb in self.match.limbs.values()]
        return bases[0], bases[-1]

    def _pair(self, kind: str) -> tuple[int, int] | None:
        """Hips or shoulders of the skeleton."""
        found = {m.source: m.base for m in self.match.limbs.values()}
        left, right = found.get(f"left_{kind}"), found.get(f"right_{kind}")
        return None if left is None or right is None else (left, right)

    def _trunk_frames(self, points: Array) -> tuple[Array, Array]:
        """Rotations of pelvis and chest as the points show them [frames, 3, 3]."""
        left, right = (points[:, k] for k in self._hips)
        middle = 0.5 * (left + right)
        top = points[:, self.match.chest]
        if self._shoulders is not None:
            top = 0.5 * (points[:, self._shoulders[0]] + points[:, self._shoulders[1]])
        across = frames_of(left - right, top - middle)
        if self._shoulders is None:
            return across, across
        return across, frames_of(points[:, self._shoulders[0]] - points[:, self._shoulders[1]], top - middle)

    def places(self, points: Array, turns: Array | None, ankle: dict[str, float]) -> Places:
        """Targets of frames.

        Args:
            points: [frames, joints, 3] [m]. turns: [frames, joints, 3, 3]. ankle: height above the clip's zero at which
                each leading limb's end stands [m].
        """
        match, body, scale = self.match, self.match.body, self._scale
        axes = match.axes
        if turns is not None:
            pelvis, chest = turns[:, match.pelvis] @ axes, turns[:, match.chest] @ axes
        else:
            pelvis, chest = (
                now @ before[0].T @ axes for now, before in zip(self._trunk_frames(points), self._trunk, strict=True)
            )
        pelvis, chest = pelvis @ self._lying, chest @ self._lying
        hips = 0.5 * (points[:, self._hips[0]] + points[:, self._hips[1]])
        if body.robot.base == "fixed":
            # The robot's trunk stands where it stands: arms move as seen from the pelvis
            still = body.axes @ np.swapaxes(pelvis, 1, 2)
            points = (still[:, None] @ (points - hips[:, None])[..., None])[..., 0]
            turns = None if turns is None else still[:, None] @ turns
            pelvis, chest, hips = still @ pelvis, still @ chest, np.zeros_like(hips)
        head = turns[:, match.head] @ axes if turns is not None and match.head >= 0 and body.head else None
        legs = [m for name, m in match.limbs.items() if name.endswith("leg")]
        ground = min((ankle[m.source] for m in legs), default=0.0)
        lift = self._heights.get("left_leg", 0.0)
        place = scale * (hips - np.array([0.0, 0.0, ground])) + np.array([0.0, 0.0, lift])
        heading = _headings(pelvis)
        if body.robot.base == "fixed":
            place = np.broadcast_to(body.places[0], hips.shape).copy()
        limbs = {
            name: self._limb(name, (points, turns), place, (pelvis, chest, heading), ankle) for name in match.limbs
        }
        return Places(place, pelvis, chest, head, limbs)

    def _limb(
        self,
        name: str,
        seen: tuple[Array, Array | None],
        place: Array,
        trunk: tuple[Array, Array, Array],
        ankle: dict[str, float],
    ) -> LimbPlaces:
        """Targets of a limb, of points and turns as seen, from the place and the turns of the trunk."""
        match, (points, turns) = self.match.limbs[name], seen
        limb = self.match.body.limbs[name]
        pelvis, chest, heading = trunk
        chain = points[:, [match.base, match.middle, match.end, match.tip]]
        bones = normalised(chain[:, 1:] - chain[:, :-1], self._still[name])
        if match.tip == match.end:
            bones[:, 2] = bones[:, 1]
        if self._from_chest[name]:
            base = place + pelvis @ self._waist + chest @ self._bases[name]
        else:
            base = place + pelvis @ self._bases[name]
        upper, lower, hand = self._lengths[name]
        middle = base + upper * bones[:, 0]
        rotation = self._rotation(match, points, turns, pelvis, limb.contact == "flat")
        if self.match.body.is_foot(name):
            end = points[:, match.end]
            shift = self._shifts[name]
            height = self._heights[name]
            wrist = self._scale * (end - np.array([0.0, 0.0, ankle[match.source]])) + np.array([0.0, 0.0, height])
            wrist[:, :2] += (heading @ shift)[:, :2]
            if limb.contact == "flat":
                down = np.array([0.0, 0.0, -height])
                return LimbPlaces(middle, wrist, wrist + (down if rotation is None else rotation @ down), rotation)
            return LimbPlaces(middle, wrist, wrist, None)
        wrist = middle + lower * bones[:, 1]
        return LimbPlaces(middle, wrist, wrist + hand * bones[:, 2], rotation if turns is not None else None)

    def _rotation(
        self, match: LimbMatch, points: Array, turns: Array | None, pelvis: Array, foot: bool
    ) -> Array | None:
        """Of the foot or hand, in the body's axes at rest."""
        axes, rest = self.match.axes, self._rest
        if turns is not None:
            return np.asarray(turns[:, match.end] @ axes)
        if not foot:
            return None
        if match.tip == match.end:
            return _headings(pelvis)
        # Along the foot, as far as its rest is turned from there; the hips say where its side is
        forward = rest[match.tip] - rest[match.end]
        before = frames_of(axes[:, 1][None], np.cross(forward, axes[:, 1])[None])[0]
        ahead = points[:, match.tip] - points[:, match.end]
        side = (
            pelvis[:, :, 1]
            - ahead * (np.sum(pelvis[:, :, 1] * ahead, axis=1) / np.maximum(np.sum(ahead**2, axis=1), 1e-12))[:, None]
        )
        return np.asarray(frames_of(side, np.cross(ahead, side)) @ before.T @ axes)


def _headings(rotations: Array) -> Array:
    """The turns about the vertical that are nearest to rotations of a body whose x axis is forward [frames, 3, 3]."""
    forward = rotations[:, :, 0].copy()
    steep = np.abs(forward[:, 2]) > 0.9
    # Of a body that lies the direction of its front or back says where it heads
    forward[steep] = -np.sign(forward[steep, 2])[:, None] * rotations[steep, :, 2]
    forward[:, 2] = 0.0
    x = normalised(forward, np.array([1.0, 0.0, 0.0]))
    z = np.broadcast_to(np.array([0.0, 0.0, 1.0]), x.shape)
    return np.stack([x, np.cross(z, x), z], axis=-1)
