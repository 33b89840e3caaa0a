"""Walking on holds: structures, and the kinematics of the walker's arms in closed form (floor 8)."""

from wbc.errors import StructureFileError
from wbc.walking.arm_kinematics import ArmKinematics
from wbc.walking.hold import Hold
from wbc.walking.obstacle import Obstacle
from wbc.walking.structure import Structure
from wbc.walking.structure_file import parse_structure, read_structure, save_structure
from wbc.walking.structures import (
    cylinder,
    module,
    plane,
    remove_columns,
    remove_fraction,
    remove_rows,
    truss,
)
from wbc.walking.surface import CylinderSurface, PlaneSurface
from wbc.walking.two_ended_kinematics import TwoEndedKinematics

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
