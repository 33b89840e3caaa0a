"""A structure that is nothing but a plane or a cylinder, as the compiled code wants it."""

from __future__ import annotations

from wbc.walking.holds.structure import Structure
from wbc.walking.holds.surface import CylinderSurface
from wbc.walking.native import compiled


def plain_surface(structure: Structure) -> compiled.Numbers | None:
    """A point, a direction and a radius, 0 for a plane.

    None where there is more than a surface, or none, or no compiler.
    """
    surface = structure.surface
    if surface is None or structure.obstacles or compiled.library() is None:
        return None
    radius = surface.radius if isinstance(surface, CylinderSurface) else 0.0
    return compiled.doubles([*surface.pose.translation, *surface.pose.rotation[:, 2], radius])
