"""Symbolic kinematics and dynamics from a ``pin.Model`` (floor 1: imports nothing above it)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wbc import lazy

if TYPE_CHECKING:
    from wbc.symbolic.dynamics import Centroidal as Centroidal, Dynamics as Dynamics
    from wbc.symbolic.kinematics import WORLD as WORLD, Kinematics as Kinematics, Pose as Pose
    from wbc.symbolic.tracer import Tracer as Tracer
    from wbc.symbolic.two_velocities import TwoVelocityDynamics as TwoVelocityDynamics
    from wbc.symbolic.velocity import Velocities as Velocities
else:
    __getattr__, __dir__, __all__ = lazy.attach(__name__, __file__)
