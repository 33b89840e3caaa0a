"""Robot models (floor 2)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wbc import lazy

if TYPE_CHECKING:
    from wbc.robot.dead_points import DeadPoint as DeadPoint
    from wbc.robot.limits import Limits as Limits
    from wbc.robot.loops import JointCurve as JointCurve, Loop as Loop, LoopError as LoopError
    from wbc.robot.recipe import Recipe as Recipe
    from wbc.robot.robot import Coupling as Coupling, Robot as Robot
    from wbc.robot.sources.dh import DHRow as DHRow
else:
    __getattr__, __dir__, __all__ = lazy.attach(__name__, __file__)
