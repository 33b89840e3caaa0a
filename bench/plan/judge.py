"""What a path is worth: clear by Coal at ten times the resolution, within limits, from start to goal, and how long."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from bench.plan.peers import STEP
from bench.plan.problems import Problem
from wbc.plan import MotionPlanner
from wbc.shapes import Capsule, Sphere

#: A body may be so far in another one: what a proof of clearance leaves open [m]
ALLOWED = 1e-4


class CoalJudge:
    """The bodies of a problem as Pinocchio and Coal have them."""

    def __init__(self, problem: Problem, planner: MotionPlanner) -> None:
        robot = planner.stack.robot
        self.model, self.coordinates, self.problem = robot.model, planner.coordinates, problem
        self.bodies = pin.GeometryModel()
        numbers: dict[str, list[int]] = {}
        for link, shapes in robot.shapes.items():
            frame = self.model.frames[self.model.getFrameId(link)]
            for k, placed in enumerate(shapes):
                pose = frame.placement * placed.placement * pin.SE3(np.eye(3), placed.shape.center)
                shape = pin.GeometryObject(f"{link}_{k}", frame.parentJoint, pose, _coal(placed.shape))
                numbers.setdefault(link, []).append(self.bodies.addGeometryObject(shape))
        boxes = []
        for k, (sides, at, turn) in enumerate(problem.boxes):
            pose = pin.SE3(pin.exp3(np.array([0.0, 0.0, turn])), np.array(at))
            boxes.append(self.bodies.addGeometryObject(pin.GeometryObject(f"box{k}", 0, pose, coal.Box(*sides))))
        stack = planner.stack
        for (a, _, _), (b, _, _) in (pair for pair, _ in stack["self"].item.kept_pairs(robot)):
            for i in numbers[a]:
                for j in numbers[b]:
                    self.bodies.addCollisionPair(pin.CollisionPair(i, j))
        for link, some in numbers.items():
            if self.model.frames[self.model.getFrameId(link)].parentJoint:
                for i in some:
                    for j in boxes:
                        self.bodies.addCollisionPair(pin.CollisionPair(i, j))
        self.data, self.geometry = self.model.createData(), self.bodies.createData()

    def fault(self, path: Any) -> str:
        """What a path breaks; empty: nothing."""
        points = np.array(path)
        low, high = self.problem.low, self.problem.high
        if np.abs(points[0] - self.problem.start).max() > 1e-6 or np.abs(points[-1] - self.problem.goal).max() > 1e-6:
            return "other ends"
        if (points < low - 1e-9).any() or (points > high + 1e-9).any():
            return "beyond limits"
        for one, other in pairwise(points):
            count = int(np.ceil(np.linalg.norm(other - one) / (0.1 * STEP))) + 1
            for share in np.linspace(0.0, 1.0, count + 1):
                q = self.coordinates.configuration(one + share * (other - one))
                if not pin.computeCollisions(self.model, self.data, self.bodies, self.geometry, q, True):
                    continue
                for k in range(len(self.bodies.collisionPairs)):
                    if self.geometry.collisionResults[k].isCollision():
                        pin.computeDistance(self.bodies, self.geometry, k)
                        if self.geometry.distanceResults[k].min_distance < -ALLOWED:
                            return f"{1e3 * self.geometry.distanceResults[k].min_distance:.2f} mm in a body"
        return ""


def length(path: Any) -> float:
    """Sum of the distances of points [rad]."""
    return float(np.linalg.norm(np.diff(np.array(path), axis=0), axis=1).sum())


def _coal(shape: Any) -> Any:
    if isinstance(shape, Capsule):
        return coal.Capsule(shape.radius, shape.length)
    assert isinstance(shape, Sphere)
    return coal.Sphere(shape.radius)
