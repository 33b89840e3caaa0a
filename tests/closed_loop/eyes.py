"""What a robot does, seen with Pinocchio and Coal from its configurations alone; none of our expressions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from tests.distances import coal_shape
from wbc.robot import Robot
from wbc.shapes import PlacedShape

Array = np.ndarray

#: Poles and directions of angle 0 of the planes in these tests, world axes
POLE, DIRECTION = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])


def wrap(angle: float) -> float:
    """The same angle in (-pi, pi]."""
    return math.atan2(math.sin(angle), math.cos(angle))


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


class Eyes:
    """Measurements on one robot."""

    def __init__(self, robot: Robot) -> None:
        self.robot, self.model, self.data = robot, robot.model, robot.model.createData()
        self._numbers: dict[str, int] = {}

    def pose(self, q: Array, frame: str) -> pin.SE3:
        """Pose of a frame in the world."""
        return self.poses(q, frame)[0]

    def poses(self, q: Array, *frames: str) -> list[pin.SE3]:
        """Poses of several frames in the world."""
        pin.forwardKinematics(self.model, self.data, q)
        return [self._placement(frame) for frame in frames]

    def _placement(self, frame: str) -> pin.SE3:
        if frame == "world":
            return pin.SE3.Identity()
        number = self._numbers.get(frame)
        if number is None:
            number = self._numbers[frame] = self.model.getFrameId(frame)
        return pin.updateFramePlacement(self.model, self.data, number).copy()

    def center_of_mass(self, q: Array) -> Array:
        """Centre of mass in the world [m]."""
        return np.array(pin.centerOfMass(self.model, self.data, q))

    def twist(self, q: Array, v: Array, frame: str, axes: Any = pin.LOCAL_WORLD_ALIGNED) -> Array:
        """Velocity (linear; angular) of a frame at its origin."""
        pin.forwardKinematics(self.model, self.data, q, v)
        number = self.model.getFrameId(frame)
        pin.updateFramePlacement(self.model, self.data, number)
        return np.array(pin.getFrameVelocity(self.model, self.data, number, axes).vector)

    def velocity(self, before: Array, after: Array, dt: float) -> Array:
        """The constant velocity that leads from one configuration to the next."""
        return np.array(pin.difference(self.model, before, after)) / dt

    def arm(self, q: Array, plane: tuple[str, str, str], axis: str | None = None) -> tuple[Array, Array, float, float]:
        """(unit line, direction in the plane, |line| and elbow's distance from it over the length of the arm)."""
        shoulder, elbow, wrist = (p.translation for p in self.poses(q, *plane))
        reach = length(elbow - shoulder) + length(wrist - elbow)
        line, direction = wrist - shoulder, elbow - shoulder
        if axis is not None:
            normal = self.axis(axis)
            line = line - normal * (normal @ line)
            direction = cross(line, normal)
        size = length(line)
        along = line / size
        off = length((elbow - shoulder) - along * (along @ (elbow - shoulder)))
        return along, direction, size / reach, off / reach

    def axis(self, joint: str) -> Array:
        """Direction in the world of a revolute joint's axis, at the configuration of the last measurement."""
        number = self.model.getJointId(joint)
        subspace = pin.Motion(np.array(self.model.joints[number].createData().S).ravel())
        return np.array(self.data.oMi[number].act(subspace).angular)

    def plane_angle(self, q: Array, plane: tuple[str, str, str], axis: str | None = None) -> float:
        """Angle of the plane from the image of DIRECTION under the shortest rotation of POLE to the line [rad]."""
        line, direction, _, _ = self.arm(q, plane, axis)
        zero = pin.Quaternion.FromTwoVectors(POLE, line).matrix() @ DIRECTION
        return math.atan2(line @ cross(zero, direction), zero @ direction)

    def plane_is_clear(self, q: Array, plane: tuple[str, str, str], axis: str | None = None) -> bool:
        """Whether the arm is well away from the singular sets of the plane."""
        line, _, size, off = self.arm(q, plane, axis)
        return size > 0.15 and (axis is not None or off > 0.1) and float(line @ POLE) > -0.9

    def plane_rate(self, before: Array, after: Array, dt: float, plane: tuple[str, str, str], axis: str) -> float:
        """Turn of the body that carries the axis about the line, between two configurations, over dt [rad/s]."""
        carrier = self.model.parents[self.model.getJointId(axis)]
        line = self.arm(before, plane, axis)[0]
        turned = self.data.oMi[carrier].rotation.copy()
        pin.forwardKinematics(self.model, self.data, after)
        return float(line @ pin.log3(self.data.oMi[carrier].rotation @ turned.T)) / dt
