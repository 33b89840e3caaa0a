"""Hands driven to random places for minutes, with shapes fitted to all links: Coal measures them at every tick."""

from __future__ import annotations

import functools
import itertools
import tempfile
import xml.etree.ElementTree as ET
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pinocchio as pin

import wbc
from tests.closed_loop.eyes import Gaps
from wbc.robot import Robot
from wbc.robot.sampling import configuration, draw
from wbc.robot.sources.files import example_data_folder
from wbc.tasks import EndEffector, Hold, JointLimits, Posture, SelfCollision

#: Another target every PERIOD [s]
DT, PERIOD, MARGIN, GAIN = 0.01, 2.0, 0.02, 5.0
#: Arms that face each other [m]
APART = 0.8


@dataclass(frozen=True)
class Crowd:
    """A robot, what is driven, and what is held."""

    name: str
    hands: tuple[str, ...]
    base: str = ""
    shapes: str = "fit"


ROBOTS = {
    "g1": Crowd("g1", ("left_rubber_hand", "right_rubber_hand"), "pelvis"),
    "talos": Crowd("talos", ("gripper_left_base_link", "gripper_right_base_link"), "base_link"),
    "panda": Crowd("panda", ("panda_hand",)),
    "panda, hulls": Crowd("panda", ("panda_hand",), shapes="convex"),
    "two ur5": Crowd("", ("left_ee_link", "right_ee_link")),
    "go2": Crowd("go2", ("FL_foot", "FR_foot", "RL_foot", "RR_foot"), "base"),
    "baxter": Crowd("baxter", ("left_gripper_base_link", "right_gripper_base_link")),
}


@functools.cache
def crowded(name: str) -> Robot:
    crowd = ROBOTS[name]
    return wbc.robots.load(crowd.name, shapes=crowd.shapes) if crowd.name else two_arms(crowd.shapes)


def two_arms(shapes: str) -> Robot:
    """Two UR5 beside each other in one URDF file."""
    folder = example_data_folder()
    (file,) = folder.rglob("ur5_robot.urdf")
    parts = [part for part in ET.parse(file).getroot() if part.tag in ("link", "joint")]
    children = {part.find("child").get("link") for part in parts if part.tag == "joint"}  # type: ignore[union-attr]
    (root,) = {part.get("name") for part in parts if part.tag == "link"} - children
    tree = ET.Element("robot", name="two_ur5")
    ET.SubElement(tree, "link", name="room")
    for side, y in (("left", APART / 2), ("right", -APART / 2)):
        for part in parts:
            own = ET.fromstring(ET.tostring(part))
            own.set("name", f"{side}_{own.get('name')}")
            for end in (*own.findall("parent"), *own.findall("child")):
                end.set("link", f"{side}_{end.get('link')}")
            tree.append(own)
        mount = ET.SubElement(tree, "joint", name=f"{side}_mount", type="fixed")
        ET.SubElement(mount, "parent", link="room")
        ET.SubElement(mount, "child", link=f"{side}_{root}")
        ET.SubElement(mount, "origin", xyz=f"0 {y} 0")
    with tempfile.TemporaryDirectory() as place:
        ET.ElementTree(tree).write(path := Path(place) / "two_ur5.urdf")
        return wbc.robots.load(path, shapes=shapes, package_dirs=[folder, folder.parent, folder.parent.parent])


@dataclass
class Found:
    """Least distance [m] and at which tick, ticks in which shapes overlap, how ticks ended, and what was driven."""

    least: float = np.inf
    worst: tuple[int, str, str] = (0, "", "")
    overlaps: int = 0
    near: int = 0
    status: Counter[str] = field(default_factory=Counter)


def drive(name: str, seconds: float, seed: int = 0, method: str = "auto") -> Found:
    """The hands go to random places that the robot's joints reach; what Coal measures of the shapes in the pairs."""
    robot, crowd, rng = crowded(name), ROBOTS[name], np.random.default_rng(seed)
    stack = wbc.Stack(robot, DT).add(Posture(), name="rest", weight=1e-3).add(JointLimits(), name="limits")
    for hand in crowd.hands:
        stack.add(EndEffector(hand, kind="position"), name=hand)
    if crowd.base:
        stack.add(Hold(crowd.base), name="base")
    item = SelfCollision(margin=MARGIN, method=method)  # type: ignore[arg-type]
    control = stack.add(item, name="self").compile()
    shapes = robot.shapes
    names = [
        (a, b)
        for a, b in item.link_pairs(robot)
        for a, b in itertools.product([(a, k) for k in range(len(shapes[a]))], [(b, k) for k in range(len(shapes[b]))])
    ]
    gaps = Gaps(robot, [((a, shapes[a][i]), (b, shapes[b][k])) for (a, i), (b, k) in names])
    data, q, found = robot.model.createData(), robot.neutral.copy(), Found()
    for hand in crowd.hands:
        control[hand].gain = GAIN
    for k in range(round(seconds / DT)):
        if k % round(PERIOD / DT) == 0:
            pin.framesForwardKinematics(robot.model, data, configuration(robot, draw(robot, 1, rng)[0]))
            for hand in crowd.hands:
                control[hand].target = data.oMf[robot.model.getFrameId(hand)].translation.copy()
        step = control.step(q)
        found.status[step.status.value] += 1
        q = pin.integrate(robot.model, q, DT * step.v)
        d = gaps(q)
        found.overlaps += bool(d.min() < 0.0)
        found.near += bool(d.min() < MARGIN)
        if d.min() < found.least:
            found.least, found.worst = float(d.min()), (k, *(str(n) for n in names[int(d.argmin())]))
    return found
