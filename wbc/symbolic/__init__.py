"""Symbolic kinematics and dynamics from a ``pin.Model`` (floor 1: imports nothing above it)."""

from wbc.symbolic.dynamics import Centroidal, Dynamics
from wbc.symbolic.kinematics import WORLD, Kinematics, Pose
from wbc.symbolic.tracer import Tracer
from wbc.symbolic.two_velocities import TwoVelocityDynamics
from wbc.symbolic.velocity import Velocities

__all__ = ["WORLD", "Centroidal", "Dynamics", "Kinematics", "Pose", "Tracer", "TwoVelocityDynamics", "Velocities"]
