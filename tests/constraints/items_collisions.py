"""Declarations of the collision constraints on any robot, for tests that walk the registry."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin

from wbc.robot import Robot
from wbc.shapes import Capsule, HalfSpace, Sphere
from wbc.tasks.base import Item
from wbc.tasks.obstacle import Obstacle
from wbc.tasks.self_collision import SelfCollision


def _obstacle(robot: Robot) -> list[tuple[Item, dict[str, Any]]]:
    pose = pin.SE3(pin.exp3(np.array([0.3, -0.2, 0.1])), np.array([0.2, 0.3, -0.1]))
    moving = {"pose": pose, "velocity": [0.1, -0.2, 0.3, 0.4, -0.5, 0.6], "margin": 0.01}
    link = Obstacle(HalfSpace()).pairs(robot)[0][0]
    return [(Obstacle(shape, links=link), moving) for shape in (Sphere(0.1), HalfSpace(), Capsule(0.05, 0.2))]


def _self_collision(robot: Robot) -> list[tuple[Item, dict[str, Any]]]:
    links = [link for link, shapes in robot.shapes.items() if shapes]
    # A link near the base and the one that most joints move: their distance takes many values
    depth = {
        link: len(robot.model.supports[robot.model.frames[robot.model.getFrameId(link)].parentJoint]) for link in links
    }
    far = (links[0], max(links[1:], key=lambda link: depth[link]))
    some = [pair for pair in itertools.combinations(links, 2) if pair != far]
    return [
        (SelfCollision([far], method="symbolic"), {"margin": 0.02}),
        (SelfCollision(some[:3], margin=0.01), {}),
    ]


#: Class name -> declarations on a robot with a sphere and a capsule on each of some links; no rows are sensed.
FACTORIES: dict[str, Callable[[Robot], list[tuple[Item, dict[str, Any]]]]] = {
    "Obstacle": _obstacle,
    "SelfCollision": _self_collision,
}
