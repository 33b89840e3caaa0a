"""The bodies of some pairs in one Pinocchio geometry model, and the distances of the pairs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from wbc.proximity.body import Body, Pair, joint_of
from wbc.proximity.geometry import Geometry, geometry_of
from wbc.shapes import Shape
from wbc.symbolic.kinematics import WORLD, frame_index
from wbc.validation import Array

if TYPE_CHECKING:
    from wbc.robot import Robot


class Scene:
    """Bodies, placed by the configuration and by the pose of what moves from outside, and their pairs.

    Attributes:
        bodies: every body once, in the order in which the pairs name them.
        first, second: numbers of the bodies A and B of every pair.
    """

    def __init__(self, robot: Robot, pairs: list[Pair], moving: frozenset[str]) -> None:
        self.robot = robot
        self.bodies: list[Body] = list(dict.fromkeys(body for pair in pairs for body in pair))
        number = {body: k for k, body in enumerate(self.bodies)}
        self.first = np.array([number[a] for a, _ in pairs], dtype=np.intp)
        self.second = np.array([number[b] for _, b in pairs], dtype=np.intp)
        self.joints = [joint_of(robot, body, moving) for body in self.bodies]
        self.data = robot.model.createData()
        self.geometries = _geometries(self.bodies)
        self.model = pin.GeometryModel()
        for k, body in enumerate(self.bodies):
            place = self._on_joint(body, moving) * self.geometries[k].offset
            self.model.addGeometryObject(pin.GeometryObject(f"{k}", self.joints[k], place, self.geometries[k].geometry))
        for a, b in zip(self.first.tolist(), self.second.tolist(), strict=True):
            self.model.addCollisionPair(pin.CollisionPair(a, b))
        self.outside = [
            (self.model.geometryObjects[k], body.placement * self.geometries[k].offset)
            for k, body in enumerate(self.bodies)
            if body.frame in moving
        ]
        self.measured = self.model.createData()
        self._results = [self.measured.distanceResults[k] for k in range(len(pairs))]

    def move(self, pose: pin.SE3) -> None:
        """Put what moves from outside at a pose."""
        for item, local in self.outside:
            item.placement = pose * local

    def measure(self, q: Array) -> tuple[Array, Array, Array]:
        """(distance [m], unit normals from A to B, points half way between the witnesses) of every pair."""
        pin.updateGeometryPlacements(self.robot.model, self.data, self.model, self.measured, q)
        pin.computeDistances(self.model, self.measured)
        results = self._results
        distance = np.array([r.min_distance for r in results])
        normal = np.array([r.normal for r in results])
        middle = np.array([0.5 * (r.getNearestPoint1() + r.getNearestPoint2()) for r in results])
        return distance, normal, middle

    def _on_joint(self, body: Body, moving: frozenset[str]) -> pin.SE3:
        if body.frame == WORLD or body.frame in moving:
            return body.placement
        frame = self.robot.model.frames[frame_index(self.robot.model, body.frame)]
        return frame.placement * body.placement


def _geometries(bodies: list[Body]) -> list[Geometry]:
    """Equal shapes share a geometry."""
    known: dict[Shape, Geometry] = {}
    return [known.setdefault(body.shape, geometry_of(body.shape)) for body in bodies]
