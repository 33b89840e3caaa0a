"""Arms in the tree of a robot's joints: where they begin and end, what carries them, what is no arm."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from wbc.coordinates.arms.arm_parts import MissingPartError
from wbc.robot import Robot
from wbc.symbolic.kinematics import joint_of

#: A branch of fewer joints is a finger or a head, not an arm
SHORTEST = 3


@dataclass(frozen=True)
class Chain:
    """Joints of an arm, from its base on, and the frame at its end ("" for the last joint itself).

    Attributes:
        prefix: for names, where there are several arms. joints: numbers in the model. tip: frame.
    """

    prefix: str
    joints: tuple[int, ...]
    tip: str


@dataclass(frozen=True)
class Chains:
    """Arms of a robot, the joints that carry several of them, and all others."""

    arms: tuple[Chain, ...]
    trunk: tuple[int, ...]
    others: tuple[int, ...]


def chains_of(robot: Robot) -> Chains:
    """The arms of a robot that stands somewhere.

    An arm ends at a frame with the role ``tip``, ``other_tip`` or ``..._hand``, else where the tree ends; branches
    of fewer than :data:`SHORTEST` joints at its end are fingers. What several arms have in common is their trunk.

    Raises:
        MissingPartError: a base that flies or drives with the arm, or no joint that moves.
    """
    if robot.base == "floating":
        raise MissingPartError.of("robot", robot.name, "base that stands somewhere; it floats")
    parents = [int(p) for p in robot.model.parents]
    first = 1 if robot.base == "fixed" else 2
    ends = _named_ends(robot) or _leaves(robot, parents, first)
    paths = {end: _path(parents, joint, first) for end, joint in ends.items()}
    paths = {end: path for end, path in paths.items() if path}
    if not paths:
        raise MissingPartError.of("robot", robot.name, "joint that moves an arm")
    shared = {j for path in paths.values() for j in path if sum(j in other for other in paths.values()) > 1}
    own = {end: [j for j in path if j not in shared] for end, path in paths.items()}
    long = {end: joints for end, joints in own.items() if len(joints) >= SHORTEST}
    if len(long) > 1:
        trunk = tuple(j for j in next(iter(paths.values())) if j in shared)
        arms = tuple(Chain(prefix, tuple(joints), tip) for (prefix, tip), joints in long.items())
    else:
        (_, tip), joints = max(paths.items(), key=lambda item: len(item[1]))
        trunk, arms = (), (Chain("", tuple(joints), tip),)
    used = {*trunk, *(j for arm in arms for j in arm.joints)}
    return Chains(arms, trunk, tuple(j for j in range(1, robot.model.njoints) if j not in used))


def single(robot: Robot, joints: Iterable[int]) -> None:
    """Joints of an arm have one coordinate each, and none follows another.

    Raises:
        MissingPartError: else; it names the joint.
    """
    followers = {c.follower: c.leader for c in robot.couplings}
    for j in joints:
        name, dof = str(robot.model.names[j]), int(robot.model.idx_vs[j])
        if int(robot.model.nvs[j]) != 1:
            raise MissingPartError.of(
                "robot", robot.name, f"arm of joints with one coordinate each: {name!r} has {robot.model.nvs[j]}"
            )
        if dof in followers:
            leader = robot.dof_names[followers[dof]]
            raise MissingPartError.of(
                "robot", robot.name, f"arm of joints that move alone: {name!r} follows {leader!r}"
            )


def _named_ends(robot: Robot) -> dict[tuple[str, str], int]:
    """(prefix, frame) -> joint, of frames whose roles say that an arm ends there."""
    roles = [role for role in ("tip", "other_tip") if role in robot.frames]
    roles = roles or [role for role in robot.frames if role.endswith("_hand")]
    out = {}
    for k, role in enumerate(roles, start=1):
        prefix = role.removesuffix("hand") if role.endswith("_hand") else f"arm{k}_"
        frame = robot.frames[role]
        joint = joint_of(robot.model, frame)
        if joint > 0:
            out[prefix if len(roles) > 1 else "", frame] = joint
    return out


def _leaves(robot: Robot, parents: list[int], first: int) -> dict[tuple[str, str], int]:
    """The same where the tree ends, without fingers."""
    count = len(parents)
    children: list[list[int]] = [[] for _ in range(count)]
    for j in range(first, count):
        children[parents[j]].append(j)
    depth = [1] * count
    for j in range(count - 1, 0, -1):
        depth[j] = 1 + max((depth[c] for c in children[j]), default=0)
    ends = []

    def visit(j: int) -> None:
        below = [c for c in children[j] if depth[c] >= SHORTEST] if len(children[j]) > 1 else children[j]
        if not below:
            ends.append(j)
        for c in below:
            visit(c)

    for root in [j for j in range(first, count) if parents[j] < first]:
        visit(root)
    return {(f"arm{k}_", _last_frame(robot, j)): j for k, j in enumerate(ends, start=1)}


def _last_frame(robot: Robot, joint: int) -> str:
    """The frame on a joint's body that is farthest from the joint, the last one of several; "" where there is none."""
    found, far = "", -1.0
    for frame in robot.model.frames:
        if int(frame.parentJoint) == joint:
            away = float(np.linalg.norm(frame.placement.translation))
            if away >= far * (1.0 - 1e-9):
                found, far = str(frame.name), max(away, far)
    return found


def _path(parents: list[int], joint: int, first: int) -> list[int]:
    out: list[int] = []
    while joint >= first:
        out.append(joint)
        joint = parents[joint]
    return out[::-1]
