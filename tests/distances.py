"""Signed distances of two shapes by Coal: the judge of all that the package says of distances."""

from __future__ import annotations

import numpy as np

# isort: split
import pinocchio as pin

# isort: split
import coal

from wbc.clearance import EndlessCylinder, TriangleMesh
from wbc.shapes import Box, Capsule, Convex, Cylinder, Ellipsoid, HalfSpace, Shape, Sphere

#: A cylinder without end is so long [m]
ENDLESS = 100.0


def coal_shape(shape: Shape | EndlessCylinder | TriangleMesh) -> object:
    """Coal's own, about the same origin."""
    if isinstance(shape, TriangleMesh):
        return _mesh(shape)
    if isinstance(shape, EndlessCylinder):
        return coal.Cylinder(shape.radius, ENDLESS)
    if isinstance(shape, Sphere):
        return coal.Sphere(shape.radius)
    if isinstance(shape, Capsule):
        return coal.Capsule(shape.radius, shape.length)
    if isinstance(shape, Cylinder):
        return coal.Cylinder(shape.radius, shape.length)
    if isinstance(shape, Box):
        return coal.Box(*shape.size)
    if isinstance(shape, Ellipsoid):
        return coal.Ellipsoid(*shape.semi_axes)
    if isinstance(shape, Convex):
        points = coal.StdVec_Vec3s()
        points.extend(shape.points)
        return coal.Convex.convexHull(points, True, "Qt")
    assert isinstance(shape, HalfSpace), shape
    return coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)


def _mesh(shape: TriangleMesh) -> object:
    corners, rows = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    corners.extend(list(shape.corners.reshape(-1, 3)))
    rows.extend([coal.Triangle(3 * k, 3 * k + 1, 3 * k + 2) for k in range(len(shape.corners))])
    mesh = coal.BVHModelOBBRSS()
    mesh.beginModel(len(rows), len(corners))
    mesh.addSubModel(corners, rows)
    mesh.endModel()
    return mesh


def coal_pose(pose: pin.SE3) -> object:
    return coal.Transform3s(pose.rotation, pose.translation)


def coal_distance(a: Shape, at: pin.SE3, b: Shape, there: pin.SE3, tolerance: float | None = None) -> float:
    """Below zero where they overlap [m]; ``tolerance`` of Coal's iterations where its own will not do."""
    request = coal.DistanceRequest()
    request.enable_signed_distance = True
    if tolerance is not None:
        request.gjk_tolerance, request.epa_tolerance = tolerance, 10 * tolerance
    result = coal.DistanceResult()
    return float(coal.distance(coal_shape(a), coal_pose(at), coal_shape(b), coal_pose(there), request, result))
