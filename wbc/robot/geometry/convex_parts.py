"""A mesh as convex bodies: the hull of each of its connected components."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.errors import RangeError, RobotFileError, ShapeError
from wbc.robot.geometry.hull import Hull
from wbc.robot.geometry.meshes import Mesh
from wbc.shapes import Convex
from wbc.validation import Array

#: A component counts as inside another's hull up to this, relative to the hull's size.
INSIDE = 1e-9


@dataclass(frozen=True, eq=False)
class ConvexParts:
    """Convex bodies that contain a mesh.

    Attributes:
        parts: largest first, in the mesh's frame.
        remarks: one sentence about each component that has no part of its own.
    """

    parts: tuple[Convex, ...]
    remarks: tuple[str, ...] = ()


def parts_of(mesh: Mesh) -> ConvexParts:
    """The hulls of a mesh's connected components (triangles that share vertices).

    A component inside the hull of a larger one is left out. A component without volume (flat, or fewer than four
    points) joins the nearest part, which grows around it. So all vertices are within the parts.

    Raises:
        RobotFileError: no component has a volume.

    Cannot do: split a component that is not convex; its hull fills its hollows.
    """
    solids: list[tuple[Convex, Hull]] = []
    flat: list[Array] = []
    remarks: list[str] = []
    for points in sorted(mesh.components(), key=_extent, reverse=True):
        if any(_inside(hull, points) for _, hull in solids):
            remarks.append(f"a component of {len(points)} points is inside another")
            continue
        try:
            part = Convex(points)
        except (RangeError, ShapeError):
            flat.append(points)
            continue
        solids.append((part, Hull(part.points)))
    if not solids:
        raise RobotFileError("mesh", f"{len(mesh.vertices)} points", "no component has a volume")
    for points in flat:
        if any(_inside(hull, points) for _, hull in solids):
            remarks.append(f"a flat component of {len(points)} points is inside another")
            continue
        gaps = [hull.beyond(points).max() for _, hull in solids]
        nearest = int(np.argmin(gaps))
        part = Convex(np.vstack([solids[nearest][0].points, points]))
        solids[nearest] = (part, Hull(part.points))
        remarks.append(f"a flat component of {len(points)} points joined the nearest part, {gaps[nearest]:.3g} m away")
    return ConvexParts(tuple(part for part, _ in solids), tuple(remarks))


def _extent(points: Array) -> float:
    return float(np.prod(np.ptp(points, axis=0) + 1e-3 * np.ptp(points)))


def _inside(hull: Hull, points: Array) -> bool:
    return bool(hull.beyond(points).max() <= INSIDE * float(np.ptp(hull.vertices)))
