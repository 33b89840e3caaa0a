"""Shapes as geometries of Coal."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

# isort: split
import pinocchio as pin

# isort: split
import coal

from wbc.errors import ShapeError
from wbc.shapes import Box, Capsule, Convex, Cylinder, HalfSpace, Shape, Sphere
from wbc.validation import Array


@dataclass(frozen=True, eq=False)
class Geometry:
    """A shape for Coal.

    Attributes:
        geometry: the Coal object; its origin is the centre of a sphere round the shape.
        center: that centre in the shape's frame [m].
    """

    geometry: Any
    center: Array

    @property
    def offset(self) -> pin.SE3:
        """Pose of the geometry in the shape's frame."""
        return pin.SE3(np.eye(3), self.center)


def geometry_of(shape: Shape) -> Geometry:
    """The geometry of a shape.

    Raises:
        ShapeError: no shape of :mod:`wbc.shapes`.
    """
    made = _made(shape)
    # GJK starts from the boxes' centres
    made.geometry.computeLocalAABB()
    return made


def _made(shape: Shape) -> Geometry:
    zero = np.zeros(3)
    if isinstance(shape, Sphere):
        return Geometry(coal.Sphere(shape.radius), zero)
    if isinstance(shape, Capsule):
        return Geometry(coal.Capsule(shape.radius, shape.length), zero)
    if isinstance(shape, Box):
        return Geometry(coal.Box(*shape.size), zero)
    if isinstance(shape, Cylinder):
        return Geometry(coal.Cylinder(shape.radius, shape.length), zero)
    if isinstance(shape, HalfSpace):
        return Geometry(coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0), zero)
    if isinstance(shape, Convex):
        center, _ = sphere_round(shape)
        points = coal.StdVec_Vec3s()
        for point in shape.points - center:
            points.append(point)
        # "Qt": faces of more than three corners are cut into triangles, which Coal needs
        return Geometry(coal.Convex.convexHull(points, True, "Qt"), center)
    raise ShapeError("shape", shape, "this is no shape")


def sphere_round(shape: Shape) -> tuple[Array, float]:
    """(centre in the shape's frame, radius) of a sphere round a shape [m]; infinite round a half-space."""
    if isinstance(shape, Convex):
        center = shape.points.mean(axis=0)
        return center, float(np.linalg.norm(shape.points - center, axis=1).max())
    return np.zeros(3), _radius(shape)


def _radius(shape: Sphere | Capsule | Box | Cylinder | HalfSpace) -> float:
    if isinstance(shape, Sphere):
        return shape.radius
    if isinstance(shape, Capsule):
        return shape.radius + shape.length / 2
    if isinstance(shape, Box):
        return float(np.linalg.norm(shape.size)) / 2
    return np.inf if isinstance(shape, HalfSpace) else float(np.hypot(shape.radius, shape.length / 2))
