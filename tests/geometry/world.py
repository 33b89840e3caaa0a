"""Distances by the kernel, random shapes, and an arm in front of an obstacle."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

import wbc
from tests.distances import coal_distance
from wbc.geometry import ShapeTable, distances
from wbc.shapes import Box, Capsule, Convex, Cylinder, PlacedShape, Solid, Sphere
from wbc.symbolic.joint_steps import place
from wbc.validation import Array


class Measured(NamedTuple):
    """Signed distance [m], unit normal from the first to the second, nearest point of the first."""

    gap: float
    normal: Array
    point: Array


def distance(a: Solid, at: pin.SE3, b: Solid, there: pin.SE3) -> Measured:
    """Of two shapes by the kernel."""
    places = [pose * pin.SE3(np.eye(3), shape.center) for shape, pose in ((a, at), (b, there))]
    poses = np.array([place(pose) for pose in places])
    found = distances(ShapeTable([a, b]), poses, np.array([0]), np.array([1]))[0]
    return Measured(float(found[0]), found[1:4], found[4:])


def shapes(rng: np.random.Generator) -> list[Solid]:
    """One of every convex kind but the ellipsoid."""

    def size() -> float:
        return float(10 ** rng.uniform(-1.5, 0.0))

    hull = rng.normal(size=(12, 3)) * [size(), size(), size()]
    return [
        Sphere(size()), Capsule(size(), size()), Box((size(), size(), size())), Cylinder(size(), size()), Convex(hull),
    ]  # fmt: skip


def clear_of(obstacle: Solid, there: pin.SE3, pieces: tuple[Solid, ...] = (), margin: float = 0.02) -> None:
    """An arm whose hand is drawn into an obstacle stops the margin in front of it; Coal measures, ``pieces`` of the
    obstacle where it has not the whole.
    """
    robot = wbc.robots.load("ur5")
    hand = PlacedShape(Capsule(0.05, 0.12), pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.04])))
    robot = robot.with_shapes({"wrist_3_link": [hand]})
    stack = wbc.Stack(robot, dt=0.01)
    stack.add(wbc.tasks.EndEffector("wrist_3_link"), name="hand")
    stack.add(wbc.tasks.Obstacle(obstacle, margin=margin, pose=there), name="clear")
    controller = stack.compile(backend="vm")
    q, data, gaps = robot.configuration("q", [0.3, -1.2, 1.2, -1.5, -1.5, 0.0]), robot.model.createData(), list[float]()
    frame = robot.model.getFrameId("wrist_3_link")
    pin.framesForwardKinematics(robot.model, data, q)
    controller["hand"].target = pin.SE3(data.oMf[frame].rotation, there.translation)
    for _ in range(300):
        step = controller.step(q)
        (_, _, said), *_ = controller.pairs("clear")
        pin.framesForwardKinematics(robot.model, data, q)
        wrist = data.oMf[frame] * hand.placement
        gap = min(coal_distance(hand.shape, wrist, part, there, 1e-9) for part in pieces or (obstacle,))
        np.testing.assert_allclose(said, gap, atol=1e-7)
        gaps.append(gap)
        q = robot.integrate(q, step.v, 0.01)
    assert gaps[0] > 3 * margin, "the hand begins far from it"
    assert margin - 1e-3 < min(gaps)
    assert gaps[-1] < margin + 2e-3


__all__ = ["Measured", "clear_of", "distance", "shapes"]
