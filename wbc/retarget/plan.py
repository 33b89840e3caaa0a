"""Targets over the ticks of a clip: resampled, feet at rest in their stances and brought there before."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from wbc.retarget.body import SHORT
from wbc.retarget.clip import Array, Marks, intervals
from wbc.retarget.mapping import AHEAD_SHARE, LimbPlaces, Places, lift
from wbc.retarget.robot_body import RobotBody, RobotLimb
from wbc.retarget.stances import smoothed
from wbc.rotations import continuous_quaternions, exponential

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


class ContactGrip(Enum):
    """How a contact is held."""

    #: not at all
    FREE = 0
    #: along the ground that it lies on: its hull says how high it is
    LEVEL = 1
    #: in place
    FIRM = 2


@dataclass(frozen=True)
class LimbPlan(LimbPlaces):
    """A limb's targets over ticks.

    Attributes:
        stands: in stance. held: in stance or shortly before one [ticks].
        lies: it is a hand on the ground where it is held [ticks].
    """

    stands: Marks
    held: Marks
    lies: Marks

    def grip(self, tick: int) -> ContactGrip:
        """How it is held at a tick."""
        return (ContactGrip.LEVEL if self.lies[tick] else ContactGrip.FIRM) if self.held[tick] else ContactGrip.FREE


@dataclass(frozen=True)
class MotionPlan(Places):
    """Targets over ticks.

    Attributes:
        dt: time from tick to tick [s].
    """

    limbs: dict[str, LimbPlan]
    dt: float

    @property
    def ticks(self) -> int:
        """How many."""
        return len(self.pelvis)


def resampled(values: Array, rate: float, times: Array) -> Array:
    """Values [frames, ...] at other times, by a cubic spline."""
    if len(values) < 4:
        return np.asarray(values[_nearest(len(values), rate, times)])
    own = np.arange(len(values)) / rate
    if len(times) == len(own) and np.allclose(times, own, atol=1e-9):
        return values
    from scipy.interpolate import CubicSpline

    return np.asarray(CubicSpline(own, values, axis=0)(times))


def _nearest(frames: int, rate: float, times: Array) -> NDArray[np.int_]:
    """The frames that are nearest to some times."""
    return np.asarray(np.clip(np.rint(times * rate).astype(int), 0, frames - 1))


def turns_resampled(rotations: Array, rate: float, times: Array) -> Array:
    """Rotations [frames, n, 3, 3] at other times [n, times, 3, 3]."""
    frames, count = rotations.shape[:2]
    if frames == len(times):
        return np.asarray(rotations.swapaxes(0, 1))
    quaternions = Rotation.from_matrix(rotations.reshape(-1, 3, 3)).as_quat().reshape(frames, count, 4)
    for number in range(count):
        quaternions[:, number] = continuous_quaternions(quaternions[:, number])
    between = resampled(quaternions, rate, times).swapaxes(0, 1)
    return np.asarray(Rotation.from_quat(between.reshape(-1, 4)).as_matrix().reshape(count, len(times), 3, 3))


def logarithms(rotations: Array) -> Array:
    """Rotation vectors [n, 3] of rotations [n, 3, 3]."""
    cosines = 0.5 * (np.trace(rotations, axis1=1, axis2=2) - 1.0)
    if (cosines < NEARLY_TURNED).any():
        return np.asarray(Rotation.from_matrix(rotations).as_rotvec())
    skew = 0.5 * (rotations - np.swapaxes(rotations, 1, 2))
    axes = np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=1)
    sines = np.sqrt(np.sum(axes**2, axis=1))
    return np.asarray(axes * (np.arctan2(sines, cosines) / np.maximum(sines, 1e-12))[:, None])


def minimum_jerk(share: Array) -> Array:
    """From 0 to 1 with rates and accelerations of 0 at both ends."""
    s = np.clip(share, 0.0, 1.0)
    return np.asarray(s**3 * (10.0 - 15.0 * s + 6.0 * s**2))


def plan_motion(body: RobotBody, places: Places, marks: dict[str, Marks], rate: float, times: Array) -> MotionPlan:
    """Targets at the times of ticks, of targets at the frames of a clip.

    Args:
        marks: robot's limb -> whether it stands [frames]. rate: of frames [Hz]. times: of the ticks [s].
    """
    dt = float(times[1] - times[0]) if len(times) > 1 else 1.0 / rate
    at = _nearest(len(places.pelvis), rate, times)
    names = sorted(places.limbs, key=list(body.limbs).index)
    own = [places.limbs[name] for name in names]
    points = [places.pelvis, *(values for limb in own for values in (limb.base, limb.middle, limb.wrist, limb.end))]
    given = [places.turn, places.chest, places.head, *(limb.rotation for limb in own)]
    # All in one spline
    pelvis, *points = np.ascontiguousarray(resampled(np.stack(points, axis=1), rate, times).swapaxes(0, 1))
    known = iter(turns_resampled(np.stack([turns for turns in given if turns is not None], axis=1), rate, times))
    turn, chest, head, *rotations = (None if turns is None else next(known) for turns in given)
    assert turn is not None
    assert chest is not None
    there: dict[str, LimbPlaces] = {}
    for number, name in enumerate(names):
        base, middle, wrist, end = points[4 * number : 4 * number + 4]
        there[name] = LimbPlaces(base, middle, wrist, end, rotations[number])
    limbs: dict[str, LimbPlan] = {}
    for name, limb in with_ankles(body, there, turn).items():
        if body.robot.base == "fixed":
            limbs[name] = in_the_air(limb)
        else:
            limbs[name] = _limb_plan(body.limbs[name], limb, turn, marks[name][at], dt, hand=not body.is_foot(name))
    plan = MotionPlan(pelvis, turn, chest, head, limbs, dt)
    return lowered(body, plan, lowering(body, plan))


def in_the_air(limb: LimbPlaces) -> LimbPlan:
    """A limb's targets as they are, of a robot whose base is fixed: it stands on nothing."""
    never = np.zeros(len(limb.end), dtype=bool)
    return LimbPlan(limb.base, limb.middle, limb.wrist, limb.end, limb.rotation, never, never, never)


def _limb_plan(robot: RobotLimb, limb: LimbPlaces, turn: Array, stands: Marks, dt: float, *, hand: bool) -> LimbPlan:
    """A limb's targets with its stances at rest."""
    end, rotation = raised(robot, limb)
    raw, raw_rotation = end.copy(), None if rotation is None else rotation.copy()
    runs = intervals(stands)
    held, lies = stands.copy(), np.zeros(len(stands), dtype=bool)
    for number, (a, b) in enumerate(runs):
        place, heading = standing_place(robot, limb, turn, a, b)
        end[a:b] = place
        if rotation is not None and heading is not None:
            rotation[a:b] = heading
        first, last = number == 0, number + 1 == len(runs)
        free = (0 if first else runs[number - 1][1], len(stands) if last else runs[number + 1][0])
        for count, open_end, comes in ((a - free[0], first, True), (free[1] - b, last, False)):
            steps = round(min(BLEND, (1.0 if open_end else SHARE) * count * dt) / dt)
            if steps < 1:
                continue
            span = np.arange(a - steps, a) if comes else np.arange(b, b + steps)
            span = span[(span >= 0) & (span < len(stands))]
            share = minimum_jerk((a - span if comes else span - b + 1) / (steps + 1))
            end[span] = place + share[:, None] * (raw[span] - place)
            if rotation is not None and raw_rotation is not None and heading is not None:
                off = logarithms(heading.T @ raw_rotation[span])
                rotation[span] = heading @ exponential(share[:, None] * off)
        before = max(a - round(BEFORE / dt), free[0])
        held[before:a] = True
        lies[before:b] = hand and bool(place[2] <= robot.radius)
    return LimbPlan(limb.base, limb.middle, limb.wrist, end, rotation, stands, held, lies)


def raised(robot: RobotLimb, limb: LimbPlaces) -> tuple[Array, Array | None]:
    """Positions and rotations of a limb's contact frame, clear of the ground."""
    end, rotation = limb.end.copy(), None if limb.rotation is None else limb.rotation.copy()
    end[:, 2] += lift(_lowest(robot, end, rotation))
    return end, rotation


def _lowest(robot: RobotLimb, end: Array, rotation: Array | None) -> Array:
    """Height of the lowest point of a foot, or of a hand's ball [ticks] [m]."""
    if rotation is None or robot.contact != "flat":
        return np.asarray(end[:, 2] - robot.radius)
    # A product a tick: one of all would start threads
    return np.asarray((rotation[:, 2, None] @ np.ascontiguousarray(robot.surface.T)).min(axis=2)[:, 0] + end[:, 2])


def standing_place(robot: RobotLimb, limb: LimbPlaces, turn: Array, a: int, b: int) -> tuple[Array, Array | None]:
    """Where a stance stands, of all of its ticks, and the rotation of a foot: level, or on its toes or heel as it is in
    the mean.
    """
    ends, rotation = limb.end[a:b], limb.rotation[a:b] if limb.rotation is not None else None
    place = _median(ends)
    if robot.contact != "flat" or rotation is None:
        level = float(place[2]) - robot.radius
        place[2] = robot.radius + (0.0 if level < GROUND else level)
        return place, None
    forward = rotation[:, :, 0].mean(axis=0)
    standing = exponential(np.array([[0.0, 0.0, float(np.arctan2(forward[1], forward[0]))]]))[0]
    level = float(_median(limb.wrist[a:b, 2])) - robot.ankle
    place[2] = 0.0 if level < GROUND else level
    turns = _standing_turns(robot, limb, turn, place, standing, slice(a, b))
    if float(_median(rotation[:, 2, 2])) > SOLE_LEVEL and abs(float(_median(turns))) < BEYOND_ANKLE:
        return place, standing
    # The rotation that is nearest to the mean
    left, _, right = np.linalg.svd(rotation.mean(axis=0))
    standing = left @ right
    level = float(_median(_lowest(robot, ends, rotation)))
    for _ in range(TURNED):
        # The lowest point of the sole stands where it is in the mean
        lowest = robot.surface[int(np.argmin(robot.surface @ standing[2]))]
        place = _median(ends + rotation @ lowest) - standing @ lowest
        place[2] = (0.0 if level < GROUND else level) - float(standing[2] @ lowest)
        turns = _standing_turns(robot, limb, turn, place, standing, slice(a, b))
        most = float(turns[np.argmax(np.abs(turns))])
        if abs(most) < LEAST_TURN:
            break
        standing = standing @ _pitched(np.array([most]))[0]
    return place, standing


def _standing_turns(
    robot: RobotLimb, limb: LimbPlaces, turn: Array, place: Array, standing: Array, ticks: slice
) -> Array:
    """Turns that the ankle of a foot needs which stands at a place, over the ticks of its stance [rad]."""
    ankle = place + robot.ankle * standing[:, 2]
    knee = knees([robot], limb.base[None, ticks], limb.middle[None, ticks], ankle, turn[ticks, :, 0])
    return np.asarray(_ankle_turns([robot], standing, knee - ankle)[0])


def with_ankles(body: RobotBody, limbs: Mapping[str, LimbPlaces], turn: Array) -> dict[str, LimbPlaces]:
    """Targets of limbs with flat feet turned about their axes to the left as far as their ankles need it."""
    out = dict(limbs)
    flat = [k for k, limb in limbs.items() if body.limbs[k].contact == "flat" and limb.rotation is not None]
    feet, own = [k for k in flat if body.is_foot(k)], [body.limbs[k] for k in flat if body.is_foot(k)]
    if feet:
        ankles, rotations = np.array([limbs[k].wrist for k in feet]), np.array([limbs[k].rotation for k in feet])
        turns = _ankle_turns(own, rotations, _knees_of(own, [limbs[k] for k in feet], ankles, turn) - ankles)
        for k, robot, rotation, angles in zip(feet, own, rotations, turns, strict=True):
            if angles.any():
                turned = rotation @ _pitched(angles)
                out[k] = replace(out[k], end=out[k].wrist - robot.ankle * turned[:, :, 2], rotation=turned)
    return out


def _pitched(angles: Array) -> Array:
    """Turns about a foot's axis to the left [n, 3, 3]."""
    return exponential(angles[:, None] * np.array([0.0, 1.0, 0.0]))


def _knees_of(robots: Sequence[RobotLimb], legs: Sequence[LimbPlaces], ankles: Array, turn: Array) -> Array:
    """:func:`knees` of some legs."""
    return knees(
        robots, np.array([leg.base for leg in legs]), np.array([leg.middle for leg in legs]), ankles, turn[:, :, 0]
    )


def knees(robots: Sequence[RobotLimb], hips: Array, towards: Array, ankles: Array, ahead: Array) -> Array:
    """Where knees are between hips and ankles, in the planes in which the skeleton's legs bend [legs, ticks, 3] [m].

        k = h + c d + sqrt(u^2 - c^2) s,  c = (u^2 + r^2 - l^2) / (2 r)

    with the hip h, the unit vector d to the ankle at the distance r, the lengths u and l of thigh and shank, and the
    unit vector s across d, to the skeleton's knee, or from it where the robot's knee bends the other way.

    Args:
        hips, towards, ankles: of the robot, and the skeleton's knees [legs, ticks, 3] [m]. ahead: of the trunk
            [ticks, 3]: there a straight leg bends.
    """
    sizes = np.array([(*robot.lengths, robot.bend) for robot in robots])
    upper, lower, bend = sizes.T[:, :, None, None]
    way = ankles - hips
    distance = np.maximum(np.sqrt((way * way).sum(axis=2, keepdims=True)), SHORT)
    way = way / distance
    side = towards - hips + AHEAD_SHARE * upper * ahead
    side = side - (side * way).sum(axis=2, keepdims=True) * way
    size = np.maximum(np.sqrt((side * side).sum(axis=2, keepdims=True)), SHORT)
    along = np.minimum(np.maximum((upper**2 + distance**2 - lower**2) / (2.0 * distance), -upper), upper)
    return np.asarray(hips + along * way + bend * np.sqrt(upper**2 - along**2) / size * side)


def _ankle_turns(robots: Sequence[RobotLimb], rotations: Array, shanks: Array) -> Array:
    """The least turns of feet about their axes to the left with which ankles can hold them against shanks [legs, ticks]
    [rad].
    """
    along = (shanks[:, :, None] @ rotations)[:, :, 0]
    leans = np.arctan2(along[..., 0], along[..., 2])
    least, most = np.array([robot.pitch for robot in robots]).T[:, :, None]
    return np.asarray(np.minimum(np.maximum(least + ANKLE_SPARE + leans, 0.0), most - ANKLE_SPARE + leans))


def _median(values: Array) -> Array:
    """Over the ticks: as numpy's, which takes ten times as long of so few."""
    ordered, count = np.sort(values, axis=0), len(values)
    return np.asarray(0.5 * (ordered[(count - 1) // 2] + ordered[count // 2]))


def balanced(plan: MotionPlan) -> Array:
    """Where the centre of mass is over the contacts: their mean, and without any the pelvis [ticks, 3] [m]."""
    weights = np.array([limb.stands for limb in plan.limbs.values()], dtype=float)
    ends = np.array([limb.end for limb in plan.limbs.values()])
    # Weight goes from foot to foot as smoothly as a person shifts it
    shares = smoothed(weights.T, SHIFT / plan.dt).T
    total = shares.sum(axis=0)
    mean = np.einsum("lt,lti->ti", shares, ends) / np.maximum(total, 1e-9)[:, None]
    share = np.minimum(total, 1.0)[:, None]
    return np.asarray(share * mean + (1.0 - share) * plan.pelvis)


def lowering(body: RobotBody, plan: MotionPlan) -> Array:
    """How much the pelvis must be lower so that standing legs reach the ground [ticks] [m]."""
    feet = [name for name in plan.limbs if body.is_foot(name)]
    if not any(plan.limbs[name].held.any() for name in feet):
        return np.zeros(plan.ticks)
    legs = np.array([plan.limbs[name].base - _ankle_of(body.limbs[name], plan.limbs[name]) for name in feet])
    reach = STRETCH * np.array([sum(body.limbs[name].lengths) for name in feet])[:, None]
    most = np.sqrt(np.maximum(reach**2 - (legs[..., :2] ** 2).sum(axis=2), (0.2 * reach) ** 2))
    over = np.where([plan.limbs[name].held for name in feet], legs[..., 2] - most, 0.0)
    need = np.asarray(np.maximum(over.max(axis=0), 0.0))
    if not need.any():
        return need
    from scipy.ndimage import maximum_filter1d

    width = max(round(2.0 * LOWERING / plan.dt), 1)
    return smoothed(np.asarray(maximum_filter1d(need, 2 * width + 1, mode="nearest")), LOWERING / plan.dt)


def _ankle_of(robot: RobotLimb, limb: LimbPlaces) -> Array:
    """Where the ankle of a leg, or the end of one on a point, is planned [ticks, 3] [m]."""
    if robot.contact != "flat" or limb.rotation is None:
        return limb.end
    return np.asarray(limb.end + robot.ankle * limb.rotation[:, :, 2])


def lowered(body: RobotBody, plan: MotionPlan, low: Array) -> MotionPlan:
    """A plan whose trunk is lower [ticks] [m], with knees between its hips and ankles."""
    down, limbs = low[:, None] * np.array([0.0, 0.0, 1.0]), dict(plan.limbs)
    feet = [name for name in limbs if body.is_foot(name)] if body.plan.upright else []
    if feet:
        own = [body.limbs[name] for name in feet]
        ankles = np.array([_ankle_of(body.limbs[name], limbs[name]) for name in feet])
        hips, towards = np.array([(limbs[name].base, limbs[name].middle) for name in feet]).swapaxes(0, 1) - down
        middles = knees(own, hips, towards, ankles, plan.turn[:, :, 0])
        middles[..., 2] += lift(middles[..., 2] - np.array([robot.thickness[0] for robot in own])[:, None])
        for name, hip, middle, ankle in zip(feet, hips, middles, ankles, strict=True):
            limbs[name] = replace(limbs[name], base=hip, middle=middle, wrist=ankle)
    return replace(plan, pelvis=plan.pelvis - down, limbs=limbs)
