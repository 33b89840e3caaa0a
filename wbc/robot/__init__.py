"""Robot models (floor 2)."""

from wbc.robot.dh import DHRow
from wbc.robot.limits import Limits
from wbc.robot.recipe import Recipe
from wbc.robot.robot import Coupling, Robot

__all__ = ["Coupling", "DHRow", "Limits", "Recipe", "Robot"]
