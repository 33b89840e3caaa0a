"""The chains, and what a contender is given of each: a URDF, random reachable poses, the joint vector to start from.

A chain is an arm of a robot of the example-robot-data wheel; the joints that are not the arm's are fixed at zero.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin

from bench.descriptions import write_urdf
from bench.problems import Array
from wbc.robot.sources.files import example_data_folder


@dataclass(frozen=True)
class Chain:
    """One arm.

    Attributes:
        name: short name.
        file: URDF below the wheel's robots.
        arm: what the names of its joints begin with; "": all joints but fingers.
        tip: frame whose pose is asked for.
        published: rate of TRAC-IK that its authors publish [%]; None: they publish none.
    """

    name: str
    file: str
    tip: str
    arm: str = ""
    published: float | None = None


CHAINS = (
    Chain("Panda", "panda_description/urdf/panda.urdf", "panda_hand_tcp", published=99.88),
    Chain("UR5", "ur_description/urdf/ur5_robot.urdf", "tool0", published=99.17),
    Chain("UR10", "ur_description/urdf/ur10_robot.urdf", "tool0", published=99.33),
    Chain("Jaco2", "kinova_description/robots/kinova.urdf", "j2s6s200_end_effector", published=99.92),
    Chain("PR2 arm", "pr2_description/urdf/pr2.urdf", "r_gripper_tool_frame", "r_", published=99.96),
    Chain("Baxter arm", "baxter_description/urdf/baxter.urdf", "left_gripper", "left_", published=99.83),
    Chain("xArm7", "xarm_description/urdf/xarm7.urdf", "link_eef"),
    Chain("TALOS arm", "talos_data/robots/talos_reduced.urdf", "gripper_left_base_link", "arm_left_"),
)


@dataclass(frozen=True)
class Problem:
    """What a contender gets: joint vectors are angles [count, joints], also of joints without limits."""

    chain: Chain
    urdf: Path
    joints: list[str]
    lower: Array
    upper: Array
    start: Array
    poses: Array


def prepare(chain: Chain, folder: Path, count: int, seed: int) -> Problem:
    """Write the URDF and draw the poses: those of joint vectors that are uniform within the limits (+-pi without)."""
    source, urdf = example_data_folder() / chain.file, folder / f"{chain.name.replace(' ', '_')}.urdf"
    joints = [
        j for j in ET.parse(source).getroot().iter("joint") if j.get("type") in ("revolute", "continuous", "prismatic")
    ]
    names = [str(j.get("name")) for j in joints]
    unwanted = [n for n in names if not n.startswith(chain.arm) or "finger" in n or "gripper" in n]
    write_urdf(source, urdf, locked=unwanted)
    model = pin.buildModelFromUrdf(str(urdf))
    joints_left = [str(n) for n in list(model.names)[1:]]
    # the bounds of an unbounded joint in q are those of its cosine
    free = np.array([int(j.nq) == 2 for j in list(model.joints)[1:]])
    at = np.array([int(j.idx_q) for j in list(model.joints)[1:]])
    lower = np.where(free, -np.pi, model.lowerPositionLimit[at])
    upper = np.where(free, np.pi, model.upperPositionLimit[at])
    random = np.random.default_rng(seed)
    data, frame = model.createData(), model.getFrameId(chain.tip)
    poses = np.zeros((count, 4, 4))
    for k, angles in enumerate(random.uniform(lower, upper, (count, len(lower)))):
        pin.framesForwardKinematics(model, data, configuration(model, angles))
        poses[k] = data.oMf[frame].homogeneous
    return Problem(chain, urdf, joints_left, lower, upper, 0.5 * (lower + upper), poses)


def configuration(model: pin.Model, angles: Array) -> Array:
    """Pinocchio's q of a joint vector."""
    q = np.array(pin.neutral(model))
    for joint, angle in zip(list(model.joints)[1:], angles, strict=True):
        if int(joint.nq) == 2:
            q[int(joint.idx_q) : int(joint.idx_q) + 2] = np.cos(angle), np.sin(angle)
        else:
            q[int(joint.idx_q)] = angle
    return q


class Judge:
    """Whether an answer counts, by Pinocchio: every component of the position's error and of the rotation's, as
    log3 in the axes of the base, is within the tolerance, as TRAC-IK compares twists; and the limits are kept.
    """

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        self._model = pin.buildModelFromUrdf(str(problem.urdf))
        self._data, self._frame = self._model.createData(), self._model.getFrameId(problem.chain.tip)

    def accepts(self, q: Array, pose: Array, tolerance: float) -> bool:
        """Judge Pinocchio's q."""
        pin.framesForwardKinematics(self._model, self._data, q)
        here = self._data.oMf[self._frame]
        turn = pose[:3, :3] @ pin.log3(pose[:3, :3].T @ here.rotation)
        off = np.abs(np.concatenate([here.translation - pose[:3, 3], turn])).max()
        low, high = self._model.lowerPositionLimit, self._model.upperPositionLimit
        return bool(off <= tolerance + 1e-9 and (q >= low - 1e-9).all() and (q <= high + 1e-9).all())
