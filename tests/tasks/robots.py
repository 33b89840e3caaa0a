"""Robots of the task tests and the frames that their tasks speak of."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pinocchio as pin

import wbc.robots
from tests.constraints.robots import with_test_shapes
from wbc.robot import Coupling, Robot

#: Fixed arms, one with unbounded joints, and a humanoid with a floating base
NAMES = ("panda", "ur5", "kinova", "talos")


@dataclass(frozen=True)
class Frames:
    """``tip`` moves with the whole arm, ``middle`` with a part of it; ``base`` is a moving frame elsewhere."""

    tip: str
    middle: str
    base: str
    plane: tuple[str, str, str]
    axis: str


FRAMES = {
    "panda": Frames(
        "panda_hand_tcp", "panda_link4", "panda_link2", ("panda_link2", "panda_link4", "panda_link6"), "panda_joint4"
    ),
    "ur5": Frames(
        "tool0", "forearm_link", "upper_arm_link", ("upper_arm_link", "forearm_link", "wrist_1_link"), "elbow_joint"
    ),
    "kinova": Frames(
        "j2s6s200_end_effector",
        "j2s6s200_link_3",
        "j2s6s200_link_2",
        ("j2s6s200_link_2", "j2s6s200_link_3", "j2s6s200_link_5"),
        "j2s6s200_joint_3",
    ),
    "talos": Frames(
        "gripper_left_base_link",
        "arm_left_4_link",
        "right_sole_link",
        ("arm_left_2_link", "arm_left_4_link", "arm_left_6_link"),
        "arm_left_4_joint",
    ),
}


@cache
def robot(name: str) -> Robot:
    """A robot with collision shapes on a few links, a coupling of its last two joints, and an undriven direction."""
    plain = with_test_shapes(wbc.robots.load(name))
    return replace(plain, couplings=(Coupling(plain.nv - 1, plain.nv - 2, 0.5, 0.1),), locked_dofs=(1,))


def random_configuration(robot: Robot, rng: np.random.Generator) -> np.ndarray:
    """Anywhere on the manifold within 2.5 rad or 1 m of neutral; quaternions and circles anywhere."""
    spread = np.where(np.array(robot.dof_units) == "m", 1.0, 2.5)
    return pin.integrate(robot.model, robot.neutral, spread * rng.uniform(-1.0, 1.0, robot.nv))


def velocity(robot: Robot, frame: str, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Twist (linear; angular) of a frame at its origin, world axes, by Pinocchio."""
    if frame == "world":
        return np.zeros(6)
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, q, v)
    frame_id = robot.model.getFrameId(frame)
    pin.updateFramePlacement(robot.model, data, frame_id)
    return pin.getFrameVelocity(robot.model, data, frame_id, pin.LOCAL_WORLD_ALIGNED).vector
