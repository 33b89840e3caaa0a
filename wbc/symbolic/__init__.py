"""Symbolic kinematics and dynamics from a ``pin.Model`` (floor 1: imports nothing above it)."""

from wbc.symbolic.kinematics import WORLD, Kinematics, Pose
from wbc.symbolic.tracer import Tracer

__all__ = ["WORLD", "Kinematics", "Pose", "Tracer"]
