"""Walking on holds: structures, and the kinematics of the walker's arms in closed form (floor 8)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wbc import lazy

if TYPE_CHECKING:
    from wbc.errors import StructureFileError
    from wbc.walking.arms.puma import ArmKinematics
    from wbc.walking.arms.two_ended import TwoEndedKinematics
    from wbc.walking.holds.built_in import (
        cylinder,
        module,
        plane,
        remove_columns,
        remove_fraction,
        remove_rows,
        truss,
    )
    from wbc.walking.holds.files import parse_structure, read_structure, save_structure
    from wbc.walking.holds.hold import Hold
    from wbc.walking.holds.obstacle import Obstacle
    from wbc.walking.holds.structure import Structure
    from wbc.walking.holds.surface import CylinderSurface, PlaneSurface
else:
    __getattr__ = lazy.attach(__name__, __file__)

__all__ = [
    "ArmKinematics",
    "CylinderSurface",
    "Hold",
    "Obstacle",
    "PlaneSurface",
    "Structure",
    "StructureFileError",
    "TwoEndedKinematics",
    "cylinder",
    "module",
    "parse_structure",
    "plane",
    "read_structure",
    "remove_columns",
    "remove_fraction",
    "remove_rows",
    "save_structure",
    "truss",
]
