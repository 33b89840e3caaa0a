"""Names of all shapes, for messages: who imports this imports them all."""

from __future__ import annotations

from wbc.shapes import box, convex, cylinder, ellipsoid, height_map, round as rounded
from wbc.shapes.solid import HalfSpace, Solid

#: The files of all shapes
_FILES = (box, convex, cylinder, ellipsoid, height_map, rounded)


def names_of_shapes() -> list[str]:
    """Names of all shapes that the package has, from A to Z."""
    kinds = {
        kind for file in _FILES for kind in vars(file).values() if isinstance(kind, type) and issubclass(kind, Solid)
    }
    return sorted(kind.__name__ for kind in kinds - {Solid} | {HalfSpace})
