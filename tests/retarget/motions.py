"""Parts of clips, skeletons of other proportions, and what a motion is measured with here: Pinocchio alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tests.retarget import clips
from wbc.multibody import pin
from wbc.retarget import Clip, Retargeted, Skeleton
from wbc.robot.geometry.link_balls import LinkBalls

Array = NDArray[np.float64]


def part(clip: Clip, start: float, end: float) -> Clip:
    """A clip from one time to another [s]."""
    a, b = int(start * clip.rate), int(end * clip.rate) + 1
    turns = None if clip.turns is None else clip.turns[a:b]
    return replace(clip, points=clip.points[a:b], turns=turns, seen=clip.seen[a:b])


def pointed(clip: Clip) -> Clip:
    """A clip of points alone."""
    return replace(clip, turns=None)


def nameless(skeleton: Skeleton) -> Skeleton:
    """A skeleton whose names say nothing."""
    return replace(skeleton, names=tuple(f"p{k}" for k in range(len(skeleton.names))))


def turned(clip: Clip, yaw: float) -> Clip:
    """A clip, and its rest, about the vertical."""
    r = clips.turned(2, yaw)
    skeleton = replace(clip.skeleton, offsets=clip.skeleton.offsets @ r.T)
    turns = None if clip.turns is None else r @ clip.turns @ r.T
    return replace(clip, skeleton=skeleton, points=clip.points @ r.T, turns=turns)


def places(motion: Retargeted, frame: str) -> tuple[Array, Array]:
    """Rotations and positions of a frame at all frames of a motion."""
    model, data = motion.robot.model, motion.robot.model.createData()
    number = model.getFrameId(frame)
    rotations, positions = [], []
    for q in motion.q:
        pin.framesForwardKinematics(model, data, q)
        rotations.append(np.array(data.oMf[number].rotation))
        positions.append(np.array(data.oMf[number].translation))
    return np.array(rotations), np.array(positions)


def lowest(balls: LinkBalls, pose: pin.SE3) -> float:
    """Height of the lowest point of a link's balls where its joint has this pose [m]."""
    return float((balls.centers @ pose.rotation[2] + pose.translation[2] - balls.radii).min())


def largest_slide(motion: Retargeted, limb: str) -> float:
    """How far a contact moves while its limb stands [m]."""
    _, positions = places(motion, motion.body.limbs[limb].end)
    worst, start = 0.0, None
    for k, stands in enumerate(motion.stance[limb]):
        start = None if not stands else k if start is None else start
        if start is not None:
            worst = max(worst, float(np.linalg.norm(positions[k] - positions[start])))
    return worst


def breaches(motion: Retargeted) -> tuple[int, int, int]:
    """Numbers beyond limits of position, velocity and acceleration, of joints and base, from frame to frame."""
    robot, dt = motion.robot, 1.0 / motion.rate
    v = np.array([pin.difference(robot.model, a, b) / dt for a, b in zip(motion.q[:-1], motion.q[1:], strict=True)])
    a = np.diff(v, axis=0) / dt
    index, limits = robot.position_index, robot.limits
    known = index >= 0
    q = motion.q[:, index[known]]
    outside = (q < limits.position_lower[known] - 1e-6) | (q > limits.position_upper[known] + 1e-6)
    fast = np.abs(v) > limits.velocity * (1.0 + 1e-6)
    return int(outside.sum()), int(fast.sum()), int((np.abs(a) > limits.acceleration * (1.0 + 1e-6) + 1e-6).sum())
