"""Robots of the closed loops, and where they start."""

from __future__ import annotations

from functools import cache

import numpy as np
import pinocchio as pin

import wbc.robots
from tests.closed_loop.eyes import Array
from tests.repeats import ALL, MORE, repeats
from tests.tasks.robots import FRAMES
from wbc.robot import Robot
from wbc.shapes import Capsule, PlacedShape, Sphere

#: The arm with unbounded joints stands in for the other six-joint arm where tasks are concerned. Checks take turns on
#: an arm and the humanoid, which floats; derivatives of every item are compared on every robot in tests/tasks and
#: tests/constraints. With ``REPEATS=3`` every check runs on three robots
TASK_ROBOTS = ("kinova", "talos") if MORE < ALL else ("panda", "kinova", "talos")
CONSTRAINT_ROBOTS = ("panda", "talos") if MORE < ALL else ("panda", "ur5", "talos")

#: Random starts of a check, and of one that repeats what another shows, or whose robot takes longer; so many show every
#: mutation
STARTS, FEWER = repeats(5), repeats(3)


@cache
def machine(name: str) -> Robot:
    """A robot with 10 rad/s^2 and m/s^2 everywhere, 1 m/s and rad/s of its base, and shapes, askew, on its arm."""
    bare, f = wbc.robots.load(name, shapes="none"), FRAMES[name]
    slow = np.where(np.isfinite(bare.limits.velocity), bare.limits.velocity, 1.0)
    bare = bare.with_limits(velocity=slow, acceleration=10.0)
    rng, shapes = np.random.default_rng(7), {}
    for link in dict.fromkeys((f.tip, f.middle, f.plane[0], f.plane[2])):
        ball, rod = (pin.SE3(pin.exp3(rng.uniform(-2, 2, 3)), rng.uniform(-0.04, 0.04, 3)) for _ in range(2))
        shapes[link] = (PlacedShape(Sphere(0.05), ball), PlacedShape(Capsule(0.04, 0.15), rod))
    return bare.with_shapes(shapes)


def anywhere(robot: Robot, rng: np.random.Generator, share: float = 0.9) -> Array:
    """A random configuration in the middle ``share`` of the position limits; circles and bases anywhere near."""
    free = np.where(np.array(robot.dof_units) == "m", 1.0, np.pi)
    q = pin.integrate(robot.model, robot.neutral, np.where(robot.position_index < 0, free, 0) * _cube(robot, rng))
    low, high = ends(robot, share)
    for i, k in enumerate(robot.position_index):
        if k >= 0:
            q[k] = rng.uniform(low[i], high[i])
    return q


def near(robot: Robot, rng: np.random.Generator, q: Array, reach: float, share: float = 0.95) -> Array:
    """A random configuration within ``reach`` [rad, m] of q in every degree of freedom, within the limits."""
    out = pin.integrate(robot.model, q, reach * _cube(robot, rng))
    low, high = ends(robot, share)
    for i, k in enumerate(robot.position_index):
        if k >= 0:
            out[k] = np.clip(out[k], low[i], high[i])
    return out


def ends(robot: Robot, share: float) -> tuple[Array, Array]:
    """The middle ``share`` of every degree of freedom's range, at most 3 from zero where the limits are wider."""
    low, high = np.maximum(robot.limits.position_lower, -3.0), np.minimum(robot.limits.position_upper, 3.0)
    assert (low <= high).all(), "a range that is more than 3 from zero"
    middle, half = (low + high) / 2, share * (high - low) / 2
    return middle - half, middle + half


def _cube(robot: Robot, rng: np.random.Generator) -> Array:
    return rng.uniform(-1.0, 1.0, robot.nv)
