"""Writes the problems: descriptions and targets of a Panda, a UR5 among obstacles and a Talos.

Each path is a closed figure that starts away from the robot's first pose, so that velocity limits bind at the
beginning, and rests at its end, so that the errors that remain can be compared.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from bench.descriptions import write_robot
from bench.problems import Array, Problem, Solid, save
from wbc.robot import Robot
from wbc.robots import load

#: Ticks of one pass, and how many of them the targets rest at the end
TICKS, REST = 400, 60


def prepare(folder: Path) -> list[Path]:
    """Write all problems below ``folder``; returns their folders."""
    return [panda(folder / "panda"), ur5(folder / "ur5"), talos(folder / "talos")]


def panda(folder: Path) -> Path:
    """A hand on a circle, with posture, position and velocity limits."""
    robot = load("panda")
    q0 = np.array([0.0, -0.4, 0.0, -2.2, 0.0, 1.9, 0.8])
    home = robot.pose(q0, "panda_hand")
    poses = [[circle(home, s, radius=0.12, tilt=0.3, offset=(0.0, 0.1, 0.05))] for s in phases(TICKS, REST)]
    title = "Panda: pose of the hand, posture, position and velocity limits"
    return write(folder, title, robot, q0, ["panda_hand"], poses, robot="panda")


def ur5(folder: Path) -> Path:
    """A tool on a circle among three spheres that the arm must pass at a distance."""
    links = {
        "upper_arm_link": ([0.0, 0.0, 0.25], 0.08), "forearm_link": ([0.0, 0.0, 0.2], 0.07),
        "wrist_1_link": ([0.0, 0.0, 0.0], 0.06), "wrist_3_link": ([0.0, 0.08, 0.0], 0.05),
    }  # fmt: skip
    solids = [Solid(link, "sphere", [radius], place) for link, (place, radius) in links.items()]
    robot = load("ur5")
    q0 = np.array([0.0, -1.2, 1.9, -2.27, -1.57, 0.0])
    home = robot.pose(q0, "tool0")
    poses = [[circle(home, s, radius=0.12, tilt=0.2, offset=(0.0, 0.05, 0.03))] for s in phases(TICKS, REST)]
    for offset, radius in (((0.05, -0.21, 0.03), 0.05), ((-0.14, 0.24, 0.05), 0.06), ((-0.05, 0.0, -0.24), 0.08)):
        solids.append(Solid("", "sphere", [radius], (home.translation + np.array(offset)).tolist()))
    title = "UR5: pose of the tool, posture, limits, 4 link spheres against 3 obstacles"
    return write(folder, title, robot, q0, ["tool0"], poses, robot="ur5", solids=solids, pairs=against_fixed(solids))


def talos(folder: Path) -> Path:
    """Feet at rest, hands on circles, the centre of mass to and fro; floating base, posture and limits."""
    robot = load("talos")
    sitting = {
        "arm_left_1": 0.25847, "arm_left_2": 0.173046, "arm_left_4": -0.525366, "arm_right_1": -0.25847,
        "arm_right_2": -0.173046, "arm_right_4": -0.525366, "leg_left_3": -0.411354, "leg_left_4": 0.859395,
        "leg_left_5": -0.448041, "leg_right_3": -0.411354, "leg_right_4": 0.859395, "leg_right_5": -0.448041,
    }  # fmt: skip
    joints = [sitting.get(name.removesuffix("_joint"), 0.0) for name in robot.joint_names[1:]]
    lower, upper = robot.limits.position_lower[6:], robot.limits.position_upper[6:]
    q0 = np.concatenate([[0.0, 0.0, 1.01927, 0.0, 0.0, 0.0, 1.0], np.clip(joints, lower + 0.02, upper - 0.02)])
    frames = ["left_sole_link", "right_sole_link", "wrist_left_ft_link", "wrist_right_ft_link"]
    homes = [robot.pose(q0, frame) for frame in frames]
    offsets = ((0.05, 0.02, 0.05), (0.05, -0.02, 0.05))
    poses = [
        [home.homogeneous for home in homes[:2]]
        + [circle(p, s, radius=0.05, tilt=0.15, offset=o) for p, o in zip(homes[2:], offsets, strict=True)]
        for s in phases(TICKS, REST)
    ]
    start = np.array(pin.centerOfMass(robot.model, robot.model.createData(), q0))
    com = [start + np.array([0.0, 0.02 * np.sin(2 * np.pi * s), -0.02]) for s in phases(TICKS, REST)]
    title = "Talos: 4 poses, centre of mass, posture, limits, floating base"
    return write(folder, title, robot, q0, frames, poses, com, robot="talos", com=True, posture_weight=1e-4)


def phases(ticks: int, rest: int) -> Array:
    """Where on its closed figure the target is at each tick: from 0 to 1, smooth at the end, then at rest."""
    moving = np.linspace(0.0, 1.0, ticks - rest)
    return np.concatenate([np.sin(0.5 * np.pi * moving), np.ones(rest)])


def circle(home: pin.SE3, s: float, *, radius: float, tilt: float, offset: Sequence[float]) -> Array:
    """A pose on a circle in the y-z plane, whose orientation nods by ``tilt`` [rad]; s = 1 closes it."""
    angle = 2 * np.pi * s
    position = home.translation + offset + radius * np.array([0.0, np.cos(angle) - 1.0, np.sin(angle)])
    rotation = home.rotation @ pin.exp3(tilt * np.sin(angle) * np.array([1.0, 0.0, 0.0]))
    return np.array(pin.SE3(rotation, position).homogeneous)


def against_fixed(solids: Sequence[Solid]) -> list[tuple[int, int]]:
    """Pairs of each solid on a link with each in the world."""
    numbers = range(len(solids))
    return [(a, b) for b in numbers for a in numbers if solids[a].link and not solids[b].link]


def write(
    folder: Path, title: str, of: Robot, q0: Array, frames: Sequence[str], poses: Any, centres: Any = None, **more: Any
) -> Path:
    """Write a problem of a robot and return its folder; ``more``: other fields of :class:`~bench.problems.Problem`."""
    write_robot(of, folder / "robot.urdf", more.get("solids", ()))
    problem = Problem(
        folder.name, title, joints=[str(name) for name in of.joint_names if name != "root_joint"], frames=list(frames),
        q0=q0.tolist(), length=of.characteristic_length, floating=of.base == "floating", **more,
    )  # fmt: skip
    save(folder, problem, np.array(poses), np.zeros((len(poses), 3)) if centres is None else np.array(centres))
    return folder
