"""The same robot in other units of length: every metre in model, limits and shapes becomes ``scale`` units."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin

from wbc.robot import Limits, Robot
from wbc.shapes import Capsule, PlacedShape, Sphere


def scaled(robot: Robot, scale: float) -> Robot:
    """The robot with all lengths times ``scale``."""
    model = pin.Model(robot.model)
    for j in range(model.njoints):
        model.jointPlacements[j] = moved(model.jointPlacements[j], scale)
        body = model.inertias[j]
        model.inertias[j] = pin.Inertia(body.mass, scale * body.lever, scale**2 * body.inertia)
    for frame in model.frames:
        frame.placement = moved(frame.placement, scale)
    size = np.where(np.array(robot.dof_units) == "m", scale, 1.0)
    old = robot.limits
    effort = old.effort * np.where(size == scale, scale, scale**2)
    limits = Limits(
        old.position_lower * size, old.position_upper * size, old.velocity * size, old.acceleration * size, effort
    )
    # The model's own limits are not read any more once a robot has its Limits
    shapes = {
        link: tuple(PlacedShape(resized(s.shape, scale), moved(s.placement, scale), scale * s.excess) for s in group)
        for link, group in robot.shapes.items()
    }
    neutral = configuration(robot, robot.neutral, scale)
    return replace(robot, model=model, limits=limits, shapes=shapes, neutral=neutral)


def resized(shape: Sphere | Capsule, scale: float) -> Sphere | Capsule:
    """A shape with all lengths times ``scale``."""
    if isinstance(shape, Sphere):
        return Sphere(scale * shape.radius)
    return Capsule(scale * shape.radius, scale * shape.length)


def moved(placement: pin.SE3, scale: float) -> pin.SE3:
    """A pose with its position times ``scale``."""
    return pin.SE3(placement.rotation, scale * placement.translation)


def configuration(robot: Robot, q: np.ndarray, scale: float) -> np.ndarray:
    """q with sliding joints and the base's position times ``scale``; unlike ``dof_units``, by joint type."""
    return _lengths_scaled(robot.model, q, robot.model.idx_qs, scale)


def velocity(robot: Robot, v: np.ndarray, scale: float) -> np.ndarray:
    """v with sliding joints and the base's linear velocity times ``scale``; by joint type."""
    return _lengths_scaled(robot.model, v, robot.model.idx_vs, scale)


def _lengths_scaled(model: pin.Model, values: np.ndarray, starts: list[int], scale: float) -> np.ndarray:
    out = np.array(values)
    for j in range(1, model.njoints):
        kind, start = model.joints[j].shortname().removeprefix("JointModel"), int(starts[j])
        lengths = 3 if kind == "FreeFlyer" else 2 if kind == "Planar" else 1 if kind.startswith("P") else 0
        out[start : start + lengths] *= scale
    return out
