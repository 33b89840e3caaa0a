"""Robot models (floor 2)."""

from wbc.robot.dead_points import DeadPoint
from wbc.robot.limits import Limits
from wbc.robot.loops import JointCurve, Loop, LoopError
from wbc.robot.recipe import Recipe
from wbc.robot.robot import Coupling, Robot
from wbc.robot.sources.dh import DHRow

__all__ = ["Coupling", "DHRow", "DeadPoint", "JointCurve", "Limits", "Loop", "LoopError", "Recipe", "Robot"]
