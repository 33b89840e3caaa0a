"""Robots with bodies of every shape, and Coal asked pair by pair: the referee of the sensor."""

from __future__ import annotations

import itertools

import coal
import numpy as np
import pinocchio as pin

from tests.constraints.robots import robot
from tests.distances import coal_pose, coal_shape
from wbc.proximity import OBSTACLE, Body, PairSensor
from wbc.robot import Robot
from wbc.shapes import Box, Capsule, Convex, Cylinder, HalfSpace, Shape, Sphere

NAMES = ("panda", "ur5", "talos")

_rng = np.random.default_rng(1)
SHAPES: tuple[Shape, ...] = (
    Sphere(0.06),
    Capsule(0.05, 0.2),
    Box((0.1, 0.08, 0.2)),
    Cylinder(0.05, 0.16),
    Convex(_rng.normal(size=(30, 3)) * [0.04, 0.06, 0.05] + [0.02, 0.0, 0.05]),
)
#: An octahedron with edges of 20 cm and a tetrahedron whose box has its centre outside
LUMPS: tuple[Shape, ...] = (
    Convex(0.14 * np.vstack([np.eye(3), -np.eye(3)])),
    Convex(np.array([[0.0, 0.0, 0.0], [0.3, 0.02, 0.0], [0.0, 0.3, 0.02], [0.02, 0.0, 0.3]])),
)


def place(rng: np.random.Generator, spread: float = 0.05) -> pin.SE3:
    return pin.SE3(pin.exp3(rng.uniform(-2.0, 2.0, 3)), rng.uniform(-spread, spread, 3))


def carriers(bot: Robot, count: int) -> list[str]:
    """Links of as many different joints, from the first to the last."""
    links: dict[int, str] = {}
    for frame in bot.model.frames:
        if frame.parentJoint > 0:
            links.setdefault(int(frame.parentJoint), str(frame.name))
    names = list(links.values())
    return [names[int(k)] for k in np.linspace(0, len(names) - 1, min(count, len(names))).round()]


def link_bodies(bot: Robot, rng: np.random.Generator, count: int = 5) -> list[Body]:
    """A body of each shape, on links all over the robot."""
    links = carriers(bot, count)
    return [Body(f"{link}/{type(s).__name__}", link, place(rng), s) for link, s in zip(links, SHAPES, strict=True)]


def things(rng: np.random.Generator) -> list[Body]:
    """Bodies of every shape in the world, and two lumps that move from outside."""
    fixed = [Body(f"world/{type(s).__name__}", "world", place(rng, 0.5), s) for s in SHAPES]
    floor = Body("floor", "world", pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.1])), HalfSpace())
    return [*fixed, floor, *(Body(f"lump{k}", OBSTACLE, place(rng), s) for k, s in enumerate(LUMPS))]


def all_pairs(bot: Robot, rng: np.random.Generator) -> list[tuple[Body, Body]]:
    """Links with things, things with links, links with links."""
    links, others = link_bodies(bot, rng), things(rng)
    both = [(a, b) for a in links for b in others]
    return [*both[::2], *((b, a) for a, b in both[1::2]), *itertools.permutations(links, 2)]


def buffers(bot: Robot, count: int, pose: pin.SE3 | None = None) -> dict[str, np.ndarray]:
    """Inputs of an item with sensed rows as a controller would hand them: full of what was there before."""
    at = pin.SE3.Identity() if pose is None else pose
    sizes = {"distance": count, "drift": count, "line": 6 * count, "side": bot.nv * count}
    values = {name: np.full(size, np.nan) for name, size in sizes.items()}
    return values | {"pose": np.r_[at.rotation.ravel("F"), at.translation], "velocity": np.zeros(6)}


def set_pose(numbers: dict[str, np.ndarray], pose: pin.SE3) -> None:
    numbers["pose"][:] = np.r_[pose.rotation.ravel("F"), pose.translation]


class Referee:
    """Coal for each pair by itself, with frames by Pinocchio."""

    def __init__(self, bot: Robot, tolerance: float = 1e-8) -> None:
        self.bot, self.data = bot, bot.model.createData()
        self.request = coal.DistanceRequest()
        self.request.gjk_tolerance = tolerance
        self.shapes: dict[Body, object] = {}

    def pose(self, body: Body, pose: pin.SE3 | None) -> pin.SE3:
        """Where a body's shape is; frames must be up to date."""
        if body.frame == OBSTACLE:
            assert pose is not None
            return pose * body.placement
        if body.frame == "world":
            return body.placement
        return self.data.oMf[self.bot.model.getFrameId(body.frame)] * body.placement

    def __call__(
        self, pair: tuple[Body, Body], q: np.ndarray, pose: pin.SE3 | None = None
    ) -> tuple[float, np.ndarray, np.ndarray, np.ndarray]:
        """Distance, normal, and both witness points."""
        pin.framesForwardKinematics(self.bot.model, self.data, q)
        placed = []
        for body in pair:
            where = self.pose(body, pose)
            shape = self.shapes.setdefault(body, coal_shape(body.shape)) if body not in self.shapes else None
            placed += [shape or self.shapes[body], coal_pose(where)]
        result = coal.DistanceResult()
        value = coal.distance(*placed, self.request, result)
        return value, np.array(result.normal), result.getNearestPoint1(), result.getNearestPoint2()


def rows_of(bot: Robot, numbers: dict[str, np.ndarray], q: np.ndarray) -> np.ndarray:
    """The rows' derivatives along v as the stack makes them, with Pinocchio's screws."""
    count = len(numbers["distance"])
    data = bot.model.createData()
    screws = pin.computeJointJacobians(bot.model, data, q)
    return numbers["side"].reshape(count, -1) * (numbers["line"].reshape(count, 6) @ screws)


def sensor(
    bot: Robot, pairs: list[tuple[Body, Body]], count: int, pose: pin.SE3 | None = None
) -> tuple[PairSensor, dict[str, np.ndarray]]:
    """A sensor and its numbers."""
    numbers = buffers(bot, count, pose)
    return PairSensor(bot, pairs, count, numbers), numbers


__all__ = ["LUMPS", "NAMES", "SHAPES", "Referee", "all_pairs", "robot", "rows_of", "sensor", "set_pose"]
