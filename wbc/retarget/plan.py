"""Targets over the ticks of a clip: resampled, feet at rest in their stances and brought there before."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from wbc.retarget.body import LIMBS
from wbc.retarget.clip import Array
from wbc.retarget.mapping import LimbPlaces, Places
from wbc.retarget.robot_body import RobotBody, RobotLimb
from wbc.retarget.stances import Marks, intervals, smoothed
from wbc.rotations import exponential

#: Time in which a foot leaves the place of its stance for the skeleton's path, and comes to the next one [s]
BLEND = 0.12
#: Most of a swing that one of the two takes
SHARE = 0.4
#: A stance within this height of the ground is on it [m]
GROUND = 0.03
#: A foot in the air is this high or so, where the skeleton's would be on the ground or below [m]
CLEAR = 0.006
#: A foot is flat where its sole is tilted by less than the angle of this cosine
SOLE_LEVEL = 0.8
#: Most of a leg's length that a standing leg has between hip and ankle
STRETCH = 0.985
#: Standard deviation of the Gaussian that the lowering of the pelvis is smoothed with [s]
LOWERING = 0.05
#: Standard deviation of the Gaussian with which weight goes from contact to contact [s]
SHIFT = 0.08
#: How long a contact is a hard row before its stance begins [s]
BEFORE = 0.05


@dataclass(frozen=True)
class LimbPlan:
    """A limb's targets over ticks.

    Attributes:
        middle, wrist, end: positions [ticks, 3] [m]. rotation: [ticks, 3, 3]; None: free.
        stands: in stance. held: in stance or shortly before one [ticks].
    """

    middle: Array
    wrist: Array
    end: Array
    rotation: Array | None
    stands: Marks
    held: Marks


@dataclass(frozen=True)
class MotionPlan:
    """Targets over ticks; see :class:`wbc.retarget.mapping.Places`.

    Attributes:
        dt: time from tick to tick [s].
    """

    dt: float
    pelvis: Array
    turn: Array
    chest: Array
    head: Array | None
    limbs: dict[str, LimbPlan]

    @property
    def ticks(self) -> int:
        """How many."""
        return len(self.pelvis)


def resampled(values: Array, rate: float, times: Array) -> Array:
    """Values [frames, ...] at other times, by a cubic spline."""
    if len(values) < 4:
        where = np.clip(np.rint(times * rate).astype(int), 0, len(values) - 1)
        return np.asarray(values[where])
    own = np.arange(len(values)) / rate
    if len(times) == len(own) and np.allclose(times, own, atol=1e-9):
        return values
    from scipy.interpolate import CubicSpline

    return np.asarray(CubicSpline(own, values, axis=0)(times))


def turns_resampled(rotations: Array, rate: float, times: Array) -> Array:
    """Rotations [frames, 3, 3] at other times."""
    if len(rotations) == len(times):
        return rotations
    quaternions = Rotation.from_matrix(rotations).as_quat()
    flips = np.where(np.sum(quaternions[1:] * quaternions[:-1], axis=1) < 0.0, -1.0, 1.0)
    quaternions[1:] *= np.cumprod(flips)[:, None]
    return np.asarray(Rotation.from_quat(resampled(quaternions, rate, times)).as_matrix())


def logarithms(rotations: Array) -> Array:
    """Rotation vectors [n, 3] of rotations [n, 3, 3]."""
    return np.asarray(Rotation.from_matrix(rotations).as_rotvec())


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
    frame = np.clip(np.rint(times * rate).astype(int), 0, len(places.pelvis) - 1)
    limbs = {
        name: _limb_plan(body.limbs[name], _limb_resampled(limb, rate, times), marks[name][frame], dt)
        for name, limb in sorted(places.limbs.items(), key=lambda item: LIMBS.index(item[0]))
    }
    pelvis = resampled(places.pelvis, rate, times)
    turn = turns_resampled(places.turn, rate, times)
    pelvis = pelvis - np.array([0.0, 0.0, 1.0]) * lowering(body, pelvis, turn, limbs, dt)[:, None]
    head = None if places.head is None else turns_resampled(places.head, rate, times)
    return MotionPlan(dt, pelvis, turn, turns_resampled(places.chest, rate, times), head, limbs)


def _limb_resampled(limb: LimbPlaces, rate: float, times: Array) -> LimbPlaces:
    rotation = None if limb.rotation is None else turns_resampled(limb.rotation, rate, times)
    middle, wrist, end = (resampled(values, rate, times) for values in (limb.middle, limb.wrist, limb.end))
    return LimbPlaces(middle, wrist, end, rotation)


def _limb_plan(robot: RobotLimb, limb: LimbPlaces, stands: Marks, dt: float) -> LimbPlan:
    """A limb's targets with its stances at rest."""
    end, rotation = raised(robot, limb)
    stands = stands.copy()
    if rotation is not None and robot.contact == "flat":
        for a, b in intervals(stands):
            # A foot that stands on its toes is not held flat
            stands[a:b] &= float(np.median(rotation[a:b, 2, 2])) > SOLE_LEVEL
    raw, raw_rotation = end.copy(), None if rotation is None else rotation.copy()
    stances = [(a, b, *flat_place(robot, limb, raw, rotation, a, b)) for a, b in intervals(stands)]
    held = stands.copy()
    count = len(stands)
    for number, (a, b, place, heading) in enumerate(stances):
        end[a:b] = place
        if rotation is not None and heading is not None:
            rotation[a:b] = heading
        last = stances[number - 1][1] if number else 0
        following = stances[number + 1][0] if number + 1 < len(stances) else count
        for first, until, towards in ((last, a, 1), (b, following, -1)):
            open_end = (towards == 1 and not number) or (towards == -1 and number + 1 == len(stances))
            width = min(BLEND, (1.0 if open_end else SHARE) * (until - first) * dt)
            steps = round(width / dt)
            if steps < 1:
                continue
            span = np.arange(a - steps, a) if towards == 1 else np.arange(b, b + steps)
            span = span[(span >= 0) & (span < count)]
            away = (a - span if towards == 1 else span - b + 1) / (steps + 1)
            share = minimum_jerk(away)
            end[span] = place + share[:, None] * (raw[span] - place)
            if rotation is not None and raw_rotation is not None and heading is not None:
                off = logarithms(heading.T @ raw_rotation[span])
                rotation[span] = heading @ exponential(share[:, None] * off)
        held[max(a - round(BEFORE / dt), last if number else 0) : a] = True
    return LimbPlan(limb.middle, limb.wrist, end, rotation, stands, held)


def raised(robot: RobotLimb, limb: LimbPlaces) -> tuple[Array, Array | None]:
    """Positions and rotations of a limb's contact frame, clear of the ground."""
    end, rotation = limb.end.copy(), None if limb.rotation is None else limb.rotation.copy()
    heights = end[:, 2] - robot.radius
    if rotation is not None and robot.contact == "flat":
        heights = (np.einsum("tij,kj->tki", rotation, robot.corners)[..., 2] + end[:, None, 2]).min(axis=1)
    end[:, 2] += _lift(heights)
    return end, rotation


def _lift(heights: Array) -> Array:
    """By how much a foot in the air must be higher so that it is clear of the ground; smooth in the height [m]."""
    return np.asarray(0.5 * (np.sqrt((heights - CLEAR) ** 2 + CLEAR**2) - (heights - CLEAR)))


def flat_place(
    robot: RobotLimb, limb: LimbPlaces, raw: Array, rotation: Array | None, a: int, b: int
) -> tuple[Array, Array | None]:
    """Where a stance stands, of all of its ticks, and the heading of a flat foot."""
    place = np.median(raw[a:b], axis=0)
    height = float(np.linalg.norm(robot.places[2] - robot.places[3])) if robot.contact == "flat" else robot.radius
    level = float(np.median(limb.wrist[a:b, 2])) - height if robot.contact == "flat" else place[2] - height
    level = 0.0 if level < GROUND else level
    place[2] = level + (0.0 if robot.contact == "flat" else robot.radius)
    if rotation is None:
        return place, None
    forward = rotation[a:b, :, 0].mean(axis=0)
    yaw = float(np.arctan2(forward[1], forward[0]))
    heading = np.array([[np.cos(yaw), -np.sin(yaw), 0.0], [np.sin(yaw), np.cos(yaw), 0.0], [0.0, 0.0, 1.0]])
    return place, heading


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


def lowering(body: RobotBody, pelvis: Array, turn: Array, limbs: dict[str, LimbPlan], dt: float) -> Array:
    """How much the pelvis must be lower so that standing legs reach the ground [ticks] [m]."""
    need = np.zeros(len(pelvis))
    for name, plan in limbs.items():
        robot = body.limbs[name]
        if not (name.endswith("leg") or not body.plan.upright):
            continue
        hip = pelvis + turn @ ((robot.base - body.places[0]) @ body.axes)
        up = np.array([0.0, 0.0, float(np.linalg.norm(robot.places[2] - robot.places[3]))])
        ankle = plan.end + (up if robot.contact == "flat" else 0.0)
        across = np.linalg.norm((hip - ankle)[:, :2], axis=1)
        reach = STRETCH * sum(robot.lengths)
        most = np.sqrt(np.maximum(reach**2 - across**2, (0.2 * reach) ** 2))
        need = np.maximum(need, np.where(plan.held, hip[:, 2] - ankle[:, 2] - most, 0.0))
    if not need.any():
        return need
    from scipy.ndimage import maximum_filter1d

    width = max(round(2.0 * LOWERING / dt), 1)
    return smoothed(np.asarray(maximum_filter1d(need, 2 * width + 1, mode="nearest")), LOWERING / dt)
