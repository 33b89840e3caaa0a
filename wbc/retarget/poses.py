"""Where frames of a robot are at many configurations at once."""

from __future__ import annotations

import numpy as np

from wbc.multibody import pin
from wbc.multibody.rotations import skew
from wbc.retarget.clip import Array
from wbc.robot import Robot
from wbc.rotations import matrices
from wbc.symbolic.joint_steps import JointKind, JointStep, joint_steps


def frame_poses(robot: Robot, names: tuple[str, ...], q: Array) -> tuple[Array, Array]:
    """Rotations [n, names, 3, 3] and positions [n, names, 3] [m] of frames at configurations [n, nq]."""
    model = robot.model
    frames = [model.frames[int(model.getFrameId(name))] for name in names]
    poses = {0: (np.broadcast_to(np.eye(3), (len(q), 3, 3)), np.zeros((len(q), 3)))}
    for joint in sorted({int(j) for frame in frames for j in model.supports[int(frame.parentJoint)]} - {0}):
        pose = _placed(*poses[int(model.parents[joint])], model.jointPlacements[joint])
        for step in joint_steps(model, joint):
            pose = _stepped(*pose, step, q)
        poses[joint] = pose
    placed = [_placed(*poses[int(frame.parentJoint)], frame.placement) for frame in frames]
    return np.stack([turn for turn, _ in placed], axis=1), np.stack([place for _, place in placed], axis=1)


def _turned(turns: Array, by: Array) -> Array:
    """Products with one matrix, as one product."""
    return (turns.reshape(-1, 3) @ by).reshape(-1, 3, 3)


def _placed(turns: Array, places: Array, by: pin.SE3) -> tuple[Array, Array]:
    return _turned(turns, np.asarray(by.rotation)), places + turns @ np.asarray(by.translation)


def _stepped(turns: Array, places: Array, step: JointStep, q: Array) -> tuple[Array, Array]:
    """Poses after one step of a joint."""
    axis, (scale, offset), own = step.numbers[:3], step.numbers[3:5], q[:, step.q :]
    if step.kind is JointKind.PLACE:
        return _turned(turns, step.numbers[:9].reshape(3, 3)), places + turns @ step.numbers[9:]
    if step.kind is JointKind.QUATERNION:
        return turns @ matrices(own[:, :4]), places
    angle = np.arctan2(own[:, 1], own[:, 0]) if step.kind in (JointKind.CIRCLE, JointKind.FOLLOW) else own[:, 0]
    by = angle if step.kind is JointKind.CIRCLE else scale * angle + offset
    if step.kind is JointKind.SHIFT:
        return turns, places + by[:, None] * (turns @ axis)
    # Rodrigues' formula about one axis
    across = _turned(turns, skew(axis))
    twice = _turned(across, skew(axis))
    return turns + np.sin(by)[:, None, None] * across + (1.0 - np.cos(by))[:, None, None] * twice, places
