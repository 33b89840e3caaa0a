"""Geometric shapes: parameters in metres, each in its own frame; a file a shape.

Shapes are plain data. They are bounded bodies on links or obstacles in the world (also :class:`HalfSpace`); a mesh
is a list of :class:`Convex` parts. Where a shape sits is said by whoever uses it.
"""

from wbc.shapes.box import Box
from wbc.shapes.convex import Convex
from wbc.shapes.cylinder import Cylinder
from wbc.shapes.ellipsoid import Ellipsoid
from wbc.shapes.height_map import HeightMap
from wbc.shapes.round import Capsule, Sphere
from wbc.shapes.solid import FAR, Geometry, HalfSpace, PlacedShape, Shape, Solid

__all__ = [
    "FAR",
    "Box",
    "Capsule",
    "Convex",
    "Cylinder",
    "Ellipsoid",
    "Geometry",
    "HalfSpace",
    "HeightMap",
    "PlacedShape",
    "Shape",
    "Solid",
    "Sphere",
]
