"""Where a robot's pelvis, chest, knees, elbows, feet and hands should be as a skeleton's points say, by frame."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from wbc.retarget.body import SHORT
from wbc.retarget.clip import Array
from wbc.retarget.correspondence import Correspondence, LimbMatch
from wbc.retarget.targets import Targets

#: From the trunk of a person on all fours, whose rest stands upright, to one that lies
LYING_TRUNK = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
#: What lies on the ground is this high above it or so, where the skeleton is on it or below [m]
CLEAR = 0.006
#: What is higher than so many times this is not raised [1]
FAR_ABOVE = 20.0
#: Height of the ground for what may be below it [m]
NO_GROUND = -1e9
#: A bone that stands upright falls ahead where it cannot reach below the ground: share of its length [1]
AHEAD_SHARE = 0.05
#: Of a body whose front is steeper than the angle of this sine its back says where it heads
STEEP = 0.9


def normalised(vectors: Array, fallback: Array) -> Array:
    """Unit vectors; where one has no length, the fallback."""
    sizes = np.sqrt(np.vecdot(vectors, vectors))[..., None]
    return np.asarray(np.where(sizes > SHORT, vectors / np.maximum(sizes, 1e-12), fallback))


def frames_of(first: Array, second: Array) -> Array:
    """Rotations whose y axis is along ``first`` and whose z axis is nearest to ``second`` [frames, 3, 3]."""
    y = normalised(first, np.array([0.0, 1.0, 0.0]))
    x = normalised(np.cross(y, second), np.cross(y, np.array([0.0, 0.0, 1.0])))
    x = normalised(x, np.array([1.0, 0.0, 0.0]))
    return np.stack([x, y, np.cross(x, y)], axis=-1)


def lift(heights: Array) -> Array:
    """By how much what has these heights must be higher so that it is clear of the ground; smooth in the height [m]."""
    return np.asarray(0.5 * (np.sqrt((heights - CLEAR) ** 2 + CLEAR**2) - (heights - CLEAR)))


class Mapper:
    """Turns points of a skeleton into targets of a robot's body; the same for a clip and for one frame."""

    def __init__(self, match: Correspondence, rate: float) -> None:
        self.match, self._dt = match, 1.0 / rate
        body, rest, axes = match.body, match.skeleton.rest, match.body.axes
        self.limbs = tuple(name for name in body.limbs if name in match.limbs)
        self._leads, own = [match.limbs[name] for name in self.limbs], [body.limbs[name] for name in self.limbs]
        bases = {one.source: one.base for one in match.limbs.values()}
        legs, arms = ([bases[k] for k in (f"left_{kind}", f"right_{kind}") if k in bases] for kind in ("leg", "arm"))
        both = [pair for pair in (legs, arms, list(bases.values())) if len(pair) > 1] or [list(bases.values()) * 2]
        #: points of left and right hip, of shoulders where the skeleton has no legs; and of shoulders that lead arms
        self._hips = [both[0][0], both[0][-1]]
        upright, free = body.plan.upright, body.robot.base != "fixed"
        leads = "left_arm" in match.limbs and upright and len(arms) > 1
        self._shoulders = arms if leads else self._hips
        #: what is above the hips
        self._top = arms if leads else [match.chest]
        self._trunk_at_rest = self._trunk(rest[None])
        self._feet = [k for k, name in enumerate(self.limbs) if body.is_foot(name)]
        self._flat = [k for k in self._feet if own[k].contact == "flat"]
        self._legs = [k for k, name in enumerate(self.limbs) if name.endswith("leg") and upright and free]
        #: of limbs: whether the chest carries one, where its base is from what carries it, in the body's axes [m]
        self._from_chest = np.array([upright and name.endswith("arm") for name in self.limbs])[:, None]
        places, waist = np.array([limb.places for limb in own]), body.places[0] if body.waist is None else body.waist
        self._waist = (waist - body.places[0]) @ axes
        self._bases = (places[:, 0] - np.where(self._from_chest, waist, body.places[0])) @ axes
        #: base to middle, middle to wrist, wrist to end; and what lies on the ground is as thick [limbs, 3] [m]
        self._lengths = np.linalg.norm(np.diff(places, axis=1), axis=2)
        lies = np.array([upright and free and not body.is_foot(name) for name in self.limbs])
        self._thick = np.array([limb.thickness for limb in own])
        self._ground = np.where(lies[:, None], self._thick, NO_GROUND)
        #: height of the robot's ankle, or of the centre of a point foot, above the ground that it stands on [m]
        self._heights = np.array([self._height(name) for name in self.limbs])
        self._hip_height = self._height("left_leg") if "left_leg" in body.limbs else 0.0
        #: points of all limbs, from base to tip; directions of their bones at rest, where one has no length
        self._chains = np.array([one.chain for one in self._leads])
        bones = np.diff(rest[self._chains], axis=1)
        self._still = bones / np.maximum(np.linalg.norm(bones, axis=2, keepdims=True), 1e-9)
        self._tipless = [k for k, one in enumerate(self._leads) if one.tip == one.end]
        # From where the skeleton's foot would be to where the robot's is, both at rest, in the body's axes
        apart = (places - body.places[0]) @ axes
        apart -= match.scale * (rest[self._chains] - rest[self._hips].mean(axis=0)) @ match.axes
        self._shifts = apart[:, 2]
        if upright:
            self._shifts[:, 0] = apart[:, 0, 0]

    def _height(self, name: str) -> float:
        """Height of a robot's ankle, or of the centre of a point foot, above the ground that it stands on [m]."""
        limb = self.match.body.limbs[name]
        over = float((limb.places[2] - limb.places[3]) @ self.match.body.axes[:, 2])
        return limb.radius + over * (limb.contact == "flat")

    def _trunk(self, points: Array) -> list[Array]:
        """Rotations of pelvis and chest as the points show them [frames, 3, 3]."""
        ahead = points[:, self._top].mean(axis=1) - points[:, self._hips].mean(axis=1)
        return [frames_of(points[:, a] - points[:, b], ahead) for a, b in (self._hips, self._shoulders)]

    def targets(self, points: Array, turns: Array | None, ankle: Mapping[str, float]) -> Targets:
        """Of points [frames, joints, 3] [m] and turns [frames, joints, 3, 3]; ``ankle``: height above the clip's zero
        at which each leading limb's end stands [m].
        """
        match, body, axes, count = self.match, self.match.body, self.match.axes, len(points)
        if turns is not None:
            pelvis, chest = turns[:, match.pelvis] @ axes, turns[:, match.chest] @ axes
        else:
            now = zip(self._trunk(points), self._trunk_at_rest, strict=True)
            pelvis, chest = (turn @ rest[0].T @ axes for turn, rest in now)
        if match.all_fours and match.upright and not body.plan.upright:
            pelvis, chest = pelvis @ LYING_TRUNK, chest @ LYING_TRUNK
        hips = 0.5 * (points[:, self._hips[0]] + points[:, self._hips[1]])
        if body.robot.base == "fixed":
            # The robot's trunk stands where it stands: arms move as seen from the pelvis
            mirror = np.array([-1.0 if match.mirrored else 1.0, 1.0, 1.0])
            still = body.axes * mirror @ np.swapaxes(pelvis, 1, 2)
            points = (still[:, None] @ (points - hips[:, None])[..., None])[..., 0]
            turns = None if turns is None or match.mirrored else still[:, None] @ turns
            pelvis, chest = still @ pelvis * mirror, still @ chest * mirror
            place = np.broadcast_to(body.places[0], hips.shape).copy()
        else:
            ground = min((ankle[match.limbs[name].source] for name in self.limbs if name.endswith("leg")), default=0.0)
            place = match.scale * (hips - np.array([0.0, 0.0, ground]))
            place[:, 2] += self._hip_height
        joints = points[:, self._chains]
        bones = normalised(joints[:, :, 1:] - joints[:, :, :-1], self._still)
        bases = place[:, None] + self._bases @ np.swapaxes(pelvis, 1, 2)
        above = (place + pelvis @ self._waist)[:, None] + self._bases @ np.swapaxes(chest, 1, 2)
        bases = np.where(self._from_chest, above, bases)
        if self._legs:
            # Knees lie on the ground and not in it
            knees = bases[:, self._legs, 2] + self._lengths[self._legs, 0] * bones[:, self._legs, 0, 2]
            rise = lift(knees - self._thick[self._legs, 0]).max(axis=1, initial=0.0)
            place[:, 2] += rise
            bases[..., 2] += rise[:, None]
        bones[:, self._tipless, 2] = bones[:, self._tipless, 1]
        chains, headings = np.empty((count, len(self.limbs), 4, 3)), _headings(pelvis)
        chains[:, :, 0] = bases
        for k in range(3):
            lengths = self._lengths[:, k]
            chains[:, :, k + 1] = _next_joint(chains[:, :, k], bones[:, :, k], lengths, self._ground[:, k], headings)
        known = {"pelvis": pelvis, "chest": chest}
        if turns is not None and match.head >= 0 and body.head:
            known["head"] = turns[:, match.head] @ axes
        if turns is not None:
            ends = (turns[:, self._chains[:, 2]] @ axes).swapaxes(0, 1)
            known.update((name, ends[k]) for k, name in enumerate(self.limbs) if k not in self._feet)
        if self._feet:
            feet = match.scale * points[:, self._chains[self._feet, 2]]
            stood = np.array([match.scale * ankle[self._leads[k].source] for k in self._feet])
            feet[:, :, :2] += (self._shifts[self._feet] @ headings.swapaxes(1, 2))[:, :, :2]
            feet[:, :, 2] += self._heights[self._feet] - stood
            chains[:, self._feet, 2:] = feet[:, :, None]
        for k in self._flat:
            turn = self._turn_of_foot(self._leads[k], points, pelvis, headings) if turns is None else ends[k]
            known[self.limbs[k]] = turn
            chains[:, k, 3] -= self._heights[k] * turn[:, :, 2]
        stands, held, lies = np.zeros((3, count, len(self.limbs)), dtype=bool)
        return Targets(self.limbs, self._dt, place, chains, known, stands, held, lies)

    def _turn_of_foot(self, lead: LimbMatch, points: Array, pelvis: Array, headings: Array) -> Array:
        """Rotations of a flat foot, in the body's axes at rest, as points show them [frames, 3, 3]."""
        axes, rest = self.match.axes, self.match.skeleton.rest
        if lead.tip == lead.end:
            return headings
        # Along the foot, as far as its rest is turned from there; the hips say where its side is
        forward = rest[lead.tip] - rest[lead.end]
        before = frames_of(axes[:, 1][None], np.cross(forward, axes[:, 1])[None])[0]
        ahead, left = points[:, lead.tip] - points[:, lead.end], pelvis[:, :, 1]
        side = left - ahead * (np.vecdot(left, ahead) / np.maximum(np.vecdot(ahead, ahead), 1e-12))[:, None]
        return np.asarray(frames_of(side, np.cross(ahead, side)) @ before.T @ axes)


def _next_joint(start: Array, ways: Array, lengths: Array, ground: Array, headings: Array) -> Array:
    """Where bones along ways [frames, limbs, 3] of lengths [limbs] [m] end; those that would end below heights of
    theirs [limbs] [m] are turned.
    """
    bones = lengths[:, None] * ways
    end: Array = start + bones
    heights = end[..., 2] - ground
    if not (heights < FAR_ABOVE * CLEAR).any():
        return end
    rise = np.minimum(np.maximum(bones[..., 2] + lift(heights), -lengths), lengths)
    # The bone goes out level as far as its length says, ahead where it stood upright
    way = bones[..., :2] + AHEAD_SHARE * lengths[:, None] * headings[:, None, :2, 0]
    way /= np.maximum(np.sqrt(np.vecdot(way, way)), SHORT)[..., None]
    along, more = np.abs(np.vecdot(bones[..., :2], way)), bones[..., 2] ** 2 - rise**2
    out = more / np.maximum(along + np.sqrt(np.maximum(along**2 + more, 0.0)), SHORT)
    end[..., :2] += out[..., None] * way
    end[..., 2] = start[..., 2] + rise
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
