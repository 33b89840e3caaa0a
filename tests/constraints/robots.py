"""Robots of these tests: arms, an arm with unbounded joints, a humanoid; with acceleration limits and link shapes."""

from __future__ import annotations

from functools import cache

import numpy as np
import pinocchio as pin

import wbc.robots
from wbc.robot import Robot
from wbc.shapes import Capsule, PlacedShape, Sphere

NAMES = ("panda", "ur5", "kinova", "talos")


@cache
def robot(name: str) -> Robot:
    """A robot with 10 rad/s^2 everywhere and shapes on a few links."""
    return with_test_shapes(wbc.robots.load(name).with_limits(acceleration=10.0))


def with_test_shapes(bare: Robot, count: int = 4) -> Robot:
    """A copy with a sphere and a capsule, askew, on ``count`` links from the first to the last that move."""
    model, rng = bare.model, np.random.default_rng(7)
    links = [str(f.name) for f in model.frames if f.parentJoint > 0 and f.type == pin.FrameType.BODY]
    links = links or [str(f.name) for f in model.frames if f.parentJoint > 0]
    chosen = dict.fromkeys(links[int(k)] for k in np.linspace(0, len(links) - 1, count).round())
    shapes = {}
    for link in chosen:
        ball, rod = (pin.SE3(pin.exp3(rng.uniform(-2, 2, 3)), rng.uniform(-0.1, 0.1, 3)) for _ in range(2))
        shapes[link] = (PlacedShape(Sphere(0.06), ball), PlacedShape(Capsule(0.05, 0.25), rod))
    return bare.with_shapes(shapes)
