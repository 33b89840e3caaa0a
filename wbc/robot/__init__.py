"""Robot models (floor 2)."""

from wbc.robot.limits import Limits
from wbc.robot.robot import Coupling, Robot

__all__ = ["Coupling", "Limits", "Robot"]
