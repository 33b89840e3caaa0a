"""Targets over the ticks of a clip: feet at rest in their stances, and knees between hips and ankles."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc.retarget.body import SHORT
from wbc.retarget.clip import Array, intervals
from wbc.retarget.mapping import AHEAD_SHARE, lift
from wbc.retarget.robot_body import RobotBody
from wbc.retarget.stances import smoothed
from wbc.retarget.targets import Targets
from wbc.rotations import exponential

#: Time in which a foot leaves the place of its stance for the skeleton's path, and comes to the next one [s]
BLEND = 0.12
#: Most of a swing that one of the two takes
SHARE = 0.4
#: A stance within this height of the ground is on it [m]
GROUND = 0.03
#: Cosine of turns beyond which the axis is no more read off the skew part [1]
NEARLY_TURNED = -0.99
#: A foot stands flat where its sole is tilted by less than the angle of this cosine
SOLE_LEVEL = 0.8
#: It cannot be flat where its ankle would have to turn farther than this beyond its limit [rad]
BEYOND_ANKLE = 0.1
#: A foot is planned so far from where its ankle's limit would hold it [rad]
ANKLE_SPARE = 0.05
#: How often a foot on its toes or heel is turned: its ankle moves with it, and its knee with that
TURNED = 4
#: Until it turns by less than this [rad]
LEAST_TURN = 1e-3
#: Most of a leg's length that a standing leg has between hip and ankle
STRETCH = 0.985
#: Standard deviation of the Gaussian that the lowering of the pelvis is smoothed with [s]
LOWERING = 0.05
#: Standard deviation of the Gaussian with which weight goes from contact to contact [s]
SHIFT = 0.08
#: How long a contact is a hard row before its stance begins [s]
BEFORE = 0.05


def logarithms(rotations: Array) -> Array:
    """Rotation vectors [n, 3] of rotations [n, 3, 3]."""
    cosines = 0.5 * (rotations[:, 0, 0] + rotations[:, 1, 1] + rotations[:, 2, 2] - 1.0)
    if (cosines < NEARLY_TURNED).any():
        from scipy.spatial.transform import Rotation

        return np.asarray(Rotation.from_matrix(rotations).as_rotvec())
    axes = 0.5 * (rotations[:, (2, 0, 1), (1, 2, 0)] - rotations[:, (1, 2, 0), (2, 0, 1)])
    sines = np.sqrt(np.vecdot(axes, axes))
    return np.asarray(axes * (np.arctan2(sines, cosines) / np.maximum(sines, 1e-12))[:, None])


def minimum_jerk(share: Array) -> Array:
    """From 0 to 1 with rates and accelerations of 0 at both ends."""
    s = np.minimum(np.maximum(share, 0.0), 1.0)
    return np.asarray(s**3 * (10.0 - 15.0 * s + 6.0 * s**2))


def turned_toward(first: Array, second: Array, shares: Array) -> Array:
    """Rotations between some, or one, and others [n, 3, 3], of which they have shares [n]."""
    return np.asarray(first @ exponential(shares[:, None] * logarithms(np.swapaxes(first, -1, -2) @ second)))


class Planner:
    """Makes targets that a robot's limbs can serve, in place; the same for all ticks of a clip and for one frame."""

    def __init__(self, body: RobotBody, limbs: Sequence[str]) -> None:
        self.body, self.limbs = body, tuple(limbs)
        self._own = own = [body.limbs[name] for name in limbs]
        self._feet = [k for k, name in enumerate(limbs) if body.is_foot(name)]
        self.flat = [k for k in self._feet if own[k].contact == "flat"]
        self._hulls = [float(np.linalg.norm(limb.surface, axis=1).max(initial=limb.radius)) for limb in own]
        self._soles = {k: np.ascontiguousarray(own[k].surface.T) for k in self.flat}
        #: lengths of two bones and way of the bend, and heights of ankles above soles, 0 of points, of limbs
        self._bones = np.array([(*limb.lengths, limb.bend) for limb in own])
        self._ankle = np.array([limb.ankle if k in self.flat else 0.0 for k, limb in enumerate(own)])
        self._pitch = np.array([limb.pitch for limb in own])
        self._lie = np.array([limb.thickness[0] for limb in own])
        self._radii = np.array([limb.radius for limb in own])

    def plan(self, targets: Targets, times: Array) -> Targets:
        """Targets at the times of ticks [s], of targets at the frames of a clip, with their stances."""
        ticks = targets.at(times)
        self.turn_ankles(ticks)
        if self.body.robot.base == "fixed":
            ticks.stands[:] = False
            return ticks
        ends = self.raised(ticks)
        for limb in range(len(self.limbs)):
            self._stand(ticks, limb, ends[:, limb])
        self.keep_above(ticks, self.flat)
        ankles = self.ankles(ticks)
        self.lower(ticks, self.lowering(ticks, ankles), ankles)
        return ticks

    def turn_ankles(self, targets: Targets) -> None:
        """Turn flat feet about their axes to the left as far as their ankles need it."""
        if self.flat:
            chains = targets.chains[:, self.flat]
            hips, towards, ankles = chains[:, :, 0], chains[:, :, 1], chains[:, :, 2]
            rotations = np.array([targets.turns[self.limbs[k]] for k in self.flat]).swapaxes(0, 1)
            shanks = self.knees(self.flat, hips, towards, ankles, targets.turns["pelvis"]) - ankles
            turns = self._ankle_turns(self.flat, rotations, shanks)
            for number, limb in enumerate(self.flat):
                if turns[:, number].any():
                    turned = rotations[:, number] @ _pitched(turns[:, number])
                    targets.turns[self.limbs[limb]] = turned
                    targets.chains[:, limb, 3] = ankles[:, number] - self._ankle[limb] * turned[:, :, 2]

    def knees(self, legs: Sequence[int], hips: Array, towards: Array, ankles: Array, pelvis: Array) -> Array:
        """Knees between hips and ankles, in the planes in which the skeleton's legs bend [ticks, legs, 3] [m].

            k = h + c d + sqrt(u^2 - c^2) s,  c = (u^2 + r^2 - l^2) / (2 r)

        with the hip h, the unit vector d to the ankle at the distance r, the lengths u and l of thigh and shank, and
        the unit vector s across d, to the skeleton's knee, or from it where the robot's knee bends the other way. A
        straight leg bends ahead of the pelvis.
        """
        upper, lower, bend = self._bones[legs].T[:, :, None]
        way = ankles - hips
        distance = np.maximum(np.sqrt(np.vecdot(way, way)), SHORT)[..., None]
        way = way / distance
        side = towards - hips + AHEAD_SHARE * upper * pelvis[:, None, :, 0]
        side = side - np.vecdot(side, way)[..., None] * way
        size = np.maximum(np.sqrt(np.vecdot(side, side)), SHORT)[..., None]
        along = np.minimum(np.maximum((upper**2 + distance**2 - lower**2) / (2.0 * distance), -upper), upper)
        return np.asarray(hips + along * way + bend * np.sqrt(upper**2 - along**2) / size * side)

    def _ankle_turns(self, legs: Sequence[int], rotations: Array, shanks: Array) -> Array:
        """Least turns about their axes to the left with which ankles hold feet against shanks [ticks, legs] [rad]."""
        along = (shanks[:, :, None] @ rotations)[:, :, 0]
        leans = np.arctan2(along[..., 0], along[..., 2])
        least, most = self._pitch[legs].T
        return np.asarray(np.minimum(np.maximum(least + ANKLE_SPARE + leans, 0.0), most - ANKLE_SPARE + leans))

    def _stand(self, targets: Targets, limb: int, end: Array) -> None:
        """Put a limb, whose path is given, at rest in its stances, and lead it there and away."""
        name, dt, stands = self.limbs[limb], targets.dt, targets.stands[:, limb]
        raw, path = end.copy(), targets.turns[name] if limb in self.flat else np.zeros(0)
        rotation, runs, held, hand = path.copy(), intervals(stands), targets.held[:, limb], limb not in self._feet
        held[:] = stands
        for number, (a, b) in enumerate(runs):
            place, heading = self.standing_place(targets, limb, slice(a, b))
            end[a:b] = place
            if heading is not None:
                rotation[a:b] = heading
            first, last = number == 0, number + 1 == len(runs)
            free = (0 if first else runs[number - 1][1], len(stands) if last else runs[number + 1][0])
            for count, open_end, comes in ((a - free[0], first, True), (free[1] - b, last, False)):
                steps = round(min(BLEND, (1.0 if open_end else SHARE) * count * dt) / dt)
                span = np.arange(max(a - steps, 0), a) if comes else np.arange(b, min(b + steps, len(stands)))
                if len(span):
                    share = minimum_jerk((a - span if comes else span - b + 1) / (steps + 1))
                    end[span] = place + share[:, None] * (raw[span] - place)
                    if heading is not None:
                        rotation[span] = turned_toward(heading, path[span], share)
            before = max(a - round(BEFORE / dt), free[0])
            held[before:a] = True
            targets.lies[before:b, limb] = hand and bool(place[2] <= self._hulls[limb])
        targets.chains[:, limb, 3] = end
        if len(rotation):
            targets.turns[name] = rotation

    def raised(self, targets: Targets) -> Array:
        """Positions of limbs' contact frames, clear of the ground [ticks, limbs, 3] [m]."""
        ends: Array = targets.chains[:, :, 3].copy()
        lowest = ends[:, :, 2] - self._radii
        for limb in self.flat:
            lowest[:, limb] = self._lowest(limb, ends[:, limb], targets.turns[self.limbs[limb]])
        ends[:, :, 2] += lift(lowest)
        return ends

    def keep_above(self, targets: Targets, feet: Sequence[int]) -> None:
        """Raise flat feet whose lowest point is below the ground as they come to their stances or leave them."""
        for limb in feet:
            low = self._lowest(limb, targets.chains[:, limb, 3], targets.turns[self.limbs[limb]])
            targets.chains[:, limb, 3, 2] -= np.minimum(low, 0.0)

    def _lowest(self, limb: int, end: Array, rotation: Array) -> Array:
        """Height of the lowest point of a flat foot [ticks] [m]."""
        # A product a tick: one of all would start threads
        heights = rotation[:, 2, None] @ self._soles[limb]
        return np.asarray(heights.min(axis=2)[:, 0] + end[:, 2])

    def standing_place(self, targets: Targets, limb: int, ticks: slice) -> tuple[Array, Array | None]:
        """Where a stance stands, of all of its ticks, and the rotation of a foot: level, or on its toes or heel."""
        robot, chain = self._own[limb], targets.chains[ticks, limb]
        place = _median(chain[:, 3])
        if limb not in self.flat:
            place[2] = robot.radius + _grounded(place[2] - robot.radius)
            return place, None
        rotation = targets.turns[self.limbs[limb]][ticks]
        if float(_median(rotation[:, 2, 2])) > SOLE_LEVEL:
            forward = rotation[:, :, 0].mean(axis=0)
            standing = exponential(np.array([[0.0, 0.0, float(np.arctan2(forward[1], forward[0]))]]))[0]
            place[2] = _grounded(_median(chain[:, 2, 2]) - robot.ankle)
            turns = self._standing_turns(targets, limb, ticks, place, standing)
            if abs(float(_median(turns))) < BEYOND_ANKLE:
                return place, standing
        # The rotation that is nearest to the mean
        left, _, right = np.linalg.svd(rotation.mean(axis=0))
        standing = left @ right
        level = _grounded(_median(self._lowest(limb, chain[:, 3], rotation)))
        for turns_left in reversed(range(TURNED + 1)):
            # The lowest point of the sole stands where it is in the mean
            lowest = robot.surface[int(np.argmin(robot.surface @ standing[2]))]
            place = _median(chain[:, 3] + rotation @ lowest) - standing @ lowest
            place[2] = level - float(standing[2] @ lowest)
            turns = self._standing_turns(targets, limb, ticks, place, standing)
            most = float(turns[np.argmax(np.abs(turns))])
            if abs(most) < LEAST_TURN or not turns_left:
                break
            standing = standing @ _pitched(np.array([most]))[0]
        return place, standing

    def _standing_turns(self, targets: Targets, limb: int, ticks: slice, place: Array, standing: Array) -> Array:
        """Turns that the ankle of a foot needs which stands at a place, over the ticks of its stance [rad]."""
        ankle, chain = place + self._ankle[limb] * standing[:, 2], targets.chains[ticks, limb, :, None]
        knee = self.knees([limb], chain[:, 0], chain[:, 1], ankle, targets.turns["pelvis"][ticks])
        return self._ankle_turns([limb], standing, knee - ankle)[:, 0]

    def ankles(self, targets: Targets) -> Array:
        """Where ankles of legs, or ends of those on points, are planned [ticks, feet, 3] [m]."""
        out = targets.chains[:, self._feet, 3]
        for number, limb in enumerate(self._feet):
            if limb in self.flat:
                out[:, number] += self._ankle[limb] * targets.turns[self.limbs[limb]][:, :, 2]
        return out

    def lowering(self, targets: Targets, ankles: Array) -> Array:
        """How much the pelvis must be lower so that standing legs reach their ankles [ticks] [m]."""
        held = targets.held[:, self._feet]
        if not held.any():
            return np.zeros(len(held))
        legs = targets.chains[:, self._feet, 0] - ankles
        reach = STRETCH * self._bones[self._feet, :2].sum(axis=1)
        most = np.sqrt(np.maximum(reach**2 - np.vecdot(legs[..., :2], legs[..., :2]), (0.2 * reach) ** 2))
        need = np.where(held, legs[..., 2] - most, 0.0).max(axis=1, initial=0.0)
        if not need.any():
            return np.asarray(need)
        from scipy.ndimage import maximum_filter1d

        width = max(round(2.0 * LOWERING / targets.dt), 1)
        return smoothed(np.asarray(maximum_filter1d(need, 2 * width + 1, mode="nearest")), LOWERING / targets.dt)

    def lower(self, targets: Targets, low: Array, ankles: Array) -> None:
        """Lower the trunk [ticks] [m], and put knees between its hips and :meth:`ankles`."""
        targets.pelvis[:, 2] -= low
        if self._feet and self.body.plan.upright:
            legs = targets.chains[:, self._feet]
            legs[:, :, :2, 2] -= low[:, None, None]
            legs[:, :, 1] = self.knees(self._feet, legs[:, :, 0], legs[:, :, 1], ankles, targets.turns["pelvis"])
            legs[:, :, 1, 2] += lift(legs[:, :, 1, 2] - self._lie[self._feet])
            legs[:, :, 2] = ankles
            targets.chains[:, self._feet] = legs


def balanced(targets: Targets) -> Array:
    """Where the centre of mass is over the contacts: their mean, and without any the pelvis [ticks, 3] [m]."""
    # Weight goes from foot to foot as smoothly as a person shifts it
    shares = smoothed(targets.stands.astype(float), SHIFT / targets.dt)
    total = shares.sum(axis=1)
    mean = np.einsum("tl,tli->ti", shares, targets.chains[:, :, 3]) / np.maximum(total, 1e-9)[:, None]
    share = np.minimum(total, 1.0)[:, None]
    return np.asarray(share * mean + (1.0 - share) * targets.pelvis)


def _pitched(angles: Array) -> Array:
    """Turns about a foot's axis to the left [n, 3, 3]."""
    out = np.zeros((len(angles), 3, 3))
    out[:, 0, 0] = out[:, 2, 2] = np.cos(angles)
    out[:, 0, 2] = np.sin(angles)
    out[:, 2, 0], out[:, 1, 1] = -out[:, 0, 2], 1.0
    return out


def _median(values: Array) -> Array:
    """Over the ticks: as numpy's, which takes ten times as long of so few."""
    count = len(values)
    ordered = np.sort(values, axis=0) if count > 1 else values
    return np.asarray(0.5 * (ordered[(count - 1) // 2] + ordered[count // 2]))


def _grounded(level: Array | float) -> float:
    """Height of a stance: 0 where it is on the ground or below [m]."""
    return 0.0 if level < GROUND else float(level)
