"""Stacks before obstacles, and a judge of paths that shares no code with the planner: Pinocchio with Coal."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

import wbc
from tests.distances import coal_shape
from tests.loops.mechanisms import NAMED
from wbc.plan import MotionPlanner, PlannedPath
from wbc.robot import Robot
from wbc.shapes import Box, Cylinder

#: Sides and place of the boards of a shelf before a Panda [m]
SHELF = (
    *(((0.35, 0.9, 0.02), (0.65, 0.0, z)) for z in (0.05, 0.4, 0.75)),
    *(((0.35, 0.02, 0.7), (0.65, y, 0.4)) for y in (-0.45, 0.0, 0.45)),
)


def at(x: float, y: float, z: float) -> pin.SE3:
    """A place without a turn."""
    return pin.SE3(np.eye(3), np.array([x, y, z]))


def reaching(x: float, y: float, z: float) -> pin.SE3:
    """A hand that points forwards."""
    return pin.SE3(pin.rpy.rpyToMatrix(0.0, np.pi / 2.0, 0.0), np.array([x, y, z]))


def panda(*boxes: tuple[tuple[float, ...], tuple[float, ...]], margin: float = 0.003) -> wbc.Stack:
    """A Panda with limits among boxes (sides, place)."""
    stack = wbc.Stack(wbc.robots.load("panda"), dt=0.01)
    stack.add(wbc.tasks.EndEffector("panda_hand_tcp"), name="hand")
    stack.add(wbc.tasks.JointLimits())
    stack.add(wbc.tasks.SelfCollision(), name="self")
    for k, (sides, place) in enumerate(boxes):
        stack.add(wbc.tasks.Obstacle(Box(sides), pose=at(*place), margin=margin), name=f"box{k}")
    return stack


def base_with_a_body(name: str = "tiago_pro") -> Robot:
    """A base that drives in any direction, or ``tiago``'s on two wheels, with a cylinder as its body."""
    hands = ["*gripper*", "*finger*"] if name == "tiago_pro" else ["hand_*"]
    robot = wbc.robots.load(name, shapes="none", lock=[*hands, "*wheel*", "arm_*", "head_*", "torso_*"])
    body = wbc.shapes.PlacedShape(Cylinder(0.3, 0.3), at(0.0, 0.0, 0.2))
    return robot.with_shapes({robot.frames["base"]: [body]})


def standing_g1(seed: int) -> tuple[wbc.Stack, np.ndarray, tuple[np.ndarray, np.ndarray]]:
    """A G1 with its base free and both feet held before a table, where it stands, and places over and under the table
    for its right hand.
    """
    rng, robot = np.random.default_rng(seed), wbc.robots.load("g1", shapes="fit")
    pairs = wbc.robots.find_self_pairs(robot, samples=500).kept
    arms = ("shoulder", "elbow", "wrist", "hand")
    robot = robot.with_self_pairs([pair for pair in pairs if any(arm in link for link in pair for arm in arms)])
    q = robot.neutral.copy()
    for side in ("left", "right"):
        for joint, angle in (("hip_pitch", -0.4), ("knee", 0.8), ("ankle_pitch", -0.4), ("elbow", 0.6)):
            q[robot.position_index[robot.dof_names.index(f"{side}_{joint}_joint")]] = angle
    feet = [robot.frames[f"{side}_foot"] for side in ("left", "right")]
    sole = [(x, y, 0.0) for x in (-0.05, 0.1) for y in (-0.03, 0.03)]
    stack = wbc.Stack(robot, dt=0.01)
    for side, foot in zip(("left", "right"), feet, strict=True):
        stack.add(wbc.tasks.Hold(foot), name=f"{side} foot")
    stack.add(wbc.tasks.EndEffector(robot.frames["right_hand"], kind="position"), name="hand")
    stack.add(wbc.tasks.JointLimits())
    stack.add(wbc.tasks.SelfCollision(), name="self")
    polygon = wbc.tasks.support_polygon(robot, dict.fromkeys(feet, sole), q, margin=0.01)
    stack.add(polygon, name="polygon")
    height = robot.pose(q, feet[0]).translation[2] + rng.uniform(0.62, 0.8)
    stack.add(wbc.tasks.Obstacle(Box((0.36, 0.9, 0.03)), pose=at(0.47, -0.1, height), margin=0.003), name="table")
    over, under = (np.array([*rng.uniform((0.32, -0.3), (0.42, 0.0)), height + rise]) for rise in (0.12, -0.18))
    return stack, q, (over, under)


def tray() -> tuple[MotionPlanner, tuple[str, str]]:
    """A PR2 that keeps a tray in both hands, and these."""
    robot = wbc.robots.load("pr2", base="fixed", lock=["?_gripper_*", "laser_*", "torso_*", "head_*"], shapes="none")
    hands = robot.frames["left_hand"], robot.frames["right_hand"]
    stack = wbc.Stack(robot, dt=0.01)
    stack.add(wbc.tasks.RelativePose(*hands), name="tray")
    stack.add(wbc.tasks.EndEffector(hands[0], kind="position"), name="left")
    stack.add(wbc.tasks.JointLimits())
    return stack.planner(keep=("tray",)), hands


def mechanism(name: str, rng: np.random.Generator) -> tuple[wbc.Stack, np.ndarray, np.ndarray]:
    """One with closed loops, and configurations that small steps lead between."""
    robot = wbc.robots.load(NAMED[name])
    stack = wbc.Stack(robot, dt=0.01).add(wbc.tasks.JointLimits())
    way = rng.normal(size=robot.nv)
    start = goal = robot.closed(robot.neutral)
    for _ in range(15):
        goal = robot.closed(robot.integrate(goal, 0.05 * np.sqrt(robot.nv) * way / np.linalg.norm(way)))
    return stack, start, goal


class CoalJudge:
    """Distances of the bodies of a stack by Coal.

    Args:
        poses: of obstacles that stand elsewhere than they were declared.
    """

    def __init__(self, stack: wbc.Stack, poses: dict[str, pin.SE3] | None = None) -> None:
        robot = stack.robot
        self.model, self.bodies = robot.model, pin.GeometryModel()
        numbers: dict[str, list[int]] = {}
        for link, shapes in robot.shapes.items():
            frame = self.model.frames[self.model.getFrameId(link)]
            for k, placed in enumerate(shapes):
                pose = frame.placement * placed.placement * pin.SE3(np.eye(3), placed.shape.center)
                body = pin.GeometryObject(f"{link} {k}", frame.parentJoint, pose, coal_shape(placed.shape))
                numbers.setdefault(link, []).append(self.bodies.addGeometryObject(body))
        self.required: list[float] = []
        for entry in stack.constraints:
            item = entry.item
            if isinstance(item, wbc.tasks.SelfCollision):
                for (a, i, _), (b, j, _) in (pair for pair, _ in item.kept_pairs(robot)):
                    self.bodies.addCollisionPair(pin.CollisionPair(numbers[a][i], numbers[b][j]))
                    self.required.append(item.margin)
            elif isinstance(item, wbc.tasks.Obstacle):
                pose = (poses or {}).get(entry.name, item.pose)
                shape = item.parts[0]
                other = pin.GeometryObject(entry.name, 0, pose * pin.SE3(np.eye(3), shape.center), coal_shape(shape))
                number = self.bodies.addGeometryObject(other)
                for link, k, _ in item.pairs(robot):
                    self.bodies.addCollisionPair(pin.CollisionPair(numbers[link][k], number))
                    self.required.append(item.margin)
        self.data, self.geometry = self.model.createData(), self.bodies.createData()

    def margin(self, q: Any) -> float:
        """The least distance of a pair, less what it keeps [m]."""
        pin.computeDistances(self.model, self.data, self.bodies, self.geometry, q)
        found = [result.min_distance for result in self.geometry.distanceResults]
        return float(np.min(np.array(found) - self.required))

    def least(self, path: PlannedPath, step: float = 0.005) -> float:
        """The least margin along the straight pieces of a path, looked at every ``step`` [rad]."""
        out = np.inf
        for one, other in zip(path.points[:-1], path.points[1:], strict=True):
            for share in np.linspace(0.0, 1.0, int(np.linalg.norm(other - one) / step) + 2):
                out = min(out, self.margin(path.coordinates.configuration(one + share * (other - one))))
        return out
