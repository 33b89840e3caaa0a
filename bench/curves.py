"""Problems of growing size: more joints, more tasks, more obstacles, more measured pairs; and a humanoid's own links.

Targets are those of a path of the joints, so that all can be reached at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from bench.prepare import against_fixed, phases, write
from bench.problems import Array, Solid
from bench.scenery import G1_PAIRS, boxes_around, capsules, clearances, link_boxes, spheres_around
from wbc.robot import Robot
from wbc.robots import fit_shapes, load

#: Ticks of one pass, and how many of them the targets rest at the end
TICKS, REST = 200, 40

#: Rows for the nearest of the measured pairs
CLOSEST = 8

#: Robot of the table -> frames with a pose task. The fingers of the last are not locked.
JOINTS = {
    "panda": ["panda_hand", "panda_link5"],
    "a1": ["FL_foot", "trunk"],
    "b1_z1": ["link06", "trunk"],
    "talos": ["wrist_left_ft_link", "wrist_right_ft_link"],
    "g1_hands": ["left_hand_palm_link", "right_hand_palm_link"],
}
TASKS = (1, 2, 5, 10, 15, 20)
TALOS_FRAMES = [
    "wrist_left_ft_link", "wrist_right_ft_link", "left_sole_link", "right_sole_link", "head_2_link", "torso_2_link",
    "arm_left_4_link", "arm_right_4_link", "leg_left_4_link", "leg_right_4_link", "base_link", "arm_left_2_link",
    "arm_right_2_link", "leg_left_3_link", "leg_right_3_link", "arm_left_6_link", "arm_right_6_link", "torso_1_link",
    "arm_left_3_link", "arm_right_3_link",
]  # fmt: skip
SPHERES = (0, 1, 5, 10, 20, 50)
#: Boxes in the world; five links carry one each
BOXES = (0, 1, 2, 4, 10, 20, 40)
#: First configurations, where they are not the robot's neutral one [rad]
HOME = {
    "panda": {
        "panda_joint1": 0.0, "panda_joint2": -0.4, "panda_joint3": 0.0, "panda_joint4": -2.2, "panda_joint5": 0.0,
        "panda_joint6": 1.9, "panda_joint7": 0.8,
    },
    "g1": {
        "left_shoulder_roll_joint": 0.25, "right_shoulder_roll_joint": -0.25, "left_hip_roll_joint": 0.08,
        "right_hip_roll_joint": -0.08,
    },
}  # fmt: skip
#: Amplitude of the joints' paths [rad], less where a limit is near: speeds stay below the limits but at the beginning
AMPLITUDE = 0.12


@dataclass(frozen=True)
class Point:
    """One problem of a curve: where it is on the axis, what it is called there, and its folder's name."""

    curve: str
    x: float
    label: str
    folder: str


def points() -> list[Point]:
    """All problems, in the order of the tables."""
    out = [Point("joints", float(NV[name]), f"{NV[name]} ({name})", f"joints_{name}") for name in JOINTS]
    out += [Point("tasks", float(n), str(n), f"tasks_{n}") for n in TASKS]
    out += [Point("spheres", float(n), str(n), f"spheres_{n}") for n in SPHERES]
    out += [Point("sensed", 5.0 * n, str(5 * n), f"sensed_{5 * n}") for n in BOXES]
    return [*out, Point("g1", 20.0, "20 pairs", "g1_self")]


#: Degrees of freedom, six of them the base's where it floats
NV = {"panda": 7, "a1": 18, "b1_z1": 24, "talos": 38, "g1_hands": 49}


def prepare_curves(folder: Path) -> None:
    """Write all problems below ``folder``."""
    for name, frames in JOINTS.items():
        robot = by_name(name)
        assert robot.nv == NV[name], (name, robot.nv)
        along(folder / f"joints_{name}", f"{name}: two poses, posture, limits", robot, frames)
    talos = by_name("talos")
    for n in TASKS:
        along(folder / f"tasks_{n}", f"Talos: {n} poses, posture, limits", talos, TALOS_FRAMES[:n])
    panda = by_name("panda")
    arm = capsules(panda)
    balls = spheres_around(panda, arm, joint_path(panda), max(SPHERES))
    for n in SPHERES:
        title = f"Panda: pose, posture, limits, {len(arm)} capsules against {n} spheres"
        among(folder / f"spheres_{n}", title, panda, arm + balls[:n])
    blocks = link_boxes(panda)
    crates = boxes_around(panda, blocks, joint_path(panda), max(BOXES))
    for n in BOXES:
        title = f"Panda: pose, posture, limits, {len(blocks)} boxes against {n} boxes"
        among(folder / f"sensed_{5 * n}", title, panda, blocks + crates[:n], CLOSEST)
    write_g1(folder / "g1_self")


def write_g1(folder: Path) -> None:
    """Unitree G1: feet, hands, centre of mass, posture, limits, and 20 pairs of its own links."""
    names = list(dict.fromkeys(link for pair in G1_PAIRS for link in pair))
    g1 = by_name("g1")
    fitted = fit_shapes(g1, names)
    solids = capsules(fitted.with_shapes({name: fitted.shapes[name] for name in names}))
    where = {solid.link: k for k, solid in enumerate(solids)}
    pairs = [(where[a], where[b]) for a, b in G1_PAIRS]
    least = min(clearances(g1, solids, pairs, q).min() for q in joint_path(g1))
    assert least > 0.01, least
    frames = ["left_ankle_roll_link", "right_ankle_roll_link", "left_rubber_hand", "right_rubber_hand"]
    title = "Unitree G1: 4 poses, centre of mass, posture, limits, floating base, self-collision of 20 pairs"
    along(folder, title, g1, frames, solids=solids, pairs=pairs, com=True)


def by_name(name: str) -> Robot:
    """A robot of the table; the last of :data:`JOINTS` with its fingers."""
    return load(name, lock=()) if name == "g1_hands" else load(name)


def start(robot: Robot) -> Array:
    """The first configuration, at least 0.02 rad within the limits."""
    q = np.array(robot.neutral)
    for joint, value in HOME.get(robot.name, {}).items():
        q[robot.model.idx_qs[robot.model.getJointId(joint)]] = value
    first = robot.nq - (robot.nv - robot.base_nv)
    lower, upper = robot.limits.position_lower[robot.base_nv :], robot.limits.position_upper[robot.base_nv :]
    room = np.minimum(0.02, 0.25 * (upper - lower))
    q[first:] = np.clip(q[first:], lower + room, upper - room)
    return q


def joint_path(robot: Robot) -> list[Array]:
    """Configurations along a closed path that starts off its first one and rests at its end."""
    q0, nv, base = start(robot), robot.nv, robot.base_nv
    lower, upper = robot.limits.position_lower[base:], robot.limits.position_upper[base:]
    reach = np.clip(0.5 * np.minimum(upper - q0[-(nv - base) :], q0[-(nv - base) :] - lower), 0.0, AMPLITUDE)
    size = np.concatenate([np.full(base, 0.02), reach])
    shift = np.arange(nv) * 2.4
    return [np.array(pin.integrate(robot.model, q0, size * np.sin(2 * np.pi * t + shift))) for t in phases(TICKS, REST)]


def among(folder: Path, title: str, robot: Robot, solids: Sequence[Solid], sensed: int = 0) -> None:
    """Write a problem of a hand whose solids on links keep clear of all in the world."""
    if pairs := against_fixed(solids):
        along(folder, title, robot, ["panda_hand"], solids=list(solids), pairs=pairs, sensed=sensed)
    else:
        along(folder, title, robot, ["panda_hand"])


def along(folder: Path, title: str, robot: Robot, frames: Sequence[str], **more: Any) -> None:
    """Write one problem on the path of the joints; ``more`` as for :func:`~bench.prepare.write`."""
    data, poses, centres = robot.model.createData(), [], []
    for q in joint_path(robot):
        pin.framesForwardKinematics(robot.model, data, q)
        poses.append([data.oMf[robot.model.getFrameId(f)].homogeneous for f in frames])
        centres.append(np.array(pin.centerOfMass(robot.model, data, q)))
    write(folder, title, robot, start(robot), frames, poses, centres, **more)
