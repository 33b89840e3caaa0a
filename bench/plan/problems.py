"""Seeded problems: shelves, cages, tables with clutter and narrow windows before four robots."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pinocchio as pin

import wbc
from wbc.errors import WbcError
from wbc.plan import MotionPlanner
from wbc.shapes import Box

Array = np.ndarray
ROBOTS = ("panda", "ur5", "tiago", "g1")
SCENES = ("shelf", "cage", "table", "window")
#: Scenes drawn at most until one has a free start and goal: of tables before TIAGo about 1 in 30 has
SCENES_DRAWN = 500
#: What the robots are made of, and the frame of the hand that is placed
MADE: dict[str, tuple[str, dict[str, Any], str]] = {
    "panda": ("panda", {}, "panda_hand_tcp"),
    "ur5": ("ur5", {}, "ee_link"),
    "tiago": (
        "tiago_dual",
        {
            "base": "fixed",
            "shapes": "fit",
            "lock": ["hand_*_joint", "wheel_*_joint", "caster_*_joint", "suspension_*_joint", "head_*"],
        },
        "right_hand",
    ),
    "g1": ("g1", {"base": "fixed", "shapes": "fit", "lock": ["*hip*", "*knee*", "*ankle*"]}, "right_hand"),
}
#: Where the scene stands before each robot (x, y, z) [m], and its size against that of the Panda's
PLACES = {
    "panda": ((0.5, 0.0, 0.4), 1.0),
    "ur5": ((0.55, 0.1, 0.3), 1.0),
    "tiago": ((0.5, -0.25, 0.8), 1.0),
    "g1": ((0.32, -0.2, 0.15), 0.5),
}


@dataclass(eq=False)
class Problem:
    """From one configuration to another among boxes.

    Attributes:
        name: robot, scene and seed. boxes: (sides [3], position [3], turn about z [rad]) of each.
        start, goal: coordinates of the planner [n]. low, high: between which all planners look for samples.
    """

    name: str
    robot: str
    boxes: tuple[tuple[tuple[float, ...], tuple[float, ...], float], ...]
    start: Array
    goal: Array
    low: Array = field(default_factory=lambda: np.zeros(0))
    high: Array = field(default_factory=lambda: np.zeros(0))


@functools.cache
def robot_of(name: str) -> tuple[wbc.robots.Robot, str]:
    """(robot with pairs of links that must not touch, name of its hand's frame)."""
    made, options, hand = MADE[name]
    robot = wbc.robots.load(made, **options)
    if robot.self_pairs is None or options:
        robot = robot.with_self_pairs(wbc.robots.find_self_pairs(robot, samples=2000).kept)
    return robot, robot.frames.get(hand, hand)


def boxes_of(scene: str, robot: str, rng: np.random.Generator) -> tuple[list[Any], list[tuple[Array, Array]]]:
    """Boxes of a scene, and the regions (least and greatest corner) that the hand goes between."""
    place, size = PLACES[robot]
    middle = np.array(place) + rng.uniform(-0.05, 0.05, 3) * size
    boxes: list[Any] = []
    regions: list[tuple[Array, Array]] = []

    def add(sides: Any, at: Any, turn: float = 0.0) -> None:
        boxes.append((tuple((np.array(sides) * size).tolist()), tuple((middle + np.array(at) * size).tolist()), turn))

    def region(at: Any, half: Any) -> None:
        center = middle + np.array(at) * size
        regions.append((center - np.array(half) * size, center + np.array(half) * size))

    if scene == "shelf":
        rise, wide = rng.uniform(0.28, 0.36), rng.uniform(0.35, 0.45)
        for k in (-1, 0, 1):
            add((0.3, 2 * wide, 0.02), (0.15, 0.0, k * rise))
        for k in (-1, 0, 1):
            add((0.3, 0.02, 2 * rise), (0.15, k * wide, 0.0))
        add((0.02, 2 * wide, 2 * rise), (0.31, 0.0, 0.0))
        for y in (-0.5, 0.5):
            for z in (-0.5, 0.5):
                region((0.08, y * wide, z * rise), (0.08, 0.25 * wide, 0.25 * rise))
    elif scene == "cage":
        gap = rng.uniform(0.22, 0.3)
        for x in (-0.15, 0.25):
            for k in range(-2, 3):
                add((0.02, 0.02, 0.8), (x, (k + 0.5) * gap, 0.0))
        for y in (-1.6, 1.6):
            add((0.4, 0.02, 0.02), (0.05, y * gap, 0.25))
            add((0.4, 0.02, 0.02), (0.05, y * gap, -0.25))
        for y in (-1.0, 0.0, 1.0):
            region((0.08, y * gap, 0.0), (0.08, 0.2 * gap, 0.2))
        region((-0.25, 0.0, 0.1), (0.05, 0.3, 0.2))
    elif scene == "table":
        add((0.8, 1.2, 0.03), (0.1, 0.0, -0.35))
        for _ in range(10):
            sides = rng.uniform((0.05, 0.05, 0.1), (0.15, 0.15, 0.45))
            at = rng.uniform((-0.1, -0.45, 0.0), (0.3, 0.45, 0.0))
            add(sides, (at[0], at[1], -0.33 + 0.5 * sides[2]), float(rng.uniform(-math.pi, math.pi)))
        region((0.1, -0.35, -0.15), (0.15, 0.1, 0.15))
        region((0.1, 0.35, -0.15), (0.15, 0.1, 0.15))
        region((0.1, 0.0, -0.1), (0.15, 0.1, 0.15))
    else:
        hole, up = rng.uniform(0.12, 0.2), rng.uniform(-0.1, 0.1)
        add((0.03, 1.4, 0.6 - hole + up), (0.0, 0.0, 0.5 * (-0.6 - hole + up)))
        add((0.03, 1.4, 0.6 - hole - up), (0.0, 0.0, 0.5 * (0.6 + hole + up)))
        add((0.03, 0.7 - hole, 2 * hole), (0.0, -0.5 * (0.7 + hole), up))
        add((0.03, 0.7 - hole, 2 * hole), (0.0, 0.5 * (0.7 + hole), up))
        region((0.14, 0.0, up), (0.06, 0.5 * hole, 0.5 * hole))
        region((-0.2, 0.0, up), (0.08, 0.35, 0.3))
    return boxes, regions


def stack_of(robot: str, boxes: Any) -> wbc.Stack:
    """Hand, limits, boxes and links that keep apart."""
    loaded, hand = robot_of(robot)
    stack = wbc.Stack(loaded, dt=0.01)
    stack.add(wbc.tasks.EndEffector(hand, kind="position"), name="hand")
    stack.add(wbc.tasks.JointLimits())
    stack.add(wbc.tasks.SelfCollision(), name="self")
    for k, (sides, at, turn) in enumerate(boxes):
        pose = pin.SE3(pin.exp3(np.array([0.0, 0.0, turn])), np.array(at))
        stack.add(wbc.tasks.Obstacle(Box(sides), pose=pose), name=f"box{k}")
    return stack


def problem(robot: str, scene: str, seed: int) -> tuple[Problem, MotionPlanner]:
    """A problem whose start and goal are free, and its planner."""
    rng = np.random.default_rng([seed, ROBOTS.index(robot), SCENES.index(scene)])
    for _ in range(SCENES_DRAWN):
        boxes, regions = boxes_of(scene, robot, rng)
        planner = MotionPlanner(stack_of(robot, boxes))
        ends = _ends(planner, regions, rng)
        if ends is not None:
            return Problem(f"{robot} {scene} {seed}", robot, tuple(boxes), *ends), planner
    raise RuntimeError(f"no free start and goal: {robot} {scene} {seed}")


def _ends(planner: MotionPlanner, regions: Any, rng: np.random.Generator) -> tuple[Array, Array] | None:
    chosen = rng.permutation(len(regions))[:2]
    found = []
    for k in chosen:
        low, high = regions[k]
        for _ in range(5):
            try:
                target = rng.uniform(low, high)
                branches = planner.branches(
                    planner.stack.robot.neutral, {"hand": target}, seed=int(rng.integers(2**31))
                )
            except WbcError:
                continue
            found.append(branches[int(rng.integers(len(branches)))])
            break
    return (found[0], found[1]) if len(found) == 2 else None
