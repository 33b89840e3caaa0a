"""What comes of a clip: a motion of a robot, and how good it is."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wbc.multibody import pin
from wbc.retarget.clip import Array, Clip
from wbc.retarget.plan import MotionPlan
from wbc.retarget.robot_body import RobotBody
from wbc.retarget.stances import Marks, intervals
from wbc.robot import Robot

#: Limits are kept to this share, which is what rounding leaves
ROUNDING = 1e-6


@dataclass(frozen=True)
class GivenUp:
    """What was not served, and when.

    Attributes:
        name: of the limb or the row that gave way. start, end: of the time [s]. reason: in words.
    """

    name: str
    start: float
    end: float
    reason: str

    def __str__(self) -> str:
        return f"{self.name} from {self.start:.2f} to {self.end:.2f} s: {self.reason}"


@dataclass(frozen=True)
class MotionErrors:
    """How good a motion is, at its frames.

    Attributes:
        points: key point -> distance from its target at each frame [frames] [m].
        slide: limb -> how far its contact moves in a stance at most [m].
        penetration: how far a foot or a hand is below the ground at most [m].
        position, velocity, acceleration: how many numbers are beyond their limits.
        jumps: at how many frames a joint turns by more than its limit of velocity allows from frame to frame.
    """

    points: dict[str, Array]
    slide: dict[str, float]
    penetration: float
    position: int
    velocity: int
    acceleration: int
    jumps: int

    @property
    def mean(self) -> float:
        """Mean distance of all key points from their targets [m]."""
        return float(np.mean([values.mean() for values in self.points.values()]))

    def __str__(self) -> str:
        worst = max(self.points, key=lambda name: float(self.points[name].max()))
        return (
            f"key points {1e3 * self.mean:.1f} mm in the mean, "
            f"{worst} {1e3 * self.points[worst].max():.0f} mm at most; "
            f"slide {1e3 * max(self.slide.values(), default=0.0):.3f} mm, penetration {1e3 * self.penetration:.3f} mm; "
            f"beyond limits: position {self.position}, velocity {self.velocity}, acceleration {self.acceleration}; "
            f"jumps {self.jumps}"
        )


@dataclass(frozen=True, eq=False)
class Retargeted:
    """A motion of a robot.

    Attributes:
        robot: with the limits that were kept, and frames ``retarget_...`` at pelvis, chest, feet and hands.
        rate: frames a second [Hz]. time: of the frames [s].
        q: configurations, the root's pose first [frames, nq].
        stance: limb -> whether its contact stands [frames].
        given_up: what was not served, in the order of time.
        notes: what was found in the clip, and of the correspondence.
        clip: that the motion follows.
        body: limbs of the robot. plan: targets of the ticks. every: a frame is so many ticks.
        all_q: configurations at all ticks [ticks, nq].
    """

    robot: Robot
    rate: float
    time: Array
    q: Array
    stance: dict[str, Marks]
    given_up: tuple[GivenUp, ...]
    notes: tuple[str, ...]
    clip: Clip
    body: RobotBody
    plan: MotionPlan
    every: int
    all_q: Array

    @property
    def v(self) -> Array:
        """Velocities from frame to frame [frames - 1, nv]."""
        return rates(self.robot, self.q, 1.0 / self.rate)

    @cached_property
    def errors(self) -> MotionErrors:
        """See :class:`MotionErrors`."""
        return measured(self)


def rates(robot: Robot, q: Array, dt: float) -> Array:
    """Velocities that lead from each configuration to the next one [frames - 1, nv]."""
    pairs = itertools.pairwise(q)
    return np.array([pin.difference(robot.model, a, b) for a, b in pairs]).reshape(-1, robot.nv) / dt


def frame_poses(robot: Robot, names: tuple[str, ...], q: Array) -> tuple[Array, Array]:
    """Rotations [frames, names, 3, 3] and positions [frames, names, 3] of frames of a robot."""
    model, data = robot.model, robot.model.createData()
    numbers = [int(model.getFrameId(name)) for name in names]
    rotations, positions = np.empty((len(q), len(names), 3, 3)), np.empty((len(q), len(names), 3))
    for k, configuration in enumerate(q):
        pin.forwardKinematics(model, data, configuration)
        for i, number in enumerate(numbers):
            pose = pin.updateFramePlacement(model, data, number)
            rotations[k, i], positions[k, i] = pose.rotation, pose.translation
    return rotations, positions


def measured(motion: Retargeted) -> MotionErrors:
    """Measure a motion against its plan, the ground and the robot's limits."""
    body, robot, plan, every = motion.body, motion.robot, motion.plan, motion.every
    targets: dict[str, tuple[str, Array]] = {}
    if robot.base != "fixed":
        targets["pelvis"] = (body.pelvis, plan.pelvis)
    for name, limb in plan.limbs.items():
        own = body.limbs[name]
        if body.plan.upright and own.middle:
            targets[f"{name} middle"] = (own.middle, limb.middle)
        if own.wrist and name.endswith("arm"):
            targets[f"{name} wrist"] = (own.wrist, limb.wrist)
        targets[name] = (own.end, limb.end)
    rotations, positions = frame_poses(robot, tuple(frame for frame, _ in targets.values()), motion.q)
    points = {
        name: np.linalg.norm(positions[:, i] - target[::every], axis=1)
        for i, (name, (_, target)) in enumerate(targets.items())
    }
    slide, lowest = {}, 0.0
    names = list(targets)
    for name in plan.limbs:
        place = positions[:, names.index(name)]
        runs = intervals(motion.stance[name])
        slide[name] = max((float(np.linalg.norm(place[a:b] - place[a], axis=1).max()) for a, b in runs), default=0.0)
        if robot.base != "fixed":
            low = np.einsum("tij,kj->tki", rotations[:, names.index(name)], body.limbs[name].corners)[..., 2]
            heights = (low + place[:, None, 2]).min(axis=1) - body.limbs[name].radius
            lowest = min(lowest, float(heights.min()))
    v = rates(robot, motion.all_q, plan.dt)
    a = np.diff(v, axis=0) / plan.dt
    limits, index = robot.limits, robot.position_index
    known = index >= 0
    turned = motion.q[:, index[known]]
    low, high = limits.position_lower[known], limits.position_upper[known]
    outside = (turned < low - ROUNDING) | (turned > high + ROUNDING)
    fast = np.abs(v) > limits.velocity * (1.0 + ROUNDING)
    far = np.abs(motion.v) > limits.velocity * (1.0 + ROUNDING)
    return MotionErrors(
        points=points, slide=slide, penetration=-lowest, position=int(outside.sum()), velocity=int(fast.sum()),
        acceleration=int((np.abs(a) > limits.acceleration * (1.0 + ROUNDING) + ROUNDING).sum()),
        jumps=int(far.any(axis=1).sum()),
    )  # fmt: skip
