"""Walking on holds: structures, and the kinematics of the walker's arms in closed form (floor 8)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wbc import lazy

if TYPE_CHECKING:
    from wbc.errors import StructureFileError as StructureFileError
    from wbc.walking.arms.puma import ArmKinematics as ArmKinematics
    from wbc.walking.holds.built_in import (
        cylinder as cylinder,
        module as module,
        plane as plane,
        remove_columns as remove_columns,
        remove_fraction as remove_fraction,
        remove_rows as remove_rows,
        truss as truss,
    )
    from wbc.walking.holds.files import (
        parse_structure as parse_structure,
        read_structure as read_structure,
        save_structure as save_structure,
    )
    from wbc.walking.holds.hold import Hold as Hold
    from wbc.walking.holds.obstacle import Obstacle as Obstacle
    from wbc.walking.holds.structure import Structure as Structure
    from wbc.walking.holds.surface import CylinderSurface as CylinderSurface, PlaneSurface as PlaneSurface
else:
    __getattr__, __dir__, __all__ = lazy.attach(__name__, __file__)
