"""How frames and the centre of mass of one robot move at a velocity v: rates, and their rates where v does not change.

What a program of accelerations or torques is made of, in one sweep over the bodies that all its items and its dynamics
share.
"""

from __future__ import annotations

from functools import cached_property

import casadi as ca

from wbc.symbolic.dynamics import Centroidal, Dynamics
from wbc.symbolic.kinematics import WORLD, Kinematics
from wbc.symbolic.velocity import Velocities


class MotionExpressions:
    """Velocities and dynamics of one :class:`Kinematics`, each built on first use.

    Attributes:
        velocities, dynamics: with one sweep of velocities and of accelerations at zero joint acceleration.
    """

    def __init__(self, kinematics: Kinematics) -> None:
        self.kinematics = kinematics
        self.velocities = Velocities(kinematics)
        self.dynamics = Dynamics(kinematics, self.velocities)
        self._frames: dict[str, tuple[ca.SX, ca.SX]] = {}

    def frame(self, frame: str) -> tuple[ca.SX, ca.SX]:
        """(J v, (dJ/dt) v) of a frame, linear then angular, world axes [m/s, rad/s; per s]."""
        known = self._frames.get(frame)
        if known is None:
            if frame == WORLD:
                known = (ca.SX.zeros(6), ca.SX.zeros(6))
            else:
                known = (self.velocities.frame_velocity(frame), self.velocities.jacobian_drift(frame))
            self._frames[frame] = known
        return known

    def part(self, frame: str, rows: slice) -> tuple[ca.SX, ca.SX]:
        """Some rows of :meth:`frame`."""
        rate, bias = self.frame(frame)
        return rate[rows], bias[rows]

    def spin(self, frame: str, base: str) -> tuple[ca.SX, ca.SX]:
        """Angular velocity of a frame past another, world axes, and its rate."""
        (own, own_bias), (other, other_bias) = self.frame(frame), self.frame(base)
        return own[3:] - other[3:], own_bias[3:] - other_bias[3:]

    @cached_property
    def center_of_mass(self) -> tuple[ca.SX, ca.SX]:
        """(dc/dt, (dJ_c/dt) v) of the centre of mass [m/s, m/s^2]."""
        centroidal = Centroidal(self.dynamics)
        return ca.densify(centroidal.center_of_mass_velocity), ca.densify(centroidal.center_of_mass_drift)
