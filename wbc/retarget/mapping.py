"""Where a robot's pelvis, chest, knees, elbows, feet and hands should be as a skeleton's points say, by frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from wbc.retarget.body import SHORT
from wbc.retarget.clip import Array
from wbc.retarget.correspondence import Correspondence, LimbMatch

#: From the trunk of a person on all fours, whose rest stands upright, to one that lies
LYING_TRUNK = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
#: What lies on the ground is this high above it or so, where the skeleton is on it or below [m]
CLEAR = 0.006
#: What is higher than so many times this is not raised [1]
FAR_ABOVE = 20.0
#: A bone that stands upright falls ahead where it cannot reach below the ground: share of its length [1]
AHEAD_SHARE = 0.05
#: Of a body whose front is steeper than the angle of this sine its back says where it heads
STEEP = 0.9


@dataclass(frozen=True)
class LimbPlaces:
    """Targets of a limb.

    Attributes:
        base, middle, wrist, end: positions of hip, knee, ankle and contact frame, or shoulder, elbow, wrist and hand
            [frames, 3] [m].
        rotation: of the foot's or hand's frame [frames, 3, 3]; None where the skeleton does not say it.
    """

    base: Array
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
    limbs: Mapping[str, LimbPlaces]

    @cached_property
    def heading(self) -> Array:
        """Turns of the pelvis about the vertical alone [frames, 3, 3]."""
        return _headings(self.turn)


def normalised(vectors: Array, fallback: Array) -> Array:
    """Unit vectors; where one has no length, the fallback."""
    sizes = np.sqrt(np.einsum("...i,...i->...", vectors, vectors))[..., None]
    return np.asarray(np.where(sizes > SHORT, vectors / np.maximum(sizes, 1e-12), fallback))


def frames_of(first: Array, second: Array) -> Array:
    """Rotations whose y axis is along ``first`` and whose z axis is nearest to ``second`` [frames, 3, 3]."""
    y = normalised(first, np.array([0.0, 1.0, 0.0]))
    across = np.cross(y, second)
    x = normalised(across, np.cross(y, np.array([0.0, 0.0, 1.0])))
    x = normalised(x, np.array([1.0, 0.0, 0.0]))
    return np.stack([x, y, np.cross(x, y)], axis=-1)


def lift(heights: Array) -> Array:
    """By how much what has these heights must be higher so that it is clear of the ground; smooth in the height [m]."""
    return np.asarray(0.5 * (np.sqrt((heights - CLEAR) ** 2 + CLEAR**2) - (heights - CLEAR)))


class Mapper:
    """Turns points of a skeleton into targets of a robot; the same for a clip and for one frame."""

    def __init__(self, match: Correspondence) -> None:
        self.match = match
        body, rest, axes = match.body, match.skeleton.rest, match.body.axes
        bases = {limb.source: limb.base for limb in match.limbs.values()}
        legs, arms = ([bases[k] for k in (f"left_{kind}", f"right_{kind}") if k in bases] for kind in ("leg", "arm"))
        both = [pair for pair in (legs, arms, list(bases.values())) if len(pair) > 1] or [list(bases.values()) * 2]
        #: points of left and right hip, of shoulders where the skeleton has no legs; and of shoulders that lead arms
        self._hips = [both[0][0], both[0][-1]]
        leads = "left_arm" in match.limbs and body.plan.upright and len(arms) > 1
        self._shoulders = arms if leads else self._hips
        #: what is above the hips
        self._top = arms if leads else [match.chest]
        self._trunk = self._trunk_frames(rest[None])
        #: knees, elbows and wrists follow the skeleton and may meet the ground
        self._lies = body.plan.upright and body.robot.base != "fixed"
        hips = rest[self._hips].mean(axis=0)
        waist = body.places[0] if body.waist is None else body.waist
        #: from the pelvis to the waist, in the body's axes [m]
        self._waist = (waist - body.places[0]) @ axes
        #: hip or shoulder of each robot's limb from the pelvis, or from the waist, in the body's axes [m]
        self._bases: dict[str, Array] = {}
        #: heights of the robot's ankles, or of the centres of point feet, above the ground that they stand on [m]
        self._heights: dict[str, float] = {}
        #: from where the skeleton's foot would be to where the robot's is, both at rest, in the body's axes [m]
        self._shifts: dict[str, Array] = {}
        #: of the robot's limbs: base to middle, middle to wrist, wrist to contact [m]
        self._lengths: dict[str, Array] = {}
        #: points of all limbs, from base to tip; directions of their bones at rest, where one has no length
        self._chains = np.array([one.chain for one in match.limbs.values()])
        bones = np.diff(rest[self._chains], axis=1)
        self._still = bones / np.maximum(np.linalg.norm(bones, axis=2, keepdims=True), 1e-9)
        for name, limb in body.limbs.items():
            self._bases[name] = (limb.base - (waist if self._from_chest(name) else body.places[0])) @ axes
            over = float((limb.places[2] - limb.places[3]) @ axes[:, 2])
            self._heights[name] = limb.radius + over * (limb.contact == "flat")
        for name, one in match.limbs.items():
            limb = body.limbs[name]
            foot, end = (limb.places[2] - body.places[0]) @ axes, (rest[one.end] - hips) @ match.axes
            if body.plan.upright:
                foot[0], end[0] = ((limb.base - body.places[0]) @ axes)[0], ((rest[one.base] - hips) @ match.axes)[0]
            self._shifts[name] = np.asarray(foot - match.scale * end)
            self._lengths[name] = np.linalg.norm(np.diff(limb.places, axis=0), axis=1)

    def _from_chest(self, name: str) -> bool:
        """Whether the chest carries a robot's limb."""
        return self.match.body.plan.upright and name.endswith("arm")

    def _trunk_frames(self, points: Array) -> list[Array]:
        """Rotations of pelvis and chest as the points show them [frames, 3, 3]."""
        ahead = points[:, self._top].mean(axis=1) - points[:, self._hips].mean(axis=1)
        return [frames_of(points[:, a] - points[:, b], ahead) for a, b in (self._hips, self._shoulders)]

    def places(self, points: Array, turns: Array | None, ankle: dict[str, float]) -> Places:
        """Targets of frames.

        Args:
            points: [frames, joints, 3] [m]. turns: [frames, joints, 3, 3]. ankle: height above the clip's zero at which
                each leading limb's end stands [m].
        """
        match, body, axes = self.match, self.match.body, self.match.axes
        if turns is not None:
            pelvis, chest = turns[:, match.pelvis] @ axes, turns[:, match.chest] @ axes
        else:
            pelvis, chest = (
                now @ before[0].T @ axes for now, before in zip(self._trunk_frames(points), self._trunk, strict=True)
            )
        lying = match.all_fours and match.upright and not body.plan.upright
        turned = LYING_TRUNK if lying else np.eye(3)
        pelvis, chest = pelvis @ turned, chest @ turned
        hips = points[:, self._hips].mean(axis=1)
        if body.robot.base == "fixed":
            # The robot's trunk stands where it stands: arms move as seen from the pelvis
            mirror = np.array([-1.0 if match.mirrored else 1.0, 1.0, 1.0])
            still = body.axes * mirror @ np.swapaxes(pelvis, 1, 2)
            points = (still[:, None] @ (points - hips[:, None])[..., None])[..., 0]
            turns = None if turns is None or match.mirrored else still[:, None] @ turns
            pelvis, chest = still @ pelvis * mirror, still @ chest * mirror
            place = np.broadcast_to(body.places[0], hips.shape).copy()
        else:
            ground = min((ankle[m.source] for name, m in match.limbs.items() if name.endswith("leg")), default=0.0)
            lift = np.array([0.0, 0.0, self._heights.get("left_leg", 0.0)])
            place = match.scale * (hips - np.array([0.0, 0.0, ground])) + lift
        head = turns[:, match.head] @ axes if turns is not None and match.head >= 0 and body.head else None
        ways = np.swapaxes(points[:, self._chains[:, 1:]] - points[:, self._chains[:, :-1]], 0, 1)
        bones = dict(zip(match.limbs, normalised(ways, self._still[:, None]), strict=True))
        place[:, 2] += self._rise(bones, place, pelvis)
        trunk = Places(place, pelvis, chest, head, {})
        limbs = {name: self._limb(name, points, bones[name], turns, trunk, ankle) for name in match.limbs}
        return replace(trunk, limbs=limbs)

    def _rise(self, bones: Mapping[str, Array], place: Array, pelvis: Array) -> Array:
        """How much the trunk must be higher so that knees lie on the ground and not in it [frames] [m]."""
        rise = np.zeros(len(place))
        for name in bones if self._lies else ():
            if name.endswith("leg"):
                knees = place[:, 2] + pelvis[:, 2] @ self._bases[name] + self._lengths[name][0] * bones[name][:, 0, 2]
                rise = np.maximum(rise, lift(knees - self.match.body.limbs[name].thickness[0]))
        return rise

    def _limb(
        self, name: str, points: Array, bones: Array, turns: Array | None, trunk: Places, ankle: dict[str, float]
    ) -> LimbPlaces:
        """Targets of a limb, of the directions of its three bones [frames, 3, 3]."""
        match, limb = self.match.limbs[name], self.match.body.limbs[name]
        if match.tip == match.end:
            bones[:, 2] = bones[:, 1]
        base = trunk.pelvis + trunk.turn @ self._bases[name]
        if self._from_chest(name):
            base = trunk.pelvis + trunk.turn @ self._waist + trunk.chest @ self._bases[name]
        upper, lower, hand = self._lengths[name]
        middle = base + upper * bones[:, 0]
        rotation = self._rotation(match, points, turns, trunk, limb.contact == "flat")
        if not self.match.body.is_foot(name):
            lie = limb.thickness if self._lies else (-np.inf,) * 3
            middle = _next_joint(base, upper * bones[:, 0], lie[0], trunk.heading)
            wrist = _next_joint(middle, lower * bones[:, 1], lie[1], trunk.heading)
            end = _next_joint(wrist, hand * bones[:, 2], lie[2], trunk.heading)
            return LimbPlaces(base, middle, wrist, end, rotation if turns is not None else None)
        height = np.array([0.0, 0.0, self._heights[name]])
        wrist = self.match.scale * (points[:, match.end] - np.array([0.0, 0.0, ankle[match.source]])) + height
        wrist[:, :2] += (trunk.heading @ self._shifts[name])[:, :2]
        if limb.contact != "flat":
            return LimbPlaces(base, middle, wrist, wrist, None)
        end = wrist + (-height if rotation is None else rotation @ -height)
        return LimbPlaces(base, middle, wrist, end, rotation)

    def _rotation(
        self, match: LimbMatch, points: Array, turns: Array | None, trunk: Places, foot: bool
    ) -> Array | None:
        """Of the foot or hand, in the body's axes at rest."""
        axes, rest = self.match.axes, self.match.skeleton.rest
        if turns is not None:
            return np.asarray(turns[:, match.end] @ axes)
        if not foot:
            return None
        if match.tip == match.end:
            return trunk.heading
        # Along the foot, as far as its rest is turned from there; the hips say where its side is
        forward = rest[match.tip] - rest[match.end]
        before = frames_of(axes[:, 1][None], np.cross(forward, axes[:, 1])[None])[0]
        ahead, left = points[:, match.tip] - points[:, match.end], trunk.turn[:, :, 1]
        side = left - ahead * (np.sum(left * ahead, axis=1) / np.maximum(np.sum(ahead**2, axis=1), 1e-12))[:, None]
        return np.asarray(frames_of(side, np.cross(ahead, side)) @ before.T @ axes)


def _next_joint(start: Array, bones: Array, thickness: float, headings: Array) -> Array:
    """Where bones [frames, 3] [m] end; those that would end nearer to the ground than a thickness [m] are turned."""
    end: Array = start + bones
    heights = end[:, 2] - thickness
    if not (heights < FAR_ABOVE * CLEAR).any():
        return end
    lengths = np.sqrt((bones * bones).sum(axis=1))
    rise = np.minimum(np.maximum(bones[:, 2] + lift(heights), -lengths), lengths)
    # The bone goes out level as far as its length says, ahead where it stood upright
    way = bones[:, :2] + AHEAD_SHARE * lengths[:, None] * headings[:, :2, 0]
    way /= np.maximum(np.sqrt((way * way).sum(axis=1, keepdims=True)), SHORT)
    along, more = np.abs((bones[:, :2] * way).sum(axis=1)), bones[:, 2] ** 2 - rise**2
    out = more / np.maximum(along + np.sqrt(np.maximum(along**2 + more, 0.0)), SHORT)
    end[:, :2] += out[:, None] * way
    end[:, 2] = start[:, 2] + rise
    return end


def _headings(rotations: Array) -> Array:
    """The turns about the vertical that are nearest to rotations of a body whose x axis is forward [frames, 3, 3]."""
    forward = rotations[:, :, 0].copy()
    steep = np.abs(forward[:, 2]) > STEEP
    forward[steep] = -np.sign(forward[steep, 2])[:, None] * rotations[steep, :, 2]
    forward[:, 2] = 0.0
    x = normalised(forward, np.array([1.0, 0.0, 0.0]))
    out = np.zeros_like(rotations)
    out[:, :, 0], out[:, 0, 1], out[:, 1, 1], out[:, 2, 2] = x, -x[:, 1], x[:, 0], 1.0
    return out
