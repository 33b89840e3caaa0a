"""Surfaces of shapes as triangles, for pictures."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin

from wbc.shapes import Box, Capsule, Convex, Cylinder, PlacedShape, Solid, Sphere
from wbc.validation import Array

#: Points round a circle, and circles on a half sphere
AROUND, RINGS = 48, 12


def triangles(placed: PlacedShape) -> Array:
    """The shape's surface in the link's frame, m x 3 x 3 [m]."""
    place: pin.SE3 = placed.placement
    return np.asarray(_surface(placed.shape) @ place.rotation.T + place.translation)


def _surface(shape: Solid) -> Array:
    if isinstance(shape, Box):
        corners = np.array(np.meshgrid(*([-0.5, 0.5],) * 3)).reshape(3, -1).T
        return _hull(corners * np.array(shape.size))
    if isinstance(shape, Convex):
        return _hull(shape.points)
    if isinstance(shape, Cylinder):
        half = shape.length / 2
        return _turned(np.array([[0.0, -half], [shape.radius, -half], [shape.radius, half], [0.0, half]]))
    assert isinstance(shape, (Sphere, Capsule))
    half = shape.length / 2 if isinstance(shape, Capsule) else 0.0
    angle = np.linspace(0.0, math.pi / 2, RINGS + 1)
    cap = shape.radius * np.stack([np.cos(angle), np.sin(angle)], axis=1) + np.array([0.0, half])
    return _turned(np.concatenate([cap[::-1] * np.array([1.0, -1.0]), cap]))


def _hull(points: Array) -> Array:
    from scipy.spatial import ConvexHull

    return np.asarray(points[ConvexHull(points).simplices])


def _turned(profile: Array) -> Array:
    """The surface that points (distance from z, height), n x 2, sweep round the z axis."""
    angle = 2.0 * math.pi * np.arange(AROUND) / AROUND
    wide, height = profile[:, :1], np.broadcast_to(profile[:, 1:], (len(profile), AROUND))
    rings = np.stack([wide * np.cos(angle), wide * np.sin(angle), height], axis=2)
    a, b = rings[:-1], rings[1:]
    c, d = np.roll(a, -1, axis=1), np.roll(b, -1, axis=1)
    both = [np.stack(corners, axis=2).reshape(-1, 3, 3) for corners in ([a, b, d], [a, d, c])]
    return np.concatenate(both)
