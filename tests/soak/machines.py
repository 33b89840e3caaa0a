"""Random robots: chains of hinges and slides, some on a floating or sliding base, with random limits and shapes."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

import wbc
from wbc.robot import Robot
from wbc.shapes import Capsule, PlacedShape, Sphere

_JOINTS = (pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ, pin.JointModelPX, pin.JointModelRUBZ)
_SHARES = (0.3, 0.3, 0.3, 0.05, 0.05)


def machine(rng: np.random.Generator) -> Robot:
    """Three to nine joints in series with a branch now and then; every joint has a frame ``f0``, ``f1``, ..."""
    model = pin.Model()
    model.name = "random"
    # not Inertia.Random(), whose numbers depend on what the process did before; this leaves the other draws as they are
    other = np.random.Generator(rng.bit_generator.jumped())
    count, parent, chain = int(rng.integers(3, 10)), 0, []
    if rng.random() < 0.2:
        base = pin.JointModelFreeFlyer() if rng.random() < 0.5 else pin.JointModelPlanar()
        parent = model.addJoint(0, base, pin.SE3.Identity(), "base")
    for k in range(count):
        kind = _JOINTS[int(rng.choice(len(_JOINTS), p=_SHARES))]
        place = pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(0.0, 0.25, 3))
        if chain and rng.random() < 0.1:
            chain = chain[: 1 + int(rng.integers(len(chain)))]
            parent = chain[-1]
        parent = model.addJoint(parent, kind(), place, f"j{k}")
        chain.append(parent)
        model.appendBodyToJoint(parent, inertia(other), pin.SE3.Identity())
        tip = pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(0.0, 0.2, 3))
        model.addFrame(pin.Frame(f"f{k}", parent, 0, tip, pin.FrameType.OP_FRAME))
    robot = wbc.robots.load(model)
    robot = robot.with_limits(**_limits(robot, rng))
    shapes = {f"f{k}": [PlacedShape(Sphere(0.05), pin.SE3.Identity())] for k in range(0, count, 2)}
    shapes["f1"] = [PlacedShape(Capsule(0.04, 0.3), pin.SE3.Identity())]
    return robot.with_shapes(shapes)


def inertia(rng: np.random.Generator) -> pin.Inertia:
    """Of up to 1 kg within 1 m, as ``pin.Inertia.Random()`` draws it."""
    root = np.triu(rng.uniform(-1.0, 1.0, (3, 3)))
    root += np.triu(root, 1).T
    return pin.Inertia(1.0 - float(rng.random()), rng.uniform(-1.0, 1.0, 3), root @ root)


def _limits(robot: Robot, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Velocity and acceleration limits everywhere, position limits where there is a coordinate to limit."""
    width = np.where(robot.position_index >= 0, rng.uniform(0.3, 3.0, robot.nv), np.inf)
    bounded = np.isfinite(robot.limits.position_lower) | (robot.position_index >= 0)
    unlimited = ~bounded | np.array(["RUB" in name for name in _kinds(robot)])
    width[unlimited] = np.inf
    return {
        "velocity": 10.0 ** rng.uniform(-1.0, 1.0, robot.nv),
        "acceleration": 10.0 ** rng.uniform(0.0, 2.0, robot.nv),
        "position_lower": -width,
        "position_upper": width * rng.uniform(0.5, 1.0, robot.nv),
    }


def _kinds(robot: Robot) -> list[str]:
    """Joint type of every degree of freedom."""
    out: list[str] = []
    for joint in list(robot.model.joints)[1:]:
        out += [joint.shortname()] * joint.nv
    return out


def configuration(robot: Robot, rng: np.random.Generator, outside: bool) -> np.ndarray:
    """Anywhere within the limits, or with some joints outside by up to half a unit."""
    spread = np.where(np.array(robot.dof_units) == "m", 0.5, 2.0)
    q: np.ndarray = pin.integrate(robot.model, robot.neutral, spread * rng.uniform(-1.0, 1.0, robot.nv))
    for i, k in enumerate(robot.position_index):
        low, high = robot.limits.position_lower[i], robot.limits.position_upper[i]
        if k < 0 or not np.isfinite(high - low):
            continue
        q[k] = rng.uniform(low, high)
        if outside and rng.random() < 0.4:
            q[k] = rng.choice([low - rng.uniform(0.0, 0.5), high + rng.uniform(0.0, 0.5)])
    return q
