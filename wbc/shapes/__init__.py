"""Geometric shapes: parameters in metres, each in its own frame; a file a shape.

Shapes are plain data. They are bounded bodies on links or obstacles in the world (also :class:`HalfSpace`); a mesh
is a list of :class:`Convex` parts. Where a shape sits is said by whoever uses it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from wbc import lazy

if TYPE_CHECKING:
    from wbc.shapes.box import Box as Box
    from wbc.shapes.convex import Convex as Convex
    from wbc.shapes.cylinder import Cylinder as Cylinder
    from wbc.shapes.ellipsoid import Ellipsoid as Ellipsoid
    from wbc.shapes.height_map import HeightMap as HeightMap
    from wbc.shapes.placed import PlacedShape as PlacedShape
    from wbc.shapes.round import Capsule as Capsule, Sphere as Sphere
    from wbc.shapes.solid import (
        FAR as FAR,
        Geometry as Geometry,
        HalfSpace as HalfSpace,
        Shape as Shape,
        Solid as Solid,
    )
else:
    __getattr__, __dir__, __all__ = lazy.attach(__name__, __file__)
