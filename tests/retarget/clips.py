"""Clips of a person and of a dog, made from seeds: feet in stance stand still to rounding, and what stands is known.

Walker and scene are in metres with z up, x forward and y to the left. The person has the 22 joints of LAFAN1's files.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from wbc.retarget import Clip, Skeleton

Array = NDArray[np.float64]

#: Height of the ankle above the sole, of a person of 1.70 m [m]
ANKLE = 0.08
#: Thigh and shank of that person, then upper arm and forearm [m]
THIGH, SHANK, UPPER_ARM, FOREARM = 0.42, 0.41, 0.28, 0.25
#: Height and depth of a stair [m]
RISE, RUN = 0.16, 0.30
#: Joint, parent, offset
Bones = tuple[tuple[str, str, tuple[float, float, float]], ...]


def both(left: Bones) -> Bones:
    """Bones of the left, and those of the right."""
    return left + tuple(
        (name.replace("Left", "Right"), parent.replace("Left", "Right"), (x, 0.0 - y, z))
        for name, parent, (x, y, z) in left
    )


#: Joint, parent, offset in the T-pose [m]
BONES: Bones = (
    ("Hips", "", (0.0, 0.0, ANKLE + THIGH + SHANK + 0.02)),
    *both((
        ("LeftUpLeg", "Hips", (0.0, 0.09, -0.02)), ("LeftLeg", "LeftUpLeg", (0.0, 0.0, -THIGH)),
        ("LeftFoot", "LeftLeg", (0.0, 0.0, -SHANK)), ("LeftToe", "LeftFoot", (0.13, 0.0, 0.02 - ANKLE)),
        ("LeftToeEnd", "LeftToe", (0.06, 0.0, 0.0)),
    )),
    ("Spine", "Hips", (0.0, 0.0, 0.10)), ("Spine1", "Spine", (0.0, 0.0, 0.12)), ("Spine2", "Spine1", (0.0, 0.0, 0.12)),
    ("Neck", "Spine2", (0.0, 0.0, 0.18)), ("Head", "Neck", (0.0, 0.0, 0.10)), ("HeadEnd", "Head", (0.0, 0.0, 0.15)),
    *both((
        ("LeftShoulder", "Spine2", (0.0, 0.05, 0.13)), ("LeftArm", "LeftShoulder", (0.0, 0.12, 0.0)),
        ("LeftForeArm", "LeftArm", (0.0, UPPER_ARM, 0.0)), ("LeftHand", "LeftForeArm", (0.0, FOREARM, 0.0)),
        ("LeftHandEnd", "LeftHand", (0.0, 0.15, 0.0)),
    )),
)  # fmt: skip
#: A dog: the joints of its limbs and trunk, with the offsets of a dog of 0.5 m at the shoulder [m]
DOG_BONES: Bones = (
    ("Hips", "", (0.0, 0.0, 0.47)),
    *both((
        ("LeftUpLeg", "Hips", (0.0, 0.08, -0.02)), ("LeftLeg", "LeftUpLeg", (0.0, 0.0, -0.22)),
        ("LeftFoot", "LeftLeg", (0.0, 0.0, -0.21)), ("LeftFootEnd", "LeftFoot", (0.03, 0.0, 0.0)),
    )),
    ("Spine", "Hips", (0.20, 0.0, 0.0)), ("Spine1", "Spine", (0.25, 0.0, 0.0)), ("Neck", "Spine1", (0.08, 0.0, 0.05)),
    ("Head", "Neck", (0.12, 0.0, 0.15)), ("HeadEnd", "Head", (0.12, 0.0, 0.0)),
    *both((
        ("LeftArm", "Spine1", (0.0, 0.08, -0.02)), ("LeftForeArm", "LeftArm", (0.0, 0.0, -0.22)),
        ("LeftHand", "LeftForeArm", (0.0, 0.0, -0.21)), ("LeftHandEnd", "LeftHand", (0.03, 0.0, 0.0)),
    )),
)  # fmt: skip


@dataclass(frozen=True)
class Stance:
    """A foot or hand that stands from ``land`` to ``lift`` [s] at (x, y, z, yaw) of its ankle or wrist."""

    land: float
    lift: float
    pose: tuple[float, float, float, float]


@dataclass(frozen=True)
class Made:
    """A clip whose truth is known.

    Attributes:
        clip: as a perfect reader leaves it.
        stance: foot or hand -> whether it stands [frames].
        stances: foot or hand -> its stances in order.
        heights: of the ground under the points x [m]; None: 0 everywhere.
    """

    clip: Clip
    stance: dict[str, NDArray[np.bool_]]
    stances: dict[str, tuple[Stance, ...]]
    heights: Callable[[float], float] | None = None


def skeleton(bones: Sequence[tuple[str, str, tuple[float, float, float]]], size: float = 1.0) -> Skeleton:
    """The skeleton of a table of bones, all lengths times ``size``."""
    names = tuple(name for name, _, _ in bones)
    parents = tuple(names.index(parent) if parent else -1 for _, parent, _ in bones)
    offsets = size * np.array([offset for _, _, offset in bones])
    return Skeleton(names, parents, offsets, tuple(name.endswith("End") for name in names))


def smooth(s: Array) -> Array:
    """Minimum jerk from 0 to 1."""
    s = np.clip(s, 0.0, 1.0)
    return s**3 * (10.0 - 15.0 * s + 6.0 * s**2)


def turned(axis: int, angles: Array | float) -> Array:
    """Rotations about an axis [..., 3, 3]."""
    angles = np.asarray(angles, dtype=float)
    out = np.zeros((*angles.shape, 3, 3))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    out[..., axis, axis] = 1.0
    out[..., i, i] = out[..., j, j] = np.cos(angles)
    out[..., j, i] = np.sin(angles)
    out[..., i, j] = -np.sin(angles)
    return out


def unit(vectors: Array) -> Array:
    """Vectors of length 1."""
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def columns(x: Array, y: Array, z: Array) -> Array:
    """Rotations with these columns."""
    return np.stack((x, y, z), axis=-1)


def two_bones(start: Array, end: Array, pole: Array, lengths: tuple[float, float]) -> tuple[Array, Array, Array]:
    """Directions of two bones from ``start`` to ``end``, bent towards ``pole``, and the side of the bend [frames, 3].

    An end out of reach is drawn in along the line, at 0.999 of the length.
    """
    upper, lower = lengths
    along = end - start
    distance = np.clip(np.linalg.norm(along, axis=1), abs(upper - lower) + 1e-6, 0.999 * (upper + lower))
    along = unit(along)
    across = unit(pole - np.sum(pole * along, axis=1, keepdims=True) * along)
    cosine = (upper**2 + distance**2 - lower**2) / (2.0 * upper * distance)
    sine = np.sqrt(1.0 - cosine**2)
    first = cosine[:, None] * along + sine[:, None] * across
    second = unit(distance[:, None] * along - upper * first)
    return first, second, np.cross(across, along)


@dataclass(frozen=True)
class Gait:
    """When limbs stand, over the path's time.

    Attributes:
        period: of a stride [s]. duty: share of it in stance. phases: limb -> share of the period by which it is late.
        first, last: time of the first lift and of the last landing [s].
    """

    period: float
    duty: float
    phases: dict[str, float]
    first: float
    last: float

    def times(self, limb: str) -> list[tuple[float, float]]:
        """Landing and lift of each stance; the first begins, and the last ends, beyond the clip."""
        out = []
        land, lift = -1e3, self.first + self.phases[limb] * self.period
        while lift + (1.0 - self.duty) * self.period <= self.last:
            out.append((land, lift))
            land = lift + (1.0 - self.duty) * self.period
            lift = land + self.duty * self.period
        return [*out, (land, 1e3)]


@dataclass(frozen=True)
class Limbs:
    """Feet and hands over time, from stances and what lies between.

    Attributes:
        raised: height of a swing above the line from stance to stance [m]. pitch: of the foot in mid swing [rad].
    """

    raised: float = 0.10
    pitch: float = 0.3

    def over(self, times: Array, stances: Sequence[Stance]) -> tuple[Array, Array, Array, NDArray[np.bool_]]:
        """Position, yaw, pitch and whether it stands, at each time."""
        poses = np.array([stance.pose for stance in stances])
        number = np.searchsorted([stance.lift for stance in stances], times, side="left").clip(max=len(stances) - 1)
        lands = np.array([stance.land for stance in stances])[number]
        lifts = np.array([-1e3, *(stance.lift for stance in stances)])[number]
        standing = times >= lands
        share = np.where(standing, 1.0, (times - lifts) / np.where(standing, 1.0, lands - lifts))
        before, after = poses[np.maximum(number - 1, 0)], poses[number]
        out = before + smooth(share)[:, None] * (after - before)
        # Up first and ahead then, as over a stair
        out[:, 2] = before[:, 2] + smooth(share / 0.6) * (after[:, 2] - before[:, 2])
        bump = np.where(standing, 0.0, np.sin(np.pi * np.clip(share, 0.0, 1.0)) ** 2)
        out[standing] = after[standing]
        out[:, 2] += self.raised * bump
        return out[:, :3], out[:, 3], self.pitch * bump * np.cos(np.pi * share), standing


@dataclass
class Person:
    """A person whose pelvis, trunk, feet and hands are given, and whose joints follow.

    Attributes:
        size: of all lengths; 1 is 1.70 m. times: of the frames [s].
    """

    size: float
    times: Array
    turns: dict[str, Array] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.skeleton = skeleton(BONES, self.size)
        self.points: dict[str, Array] = {}

    def place(self, name: str, turn: Array) -> None:
        """Set a joint's rotation in the world; its parent's stands already."""
        number = self.skeleton.names.index(name)
        parent = self.skeleton.names[self.skeleton.parents[number]]
        self.points[name] = self.points[parent] + self.turns[parent] @ self.skeleton.offsets[number]
        self.turns[name] = np.broadcast_to(turn, (len(self.times), 3, 3))

    def trunk(self, pelvis: Array, turn: Array, bend: Array, head: Array) -> None:
        """Pelvis, spine with a third of ``bend`` each, neck and head."""
        self.points["Hips"], self.turns["Hips"] = pelvis, turn
        for share, name in enumerate(("Spine", "Spine1", "Spine2"), 1):
            self.place(name, turn @ turned(1, bend * share / 3.0))
        self.place("Neck", self.turns["Spine2"])
        self.place("Head", self.turns["Neck"] @ turned(1, head))
        for side in ("Left", "Right"):
            self.place(f"{side}Shoulder", self.turns["Spine2"])
            self.place(f"{side}UpLeg", turn)
            self.place(f"{side}Arm", self.turns["Spine2"])

    def leg(self, side: str, ankle: Array, yaw: Array, pitch: Array, toe: Array | float = 0.0) -> None:
        """A leg whose ankle, and foot, are there."""
        foot = turned(2, yaw) @ turned(1, pitch)
        hip = self.points[f"{side}UpLeg"]
        forward = turned(2, yaw)[:, :, 0] + 0.3 * self.turns["Hips"][:, :, 0]
        thigh, shank, hinge = two_bones(hip, ankle, forward, (self.size * THIGH, self.size * SHANK))
        self.turns[f"{side}UpLeg"] = columns(np.cross(hinge, -thigh), hinge, -thigh)
        self.place(f"{side}Leg", columns(np.cross(hinge, -shank), hinge, -shank))
        self.place(f"{side}Foot", foot)
        self.place(f"{side}Toe", foot @ turned(1, toe))

    def arm(self, side: str, pitch: Array, out: Array, elbow: Array) -> None:
        """An arm by angles: forward from hanging, away from the body, bend of the elbow."""
        sign = 1.0 if side == "Left" else -1.0
        down = self.turns["Spine2"] @ turned(1, -pitch) @ turned(0, sign * (out - np.pi / 2.0))
        self.turns[f"{side}Arm"] = down
        self.place(f"{side}ForeArm", down @ turned(2, -sign * elbow))
        self.place(f"{side}Hand", self.turns[f"{side}ForeArm"])

    def reach(self, side: str, wrist: Array, yaw: Array) -> None:
        """An arm whose wrist is there, with the palm's direction ahead along the ground."""
        sign = 1.0 if side == "Left" else -1.0
        shoulder = self.points[f"{side}Arm"]
        away = turned(2, yaw)[:, :, 1] * sign * 0.5 - turned(2, yaw)[:, :, 0]
        upper, lower, _ = two_bones(shoulder, wrist, away, (self.size * UPPER_ARM, self.size * FOREARM))
        hinge = sign * unit(np.cross(upper, lower)) * -1.0
        self.turns[f"{side}Arm"] = columns(np.cross(sign * upper, -hinge), sign * upper, -hinge)
        self.place(f"{side}ForeArm", columns(np.cross(sign * lower, -hinge), sign * lower, -hinge))
        self.place(f"{side}Hand", turned(2, yaw - sign * np.pi / 2.0))

    def made(self, name: str, rate: float, stances: dict[str, tuple[Stance, ...]]) -> Made:
        """The clip, and which feet and hands stand."""
        for number, joint in enumerate(self.skeleton.names):
            if self.skeleton.ends[number]:
                self.place(joint, self.turns[self.skeleton.names[self.skeleton.parents[number]]])
        points = np.stack([self.points[joint] for joint in self.skeleton.names], axis=1)
        turns = np.stack([self.turns[joint] for joint in self.skeleton.names], axis=1)
        seen = np.ones(points.shape[:2], dtype=bool)
        stance = {limb: standing_at(self.times, steps) for limb, steps in stances.items()}
        return Made(Clip(self.skeleton, rate, points, turns, seen, name), stance, stances)


def standing_at(times: Array, stances: Iterable[Stance]) -> NDArray[np.bool_]:
    """Whether one of the stances is on, at each time."""
    out = np.zeros(len(times), dtype=bool)
    for stance in stances:
        out |= (times >= stance.land) & (times <= stance.lift)
    return out


#: From a time to the path's x, y and yaw
Path = Callable[[Array], Array]


def steps(
    path: Path, gait: Gait, limb: str, ahead: float, aside: float, height: Callable[[float], float]
) -> list[Stance]:
    """Stances beside a path: each where the path is in the middle of its time."""
    out = []
    for land, lift in gait.times(limb):
        middle = gait.first - 1.0 if land < -1e2 else gait.last + 1.0 if lift > 1e2 else 0.5 * (land + lift)
        x, y, yaw = path(np.array([middle]))[0]
        x += ahead * np.cos(yaw) - aside * np.sin(yaw)
        y += ahead * np.sin(yaw) + aside * np.cos(yaw)
        out.append(Stance(land, lift, (x, y, height(x), yaw)))
    return out


def line(speed: float, gait: Gait, turn: float = 0.0, ramp: float = 1.2) -> Path:
    """Ahead at a speed [m/s] while a gait steps, with a yaw rate [rad/s]; slow where a foot still stands at an end."""
    start, stop = gait.first + 0.3 * gait.period, gait.last - 0.4 * gait.period

    def along(times: Array) -> Array:
        s = times - start
        span = stop - start
        # The integral of a speed that rises and falls linearly
        moved = np.interp(s, np.linspace(0.0, span, 401), _ramped(span, ramp))
        yaw = turn * moved
        if abs(turn) > 1e-9:
            x, y = speed / turn * np.sin(yaw), speed / turn * (1.0 - np.cos(yaw))
        else:
            x, y = speed * moved, np.zeros_like(moved)
        return np.stack((x, y, yaw), axis=1)

    return along


def _ramped(span: float, ramp: float) -> Array:
    """Time at full speed, at 401 instants of a span."""
    t = np.linspace(0.0, span, 401)
    speed = smooth(t / ramp) * smooth((span - t) / ramp)
    return np.concatenate(([0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(t))))


@dataclass(frozen=True)
class Style:
    """How a person moves.

    Attributes:
        lowered: of the pelvis below straight legs, share of the leg. bob: its bounce, twice a stride [m].
        sway: of the pelvis towards the standing foot [m]. lean: of the trunk ahead [rad].
        swing: of the arms [rad]. elbow: its bend [rad].
    """

    lowered: float = 0.06
    bob: float = 0.01
    sway: float = 0.02
    lean: float = 0.05
    swing: float = 0.4
    elbow: float = 0.4


def stepped(
    name: str,
    rate: float,
    size: float,
    path: Path,
    gait: Gait,
    limbs: Limbs,
    style: Style,
    end: float,
    height: Callable[[float], float] | None = None,
) -> Made:
    """A person on two feet along a path."""
    ground = height or (lambda _x: 0.0)
    person = Person(size, np.arange(round(end * rate) + 1) / rate)
    t = person.times
    over = path(t)
    stances = {
        f"{side}Foot": tuple(
            steps(path, gait, f"{side}Foot", 0.0, sign * 0.09 * size, lambda x: ground(x) + ANKLE * size)
        )
        for side, sign in (("Left", 1.0), ("Right", -1.0))
    }
    feet = {foot: limbs.over(t, stances[foot]) for foot in stances}
    moving = smooth((t - gait.first) / 0.4) * smooth((gait.last - t) / 0.4)
    phase = 2.0 * np.pi * (t - gait.first) / gait.period
    leg = size * (THIGH + SHANK)
    # On stairs the pelvis rises with the feet, over a stride
    floor = np.array([0.5 * (ground(x - 0.5 * RUN) + ground(x + 0.5 * RUN)) for x in over[:, 0]]) if height else 0.0 * t
    if height:
        window = np.hanning(2 * (round(0.4 * gait.period * rate) // 2) + 3)
        padded = np.pad(floor, len(window) // 2, mode="edge")
        floor = np.convolve(padded, window / window.sum(), mode="valid")
    side = moving * size * style.sway * np.sin(phase)
    up = size * (ANKLE + 0.02) + leg * (1.0 - style.lowered) + floor + moving * size * style.bob * np.cos(2.0 * phase)
    yaw = over[:, 2]
    pelvis = np.stack((over[:, 0] - side * np.sin(yaw), over[:, 1] + side * np.cos(yaw), up), axis=1)
    turn = turned(2, yaw + 0.08 * moving * np.sin(phase)) @ turned(0, 0.03 * moving * np.sin(phase))
    person.trunk(pelvis, turn, style.lean * (0.3 + 0.7 * moving), -0.5 * style.lean * moving)
    for foot, (ankle, foot_yaw, pitch, _) in feet.items():
        person.leg(foot.removesuffix("Foot"), ankle, foot_yaw, pitch)
    for arm, sign in (("Left", -1.0), ("Right", 1.0)):
        person.arm(
            arm, sign * style.swing * moving * np.sin(phase), 0.12 + 0.0 * t, 0.15 + style.elbow * (0.3 + 0.7 * moving)
        )
    made = person.made(name, rate, stances)
    return replace(made, heights=height)


def walk(seed: int = 0, rate: float = 60.0) -> Made:
    """Stand, walk straight ahead for about 4 s, stand."""
    random = np.random.default_rng(seed)
    size, speed, period = random.uniform(0.9, 1.12), random.uniform(0.6, 0.85), random.uniform(1.0, 1.2)
    gait = Gait(period, 0.62, {"LeftFoot": 0.0, "RightFoot": 0.5}, 0.5, 4.6)
    return stepped("walk", rate, size, line(size * speed, gait), gait, Limbs(0.08), Style(0.1), 5.2)


def run(seed: int = 0, rate: float = 60.0) -> Made:
    """Stand, run ahead with both feet in the air between steps, stand."""
    random = np.random.default_rng(seed)
    size, speed, period = random.uniform(0.9, 1.12), random.uniform(1.8, 2.3), random.uniform(0.66, 0.74)
    gait = Gait(period, 0.36, {"LeftFoot": 0.0, "RightFoot": 0.5}, 0.5, 3.6)
    style = Style(0.12, 0.03, 0.01, 0.15, 0.7, 1.3)
    return stepped("run", rate, size, line(size * speed, gait, ramp=1.0), gait, Limbs(0.22, 0.7), style, 4.2)


def turn(seed: int = 0, rate: float = 60.0) -> Made:
    """Walk round a curve, more than half a circle, to either side."""
    random = np.random.default_rng(seed)
    size, speed, rate_of_yaw = random.uniform(0.9, 1.12), random.uniform(0.3, 0.6), random.uniform(0.7, 1.0)
    gait = Gait(1.1, 0.62, {"LeftFoot": 0.0, "RightFoot": 0.5}, 0.5, 5.0)
    path = line(size * speed, gait, rate_of_yaw * random.choice((-1.0, 1.0)))
    return stepped("turn", rate, size, path, gait, Limbs(0.08), Style(0.09), 5.6)


def stairs(seed: int = 0, rate: float = 60.0) -> Made:
    """Climb five stairs from the ground, a stair a step."""
    random = np.random.default_rng(seed)
    size, period = random.uniform(0.95, 1.1), random.uniform(1.2, 1.4)
    rise, run_of_stair = RISE * size, RUN * size
    first_edge = 1.5 * run_of_stair
    count = 5

    def height(x: float) -> float:
        return rise * float(np.clip(np.floor((x - first_edge) / run_of_stair) + 1.0, 0, count))

    # A foot lands in the middle of every other stair: a stride is two stairs
    speed = 2.0 * run_of_stair / period
    gait = Gait(period, 0.6, {"LeftFoot": 0.0, "RightFoot": 0.5}, 0.5, 0.5 + 4.6 * period)

    def path(times: Array) -> Array:
        x = speed * np.clip(times - gait.first - 0.2 * period, 0.0, 4.0 * period)
        return np.stack((x, 0.0 * x, 0.0 * x), axis=1)

    made = stepped(
        "stairs", rate, size, path, gait, Limbs(0.10, 0.1), Style(0.15, 0.0, 0.02, 0.2), gait.last + 0.8, height
    )
    return made


def jump(seed: int = 0, rate: float = 60.0) -> Made:
    """Crouch, jump ahead with both feet, land, stand up."""
    random = np.random.default_rng(seed)
    size, air = random.uniform(0.9, 1.12), random.uniform(0.3, 0.42)
    ahead, lift = random.uniform(0.2, 0.5), 1.2
    land = lift + air
    t = np.arange(round(3.2 * rate) + 1) / rate
    person = Person(size, t)
    leg = size * (THIGH + SHANK)
    crouch, stand = 0.62, 0.95
    # Over the feet: down, up until the toes leave, flight, down, up
    speed_up = 0.5 * 9.81 * air
    down = stand - (stand - crouch) * smooth((t - 0.3) / 0.6)
    bent = crouch + _hermite((t - 0.9) / 0.3, 0.0, 0.93 - crouch, 0.0, 0.3 * speed_up / leg)
    landed = 0.93 + _hermite((t - land) / 0.35, 0.0, 0.7 - 0.93, -0.35 * speed_up / leg, 0.0)
    risen = 0.7 + (stand - 0.7) * smooth((t - land - 0.35) / 0.8)
    s = np.clip((t - lift) / air, 0.0, 1.0)
    flight = 0.5 * 9.81 * air**2 * s * (1.0 - s)
    legs = np.select([t < 0.9, t < lift, t < land, t < land + 0.35], [down, bent, 0.93 + 0.0 * t, landed], risen)
    over = ahead * smooth((t - 0.85) / (land - 0.55))
    pelvis = np.stack((over, 0.0 * t, size * (ANKLE + 0.02) + legs * leg + flight), axis=1)
    lean = 0.7 * smooth((t - 0.3) / 0.6) * smooth((lift - t) / 0.3) + 0.5 * smooth((t - land) / 0.35) * smooth(
        (land + 1.15 - t) / 0.8
    )
    person.trunk(pelvis, turned(1, 0.5 * lean), 0.5 * lean, -0.8 * lean)
    stances = {}
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        places = [(x, sign * 0.09 * size, ANKLE * size, 0.0) for x in (0.0, ahead)]
        stances[f"{side}Foot"] = (Stance(-1e3, lift, places[0]), Stance(land, 1e3, places[1]))
        ankle, yaw, _, _ = Limbs(0.0).over(t, stances[f"{side}Foot"])
        ankle[:, 0] = ahead * smooth(s)
        ankle[:, 2] += 1.1 * flight
        person.leg(side, ankle, yaw, 0.4 * np.sin(np.pi * s) ** 2)
        person.arm(
            side,
            2.0 * smooth((t - 0.8) / 0.5) * smooth((land + 0.4 - t) / 0.5) - 2.0 * (stand - down),
            0.2 + 0.0 * t,
            0.3 + 0.0 * t,
        )
    return person.made("jump", rate, stances)


def _hermite(s: Array, start: float, end: float, slope: float, slope_end: float) -> Array:
    """A cubic over [0, 1]."""
    s = np.clip(s, 0.0, 1.0)
    return (
        (2 * s**3 - 3 * s**2 + 1) * start
        + (3 * s**2 - 2 * s**3) * end
        + (s**3 - 2 * s**2 + s) * slope
        + (s**3 - s**2) * slope_end
    )


def sit(seed: int = 0, rate: float = 60.0) -> Made:
    """Sit down on a seat, stay, stand up; both feet stand all the time."""
    random = np.random.default_rng(seed)
    size, seat = random.uniform(0.9, 1.12), random.uniform(0.38, 0.50)
    t = np.arange(round(5.0 * rate) + 1) / rate
    person = Person(size, t)
    share = smooth((t - 0.5) / 1.4) * smooth((4.6 - t) / 1.4)
    leg = size * (THIGH + SHANK)
    stand = size * (ANKLE + 0.02) + 0.95 * leg
    # Back over the seat, and the trunk forward on the way
    pelvis = np.stack((-0.36 * size * share, 0.0 * t, stand + (size * seat + 0.1 - stand) * share), axis=1)
    lean = 0.9 * np.sin(np.pi * share) ** 2
    person.trunk(pelvis, turned(1, 0.3 * lean), 0.7 * lean + 0.05, -0.5 * lean)
    stances = {}
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        stances[f"{side}Foot"] = (Stance(-1e3, 1e3, (0.0, sign * 0.09 * size, ANKLE * size, 0.0)),)
        ankle, yaw, pitch, _ = Limbs().over(t, stances[f"{side}Foot"])
        person.leg(side, ankle, yaw, pitch)
        person.arm(side, 0.6 * share, 0.12 + 0.0 * t, 0.2 + 0.9 * share)
    return person.made("sit", rate, stances)


def crawl(seed: int = 0, rate: float = 60.0) -> Made:
    """On hands and feet ahead, one of the four in the air at a time; the feet stand on their toes."""
    random = np.random.default_rng(seed)
    size, speed, period = random.uniform(0.9, 1.12), random.uniform(0.15, 0.24), random.uniform(1.4, 1.8)
    phases = {"LeftFoot": 0.0, "LeftHand": 0.25, "RightFoot": 0.5, "RightHand": 0.75}
    gait = Gait(period, 0.76, phases, 0.5, 6.0)
    path = line(size * speed, gait)
    t = np.arange(round(6.6 * rate) + 1) / rate
    person = Person(size, t)
    over = path(t)
    pitch_of_foot = 0.7
    # The toe joint lies 0.02 above the ground while the foot is pitched about it
    height = size * (0.02 + 0.13 * np.sin(pitch_of_foot) + (ANKLE - 0.02) * np.cos(pitch_of_foot))
    pelvis = np.stack((over[:, 0], over[:, 1], size * (0.46 + 0.01 * np.sin(4.0 * np.pi * t / period))), axis=1)
    lean = 1.45 + 0.0 * t
    person.trunk(pelvis, turned(1, lean), 0.2 + 0.0 * t, -0.9 + 0.0 * t)
    stances = {}
    for limb in phases:
        sign = 1.0 if limb.startswith("Left") else -1.0
        ahead, aside, up = (-0.18, 0.10, height) if limb.endswith("Foot") else (0.60, 0.17, 0.03 * size)
        level = float(up)
        stances[limb] = tuple(steps(path, gait, limb, ahead * size, sign * aside * size, lambda _x, up=level: up))
        place, yaw, pitch, _ = Limbs(0.06, 0.0).over(t, stances[limb])
        if limb.endswith("Foot"):
            person.leg(limb.removesuffix("Foot"), place, yaw, pitch_of_foot + pitch, -pitch_of_foot)
        else:
            person.reach(limb.removesuffix("Hand"), place, yaw)
    return person.made("crawl", rate, stances)


def push_ups(seed: int = 0, rate: float = 60.0) -> Made:
    """Two push-ups on hands and toes, which all stand all the time."""
    random = np.random.default_rng(seed)
    size, t = random.uniform(0.9, 1.12), np.arange(round(5.0 * rate) + 1) / rate
    person, pitch = Person(size, t), 0.9
    down = random.uniform(0.05, 0.08) * np.sin(2.0 * np.pi * np.clip((t - 0.5) / 4.0, 0.0, 1.0)) ** 2
    pelvis = np.stack((0.0 * t, 0.0 * t, size * (0.42 - down)), axis=1)
    person.trunk(pelvis, turned(1, 1.35 + 0.0 * t), 0.05 + 0.0 * t, -0.6 + 0.0 * t)
    height = size * (0.02 + 0.13 * np.sin(pitch) + (ANKLE - 0.02) * np.cos(pitch))
    stances = {}
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        stances[f"{side}Foot"] = (Stance(-1e3, 1e3, (-0.72 * size, sign * 0.09 * size, height, 0.0)),)
        stances[f"{side}Hand"] = (Stance(-1e3, 1e3, (0.48 * size, sign * 0.20 * size, 0.03 * size, 0.0)),)
        foot, hand = (Limbs(0.0, 0.0).over(t, stances[f"{side}{end}"]) for end in ("Foot", "Hand"))
        person.leg(side, foot[0], foot[1], pitch + 0.0 * t, -pitch)
        person.reach(side, hand[0], hand[1])
    return person.made("push_ups", rate, stances)


def dance(seed: int = 0, rate: float = 60.0) -> Made:
    """Steps in random directions and turns on a beat, with trunk, arms and head moving."""
    random = np.random.default_rng(seed)
    size, beat = random.uniform(0.9, 1.12), random.uniform(0.45, 0.6)
    count = 10
    end = 1.0 + count * beat + 0.8
    t = np.arange(round(end * rate) + 1) / rate
    person = Person(size, t)
    stances: dict[str, list[Stance]] = {}
    pelvis_at, pelvis_of = [0.0, 0.7], [np.zeros(3), np.zeros(3)]
    place = {side: np.array([0.0, sign * 0.09 * size, 0.0]) for side, sign in (("Left", 1.0), ("Right", -1.0))}
    for side, at in place.items():
        stances[f"{side}Foot"] = [Stance(-1e3, 1e3, (at[0], at[1], ANKLE * size, at[2]))]
    for number in range(count):
        side, other = ("Left", "Right") if number % 2 == 0 else ("Right", "Left")
        sign = 1.0 if side == "Left" else -1.0
        yaw = place[other][2] + random.uniform(-0.35, 0.35)
        ahead, aside = random.uniform(-0.2, 0.2), random.uniform(0.16, 0.28) * sign
        turn_of = turned(2, yaw)[:2, :2]
        place[side] = np.array([*(place[other][:2] + turn_of @ (size * np.array([ahead, aside]))), yaw])
        lift = 0.8 + number * beat
        land = lift + 0.7 * beat
        last = stances[f"{side}Foot"].pop()
        at = place[side]
        stances[f"{side}Foot"] += [replace(last, lift=lift), Stance(land, 1e3, (at[0], at[1], ANKLE * size, at[2]))]
        pelvis_at.append(land)
        pelvis_of.append(0.5 * (place["Left"] + place["Right"]))
    pelvis_at.append(end + 1.0)
    pelvis_of.append(pelvis_of[-1])
    over = np.zeros((len(t), 3))
    for start, stop, before, after in zip(pelvis_at, pelvis_at[1:], pelvis_of, pelvis_of[1:], strict=False):
        inside = (t >= start) & (t <= stop)
        over[inside] = before + smooth((t[inside] - start) / (stop - start))[:, None] * (after - before)
    moving = smooth((t - 0.6) / 0.6) * smooth((end - 0.2 - t) / 0.6)

    def waves(amplitude: float) -> Array:
        out = np.zeros(len(t))
        for harmonic in (1, 2):
            share, late = random.uniform(0.3, 1.0) / harmonic, random.uniform(0.0, 6.28)
            out += amplitude * share * np.sin(np.pi * harmonic * t / beat + late)
        return moving * out

    up = size * (ANKLE + 0.02 + (THIGH + SHANK) * (0.86 + waves(0.02)))
    pelvis = np.stack((over[:, 0], over[:, 1], up), axis=1)
    turn_of_pelvis = turned(2, over[:, 2] + waves(0.1)) @ turned(0, waves(0.06)) @ turned(1, waves(0.06))
    person.trunk(pelvis, turn_of_pelvis, 0.1 + waves(0.15), waves(0.15))
    for side in place:
        ankle, yaw, pitch, _ = Limbs(0.10, 0.25).over(t, stances[f"{side}Foot"])
        person.leg(side, ankle, yaw, pitch)
        person.arm(side, waves(0.9), 0.4 + np.abs(0.0 * t) + waves(0.35), 0.9 + waves(0.5))
    return person.made("dance", rate, {limb: tuple(steps_of) for limb, steps_of in stances.items()})


def dog(seed: int = 0, rate: float = 60.0) -> Made:
    """A dog trots ahead: feet crosswise, two in stance at least."""
    random = np.random.default_rng(seed)
    size, speed, period = random.uniform(0.7, 1.2), random.uniform(0.5, 0.9), random.uniform(0.5, 0.6)
    phases = {"LeftFoot": 0.0, "RightHand": 0.0, "RightFoot": 0.5, "LeftHand": 0.5}
    gait = Gait(period, 0.55, phases, 0.5, 3.6)
    path = line(size * speed, gait)
    t = np.arange(round(4.2 * rate) + 1) / rate
    person = Person(size, t)
    person.skeleton = skeleton(DOG_BONES, size)
    over = path(t)
    level = turned(2, over[:, 2])
    person.points["Hips"] = np.stack((over[:, 0], over[:, 1], 0.42 * size + 0.0 * t), axis=1)
    person.turns["Hips"] = level
    for joint in ("Spine", "Spine1", "Neck", "Head"):
        person.place(joint, level)
    stances = {}
    for limb in phases:
        side = limb.removesuffix("Foot").removesuffix("Hand")
        sign = 1.0 if side == "Left" else -1.0
        ahead, chain = (0.0, ("UpLeg", "Leg", "Foot")) if limb.endswith("Foot") else (0.45, ("Arm", "ForeArm", "Hand"))
        stances[limb] = tuple(steps(path, gait, limb, ahead * size, sign * 0.08 * size, lambda _x: 0.02 * size))
        ankle, _, _, _ = Limbs(0.06 * size, 0.0).over(t, stances[limb])
        bend = level[:, :, 0] if limb.endswith("Foot") else -level[:, :, 0]
        person.place(f"{side}{chain[0]}", level)
        first, second, hinge = two_bones(person.points[f"{side}{chain[0]}"], ankle, bend, (0.22 * size, 0.21 * size))
        hinge = hinge if limb.endswith("Foot") else -hinge
        person.turns[f"{side}{chain[0]}"] = columns(np.cross(hinge, -first), hinge, -first)
        person.place(f"{side}{chain[1]}", columns(np.cross(hinge, -second), hinge, -second))
        person.place(f"{side}{chain[2]}", level)
    return person.made("dog", rate, stances)


#: Every kind of motion of a person, by name
MOTIONS: dict[str, Callable[..., Made]] = {
    "walk": walk,
    "run": run,
    "turn": turn,
    "crawl": crawl,
    "jump": jump,
    "stairs": stairs,
    "sit": sit,
    "dance": dance,
}


def noisy(clip: Clip, seed: int, size: float = 0.003) -> Clip:
    """Points with noise of a standard deviation [m], as of markers; without rotations."""
    random = np.random.default_rng(seed)
    return replace(clip, points=clip.points + random.normal(0.0, size, clip.points.shape), turns=None)


def gappy(clip: Clip, seed: int, count: int = 12, longest: int = 15) -> Array:
    """The points with NaN where a joint is lost, ``count`` times for up to ``longest`` frames."""
    random = np.random.default_rng(seed)
    points = clip.points.copy()
    for _ in range(count):
        joint, start = random.integers(points.shape[1]), random.integers(1, len(points) - longest - 1)
        points[start : start + random.integers(1, longest + 1), joint] = np.nan
    return points


def swapped(clip: Clip, seed: int, pairs: int = 2) -> tuple[Array, list[tuple[int, int, int, int]]]:
    """The points with left and right joints swapped over stretches, and (joint, joint, start, stop) of each."""
    random = np.random.default_rng(seed)
    points = clip.points.copy()
    names = clip.skeleton.names
    lefts = [name for name in ("LeftFoot", "LeftHand", "LeftLeg", "LeftForeArm") if name in names]
    swaps = []
    for left in random.permutation(lefts)[:pairs]:
        one, other = names.index(left), names.index(left.replace("Left", "Right"))
        start = int(random.integers(5, len(points) // 2))
        stop = int(start + random.integers(5, len(points) // 3))
        points[start:stop, [one, other]] = points[start:stop, [other, one]]
        swaps.append((one, other, start, stop))
    return points, swaps


#: Files' axes -> rotation from them to z up, x forward
AXES = {"z": np.eye(3), "y": np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])}


def bvh(
    clip: Clip, up: str = "y", unit_of_length: float = 0.01, order: str = "ZYX", digits: int = 9, every: bool = False
) -> str:
    """The clip as a BVH file.

    Args:
        up: the axis that is up in the file, ``"y"`` (z forward) or ``"z"`` (x forward).
        unit_of_length: of the file [m]. order: of the rotation channels. every: position channels at every joint.
    """
    skeleton_of, turns = clip.skeleton, clip.turns
    assert turns is not None
    to_world = AXES[up]
    offsets = skeleton_of.offsets @ to_world / unit_of_length
    in_file = np.einsum("ji,fnjk,kl->fnil", to_world, turns, to_world)
    children: dict[int, list[int]] = {}
    for number, parent in enumerate(skeleton_of.parents):
        children.setdefault(parent, []).append(number)
    lines, ordered = ["HIERARCHY"], []
    turning = " ".join(f"{axis}rotation" for axis in order)

    def write(number: int, depth: int) -> None:
        tab = "\t" * depth
        kind = "ROOT" if number == 0 else "JOINT"
        lines.append(f"{tab}End Site" if skeleton_of.ends[number] else f"{tab}{kind} {skeleton_of.names[number]}")
        shown = np.zeros(3) if number == 0 else offsets[number]
        lines.extend((f"{tab}{{", f"{tab}\tOFFSET " + " ".join(f"{x:.{digits}f}" for x in shown)))
        if not skeleton_of.ends[number]:
            moves = number == 0 or every
            lines.append(
                f"{tab}\tCHANNELS {6 if moves else 3} {'Xposition Yposition Zposition ' if moves else ''}{turning}"
            )
            ordered.append((number, moves))
            for child in children.get(number, []):
                write(child, depth + 1)
        lines.append(f"{tab}}}")

    write(0, 0)
    values = []
    for number, moves in ordered:
        parent = skeleton_of.parents[number]
        if moves:
            place = (
                clip.points[:, 0] @ to_world / unit_of_length
                if number == 0
                else np.tile(offsets[number], (len(turns), 1))
            )
            values.append(place)
        own = in_file[:, number] if parent < 0 else np.swapaxes(in_file[:, parent], 1, 2) @ in_file[:, number]
        values.append(np.degrees(euler(own, order)))
    table = np.concatenate(values, axis=1)
    lines += ["MOTION", f"Frames: {len(table)}", f"Frame Time: {1.0 / clip.rate:.9f}"]
    lines += [" ".join(f"{x:.{digits}f}" for x in row) for row in table]
    return "\n".join(lines) + "\n"


def euler(rotations: Array, order: str) -> Array:
    """Angles of R = R_a R_b R_c about the axes of the order [..., 3] [rad]."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(rotations).as_euler(order))
