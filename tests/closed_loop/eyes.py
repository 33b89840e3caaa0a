"""Distances of shapes in a configuration, by Pinocchio and Coal; none of our expressions."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from tests.distances import coal_shape
from wbc.robot import Robot
from wbc.shapes import PlacedShape

Array = np.ndarray


def cross(a: Array, b: Array) -> Array:
    """a x b; numpy's own takes fifteen times as long for two vectors."""
    (ax, ay, az), (bx, by, bz) = a.tolist(), b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def length(a: Array) -> float:
    """|a|."""
    return math.sqrt(a @ a)


#: A shape that stands on a link, or on ``None``, a pose of its own
Standing = tuple[str | None, PlacedShape]


class Gaps:
    """Signed distances of pairs of shapes [m], by Coal, all of a configuration in one call of Pinocchio."""

    def __init__(self, robot: Robot, pairs: Sequence[tuple[Standing, Standing]]) -> None:
        self.model, self.data, self.geometry = robot.model, robot.model.createData(), pin.GeometryModel()
        self.loose: list[tuple[int, pin.SE3]] = []
        numbers: dict[tuple[str | None, int], int] = {}
        for first, second in pairs:
            for link, placed in (first, second):
                if (link, id(placed)) not in numbers:
                    numbers[link, id(placed)] = self._add(link, placed)
            self.geometry.addCollisionPair(pin.CollisionPair(*(numbers[s[0], id(s[1])] for s in (first, second))))
        self.found = self.geometry.createData()
        for request in self.found.distanceRequests:
            request.enable_signed_distance = True

    def _add(self, link: str | None, placed: PlacedShape) -> int:
        joint, place = 0, placed.placement
        if link is not None:
            frame = self.model.frames[self.model.getFrameId(link)]
            joint, place = frame.parentJoint, frame.placement * place
        name = str(self.geometry.ngeoms)
        number = int(self.geometry.addGeometryObject(pin.GeometryObject(name, joint, place, coal_shape(placed.shape))))
        if link is None:
            self.loose.append((number, placed.placement))
        return number

    def __call__(self, q: Array, pose: pin.SE3 | None = None) -> Array:
        """The distances at a configuration and at the pose of what stands on no link."""
        for number, placement in self.loose:
            self.geometry.geometryObjects[number].placement = pose * placement
        pin.computeDistances(self.model, self.data, self.geometry, self.found, q)
        return np.array([result.min_distance for result in self.found.distanceResults])
