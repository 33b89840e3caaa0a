"""Holds of a structure that is made like the published cylinder, by grid coordinates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bench.walk.reference.arm_table import Flags
from wbc.errors import RangeError, ShapeError
from wbc.walking.holds.built_in import PITCH, RADIUS
from wbc.walking.holds.hold import FREE
from wbc.walking.holds.structure import Structure
from wbc.walking.holds.surface import CylinderSurface

#: By how much a hold may be off its place in the grid [m], and its axis off the normal
OFF = 1e-6


@dataclass(frozen=True, eq=False)
class GridHolds:
    """Which places of a grid have a hold.

    Attributes:
        present: ``[T, A]``. first: T and A of the first entry.
        ids: (T, A) -> id.
    """

    present: Flags
    first: tuple[int, int]
    ids: dict[tuple[int, int], str]

    def places(self) -> dict[str, tuple[int, int]]:
        """Id -> (T, A)."""
        return {hold: place for place, hold in self.ids.items()}


def grid_holds(structure: Structure) -> GridHolds:
    """The holds of the published cylinder or of a part of it, wherever it was moved to.

    Raises:
        ShapeError: not a structure on such a cylinder. RangeError: obstacles, or a hold off the grid, with a fixed roll
            or an axis that is not the normal.
    """
    if not isinstance(structure, Structure):
        raise ShapeError("structure", structure, "expected a Structure")
    surface = structure.surface
    if not isinstance(surface, CylinderSurface) or abs(surface.radius - RADIUS) > OFF:
        raise ShapeError("structure.surface", structure.name, "the reference knows the published cylinder only")
    if structure.obstacles:
        raise RangeError("structure.obstacles", structure.name, "the reference knows no obstacles")
    rotation, origin = surface.pose.rotation, surface.pose.translation
    local = (structure.positions - origin) @ rotation
    angle = np.pi - np.arctan2(local[:, 1], local[:, 0])
    places = np.column_stack([(np.degrees(angle) - 25.0) / 5.0, -local[:, 2] / PITCH])
    places[:, 0] = (places[:, 0] + 18.0) % 72.0 - 18.0
    whole = np.rint(places).astype(np.int64)
    off = np.abs(places - whole).max(axis=1) * PITCH + np.abs(np.hypot(local[:, 0], local[:, 1]) - RADIUS)
    turned = np.abs(structure.axes + surface.normal(structure.positions)).max(axis=1)
    for k, hold in enumerate(structure.holds):
        if off[k] > OFF or turned[k] > OFF or hold.roll != FREE:
            raise RangeError(
                f"hold {hold.id}", hold.roll, "expected a hold of the grid, along the normal, free to roll"
            )
    first, last = whole.min(axis=0), whole.max(axis=0)
    if last[0] - first[0] > 60:
        raise RangeError(
            "structure.holds", structure.name, "the holds go round the cylinder; expected up to 300 degrees"
        )
    present = np.zeros(last - first + 1, dtype=bool)
    present[tuple((whole - first).T)] = True
    ids = {(int(t), int(a)): hold.id for (t, a), hold in zip(whole.tolist(), structure.holds, strict=True)}
    return GridHolds(present, (int(first[0]), int(first[1])), ids)
